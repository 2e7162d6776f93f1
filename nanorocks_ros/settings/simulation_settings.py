"""Settings of the simulated gas, the scene and its films."""

from __future__ import annotations

from dataclasses import dataclass, field

from nanorocks_ros.settings.setting_fields import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationSettings:
    """A simulated tray and the camera over it."""

    tray: int = setting(1, 'tray to simulate', low=1, high=8)
    seed: int = setting(1, 'seed of everything random', low=0, high=2**31 - 1)
    restitution: float = setting(
        0.89, 'coefficient of restitution between beads', low=0.0, high=1.0
    )
    restitution_width: float = setting(
        0.0,
        'full width of the even distribution that the restitution of each collision is drawn from',
        low=0.0,
        high=1.0,
    )
    wall_restitution: float = setting(
        0.99, 'coefficient of restitution at the walls', low=0.0, high=1.0
    )
    floor_lid_difference: float = setting(
        0.0,
        'restitution of floor and lid less that of the side walls; both stay within 0 and 1',
        low=-1.0,
        high=1.0,
    )
    sticking_speed: float = setting(
        0.0, 'beads that meet more slowly stick together', 'm/s', low=0.0, high=1.0
    )
    wall_sticking_speed: float = setting(
        0.0, 'beads that meet a wall more slowly stay there', 'm/s', low=0.0, high=1.0
    )
    sticking_measure: str = setting(
        'normal',
        'speed compared with the sticking speed: along the normal of the contact, or all of it',
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
        'coefficient of friction of rough beads, above which contacts slide; large: none slides',
        low=0.0,
        high=1e6,
    )
    wall_friction: float = setting(1e6, 'the same of rough beads at the walls', low=0.0, high=1e6)
    speeds: str = setting(
        'uniform',
        'speeds after a shaking event: even in [0, 2 mean], Maxwellian, or those of a tray whose '
        'walls were really shaken, scaled to the mean',
        choices=('uniform', 'maxwellian', 'shaken'),
    )
    vertical_speed_factor: float = setting(
        1.0,
        'by how much velocities across the tray, towards the camera, are larger after a shaking '
        'event than `speeds` says',
        low=0.0,
        high=100.0,
    )
    shake_frequency: float = setting(
        5.0, 'speeds=shaken: frequency of the walls', '1/s', low=0.1, high=1000.0
    )
    shake_periods: int = setting(20, 'speeds=shaken: periods of the walls', low=1, high=10000)
    mean_speed: float = setting(
        0.007, 'mean 3-D speed after a shaking event', 'm/s', low=0.0, high=1.0
    )
    first_shake: float = setting(
        1.0, 'time of the first shaking event; the beads rest before it', 's', low=0.0, high=3600.0
    )
    shake_period: float = setting(60.0, 'time between shaking events', 's', low=0.1, high=3600.0)
    frame_rate: float = setting(30.0, 'frames per second', '1/s', low=0.1, high=1000.0)
    width_px: int = setting(1920, 'width of the picture', 'px', low=16, high=8192)
    height_px: int = setting(1080, 'height of the picture', 'px', low=16, high=8192)
    pixels_per_metre: float = setting(13500.0, 'scale of the picture', 'px/m', low=100.0, high=1e6)
    noise: float = setting(
        2.0, 'standard deviation of the sensor noise', 'gray levels', low=0.0, high=64.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneSettings:
    """The whole plate under the camera, and what camera and light do; a strength of 0 is off."""

    trays: tuple[int, ...] = setting(
        (1, 2, 3, 4, 5, 6, 7, 8), 'trays with beads in them', low=1, high=8, whole=True
    )
    pixels_per_metre: float = setting(
        12500.0, 'scale in the middle of the lens', 'px/m', low=1000.0, high=1e5
    )
    fisheye: float = setting(
        0.6,
        'angle from the axis at which the lens sees the middle of the left edge of the rectified '
        'picture; 0: a straight lens',
        'rad',
        low=0.0,
        high=1.2,
    )
    lens_distortion: tuple[float, ...] = setting(
        (-0.02, 0.004, 0.0, 0.0), 'k1 to k4 of the fisheye lens', low=-1.0, high=1.0
    )
    lens_offset_px: tuple[float, ...] = setting(
        (9.0, -6.0), 'column and row of the axis, from the middle', 'px', low=-500.0, high=500.0
    )
    defocus_px: float = setting(
        0.7, 'standard deviation of the blur of the lens', 'px', low=0.0, high=10.0
    )
    noise: float = setting(
        2.0, 'standard deviation of the sensor noise', 'gray levels', low=0.0, high=64.0
    )
    vignetting: float = setting(
        0.25, 'light lost from the middle of the picture to its left edge', low=0.0, high=0.9
    )
    gradient: float = setting(
        0.12,
        'light gained from edge to edge, along columns and half of it along rows',
        low=0.0,
        high=1.0,
    )
    flicker: float = setting(
        0.015, 'amplitude of the bands of light that roll over the picture', low=0.0, high=0.5
    )
    flicker_period: float = setting(
        4.1, 'time in which a band comes round', 's', low=0.01, high=1000.0
    )
    shading: float = setting(
        1.0, 'shading of the beads; 0: discs of one even colour', low=0.0, high=1.0
    )
    highlights: float = setting(1.0, 'mirror images of the lamp on the beads', low=0.0, high=2.0)
    shadows: float = setting(0.25, 'light that the beads keep from the floor', low=0.0, high=1.0)
    chalk: float = setting(
        1.0, 'dust on beads, floor and walls of the trays that have chalk', low=0.0, high=2.0
    )
    glare: float = setting(
        1.0, 'reflections of the LEDs in the window over trays 2 and 4', low=0.0, high=5.0
    )
    ovality: float = setting(
        0.12,
        'copper beads: spread of the axis ratio from 1, drawn for each; areas stay',
        low=0.0,
        high=0.4,
    )
    irregularity: float = setting(
        0.12, 'JSC-1 grains: spread of the outline; areas stay', low=0.0, high=0.3
    )
    turning: float = setting(
        1.0,
        'spread of the angular speeds of beads and grains about the line of sight, after shaking',
        'rad/s',
        low=0.0,
        high=100.0,
    )
    swing: float = setting(
        0.0002, 'first amplitude of the plate on its springs', 'm', low=0.0, high=0.002
    )
    swing_frequency: float = setting(1.5, 'of the swing', '1/s', low=0.1, high=15.0)
    swing_damping: float = setting(
        0.16, 'decay of its amplitude; 0.16: to 2 % in 25 s', '1/s', low=0.0, high=10.0
    )
    swing_direction: float = setting(
        0.6, 'angle from the columns to its direction in the picture', 'rad', low=-3.2, high=3.2
    )
    swing_knocks: bool = setting(
        True, 'whether the swinging walls pass on their motion to beads that hit them'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CompressionSettings:
    """How the pictures of a simulated film are compressed."""

    codec: str = setting(
        'jpeg',
        'jpeg: every picture by itself, as the quality makes it; jpeg_rate: so that the film has '
        'the size asked for; h264: as a stream of that size, decoded again (needs PyAV)',
        choices=('jpeg', 'jpeg_rate', 'h264'),
    )
    rate: float = setting(
        96e6,
        'jpeg_rate, h264: size of a minute at 30 frames per second; a frame at other rates is as '
        'large',
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
    """What the simulator films."""

    whole_scene: bool = setting(
        False, 'film the whole plate with the trays of `scene.trays`, not one tray alone'
    )
    effects: str = setting(
        'all',
        'of the scene: all as strong as set, or none at all',
        choices=('all', 'none'),
    )
