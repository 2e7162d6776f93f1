"""Settings of the simulated gas, of the scene and of its films.

Tested by ``test/settings/test_setting_fields.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from nanorocks_ros.settings.setting_fields import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationSettings:
    """A simulated tray and the camera over it."""

    tray: int = setting(1, 'tray to simulate', low=1, high=8)
    seed: int = setting(1, 'random seed', low=0, high=2**31 - 1)
    restitution: float = setting(
        0.89, 'coefficient of restitution between beads', low=0.0, high=1.0
    )
    restitution_width: float = setting(
        0.0,
        'full width of the uniform distribution of the restitution of single collisions',
        low=0.0,
        high=1.0,
    )
    wall_restitution: float = setting(
        0.99, 'coefficient of restitution at the walls', low=0.0, high=1.0
    )
    floor_lid_difference: float = setting(
        0.0,
        'restitution of floor and lid minus that of the side walls; both stay within 0 and 1',
        low=-1.0,
        high=1.0,
    )
    sticking_speed: float = setting(
        0.0, 'relative speed below which beads stick together', 'm/s', low=0.0, high=1.0
    )
    wall_sticking_speed: float = setting(
        0.0, 'speed below which beads stick to a wall', 'm/s', low=0.0, high=1.0
    )
    sticking_measure: str = setting(
        'normal',
        'speed compared with the sticking speed: along the normal of the contact, or the total',
        choices=('normal', 'total'),
    )
    tangential_restitution: float = setting(
        -1.0,
        'tangential restitution between beads; -1: smooth, 1: perfectly rough',
        low=-1.0,
        high=1.0,
    )
    wall_tangential_restitution: float = setting(
        -1.0, 'tangential restitution at the walls; -1: smooth', low=-1.0, high=1.0
    )
    friction: float = setting(
        1e6,
        'coefficient of friction of rough beads, at which contacts slide; large: no sliding',
        low=0.0,
        high=1e6,
    )
    wall_friction: float = setting(
        1e6, 'coefficient of friction of rough beads at the walls', low=0.0, high=1e6
    )
    speeds: str = setting(
        'uniform',
        'speed distribution after a shaking event: uniform in [0, 2 mean], Maxwellian, or from a '
        'simulation of shaken walls, scaled to the mean',
        choices=('uniform', 'maxwellian', 'shaken'),
    )
    vertical_speed_factor: float = setting(
        1.0,
        'factor on the vertical velocities, towards the camera, of `speeds` after a shaking event',
        low=0.0,
        high=100.0,
    )
    shake_frequency: float = setting(
        5.0, 'speeds=shaken: frequency of the walls', '1/s', low=0.1, high=1000.0
    )
    shake_periods: int = setting(
        20, 'speeds=shaken: number of periods of the walls', low=1, high=10000
    )
    mean_speed: float = setting(
        0.007, 'mean 3-D speed after a shaking event', 'm/s', low=0.0, high=1.0
    )
    first_shake: float = setting(
        1.0,
        'time of the first shaking event; the beads are at rest before it',
        's',
        low=0.0,
        high=3600.0,
    )
    shake_period: float = setting(60.0, 'time between shaking events', 's', low=0.1, high=3600.0)
    frame_rate: float = setting(30.0, 'frames per second', '1/s', low=0.1, high=1000.0)
    width_px: int = setting(1920, 'width of the image', 'px', low=16, high=8192)
    height_px: int = setting(1080, 'height of the image', 'px', low=16, high=8192)
    pixels_per_metre: float = setting(13500.0, 'image scale', 'px/m', low=100.0, high=1e6)
    noise: float = setting(
        2.0, 'standard deviation of the sensor noise', 'gray levels', low=0.0, high=64.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneSettings:
    """The whole plate, with effects of camera and light; a strength of 0 turns an effect off."""

    trays: tuple[int, ...] = setting(
        (1, 2, 3, 4, 5, 6, 7, 8), 'trays with beads in them', low=1, high=8, whole=True
    )
    pixels_per_metre: float = setting(
        12500.0, 'image scale at the optical axis', 'px/m', low=1000.0, high=1e5
    )
    fisheye: float = setting(
        0.6,
        'angle from the optical axis at the middle of the left edge of the rectified image; 0: '
        'perspective projection',
        'rad',
        low=0.0,
        high=1.2,
    )
    lens_distortion: tuple[float, ...] = setting(
        (-0.02, 0.004, 0.0, 0.0), 'k1 to k4 of the fisheye lens', low=-1.0, high=1.0
    )
    lens_offset_px: tuple[float, ...] = setting(
        (9.0, -6.0),
        'column and row of the optical axis, from the image centre',
        'px',
        low=-500.0,
        high=500.0,
    )
    defocus_px: float = setting(
        0.7, 'standard deviation of the defocus blur', 'px', low=0.0, high=10.0
    )
    noise: float = setting(
        2.0, 'standard deviation of the sensor noise', 'gray levels', low=0.0, high=64.0
    )
    vignetting: float = setting(
        0.25, 'fraction of light lost from the image centre to its left edge', low=0.0, high=0.9
    )
    gradient: float = setting(
        0.12,
        'fraction of light gained from edge to edge along columns; half of it along rows',
        low=0.0,
        high=1.0,
    )
    flicker: float = setting(
        0.015, 'amplitude of the bands of flicker that roll over the image', low=0.0, high=0.5
    )
    flicker_period: float = setting(
        4.1, 'period of the bands of flicker', 's', low=0.01, high=1000.0
    )
    shading: float = setting(
        1.0, 'shading of the beads; 0: discs of uniform colour', low=0.0, high=1.0
    )
    highlights: float = setting(
        1.0, 'specular highlights of the lamp on the beads', low=0.0, high=2.0
    )
    shadows: float = setting(
        0.25, 'fraction of light lost in shadows on the floor', low=0.0, high=1.0
    )
    chalk: float = setting(
        1.0, 'dust on beads, floor and walls of the trays with chalk', low=0.0, high=2.0
    )
    glare: float = setting(
        1.0, 'reflections of the LEDs in the window above trays 2 and 4', low=0.0, high=5.0
    )
    ovality: float = setting(
        0.12,
        'copper beads: spread of the axis ratio about 1, at constant area',
        low=0.0,
        high=0.4,
    )
    irregularity: float = setting(
        0.12, 'JSC-1 grains: spread of the outline, at constant area', low=0.0, high=0.3
    )
    turning: float = setting(
        1.0,
        'spread of the angular speeds about the line of sight after a shaking event',
        'rad/s',
        low=0.0,
        high=100.0,
    )
    swing: float = setting(
        0.0002,
        'initial amplitude of the oscillation of the plate on its springs',
        'm',
        low=0.0,
        high=0.002,
    )
    swing_frequency: float = setting(
        1.5, 'frequency of the oscillation of the plate', '1/s', low=0.1, high=15.0
    )
    swing_damping: float = setting(
        0.16, 'decay rate of the amplitude; 0.16: to 2 % in 25 s', '1/s', low=0.0, high=10.0
    )
    swing_direction: float = setting(
        0.6,
        'direction of the oscillation in the image, from the columns',
        'rad',
        low=-3.2,
        high=3.2,
    )
    swing_knocks: bool = setting(
        True, 'whether the oscillating walls transfer momentum to beads that hit them'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CompressionSettings:
    """Compression of the frames of a simulated film."""

    codec: str = setting(
        'jpeg',
        'jpeg: single frames at the given quality; jpeg_rate: single frames at the given `rate`; '
        'h264: a stream of that rate, decoded again (needs PyAV)',
        choices=('jpeg', 'jpeg_rate', 'h264'),
    )
    rate: float = setting(
        96e6,
        'jpeg_rate, h264: size of one minute at 30 frames per second; at other frame rates a '
        'frame has the same size',
        'bytes',
        low=1e5,
        high=1e10,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneFilmSettings:
    """A film of the whole plate."""

    scene: SceneSettings = field(default_factory=SceneSettings)
    compression: CompressionSettings = field(default_factory=CompressionSettings)


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmSettings:
    """Content of the simulated film."""

    whole_scene: bool = setting(
        False, 'film the whole plate with the trays of `scene.trays`, not one tray alone'
    )
    effects: str = setting(
        'all',
        'effects of the scene: all with their strengths, or none',
        choices=('all', 'none'),
    )
