"""Settings of the scene: the plate, its trays, camera, light and the compression of films.

Tested by ``test/settings/test_setting_fields.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from nanorocks_ros.settings.setting_fields import setting

# The lamp of the flight: a unit vector to the upper left of the picture, (-0.36, -0.48, 0.80).
_LAMP_AZIMUTH, _LAMP_ELEVATION = math.atan2(-0.48, -0.36), math.atan2(0.80, 0.60)


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
    close_up: bool = setting(
        False,
        'picture of the only tray of `trays` with its rim and what lies around it, from straight '
        'above its middle; needs fisheye 0, leaves glare out',
    )
    camera_height: float = setting(
        0.0,
        'close_up: distance of the camera from the floor; beads that are higher look larger and '
        'further out, walls show their inner sides; 0: infinitely far away',
        'm',
        low=0.0,
        high=10.0,
    )
    lamp_azimuth: float = setting(
        _LAMP_AZIMUTH,
        'direction of the lamp in the picture, from the columns towards the rows',
        'rad',
        low=-3.2,
        high=3.2,
    )
    lamp_elevation: float = setting(
        _LAMP_ELEVATION, 'angle of the lamp above the plate', 'rad', low=0.2, high=1.57
    )
    floor_shade: float = setting(1.0, 'brightness of the floors of the trays', low=0.1, high=1.6)
    plate_shade: float = setting(1.0, 'brightness of the top of the plate', low=0.1, high=1.8)
    floor_texture: float = setting(
        0.0,
        'standard deviation of an additional pattern on floors and plate, as a fraction of their '
        'brightness',
        low=0.0,
        high=0.5,
    )
    floor_texture_length: float = setting(
        0.001, 'correlation length of that pattern', 'm', low=1e-5, high=0.1
    )
    rim_width: float = setting(
        0.0,
        'width of a rim around each tray; 0: the chamfer of the flown plate',
        'm',
        low=0.0,
        high=0.003,
    )
    rim_shade: float = setting(
        0.6, 'brightness of the rim relative to the plate', low=0.0, high=2.0
    )
    exposure: float = setting(
        0.0,
        'part of the time between two frames during which the shutter is open, centred on the '
        'time stamp; 0: no motion blur',
        low=0.0,
        high=1.0,
    )
    bayer: str = setting(
        'none',
        'colour filters on the sensor, the first two rows of two pixels; their colours are '
        'interpolated. none: every pixel sees all colours',
        choices=('none', 'rggb', 'grbg', 'gbrg', 'bggr'),
    )
    camera_jitter_px: float = setting(
        0.0,
        'standard deviation of the place of the whole picture in each frame, along columns and '
        'along rows',
        'px',
        low=0.0,
        high=10.0,
    )
    camera_sway_px: float = setting(
        0.0, 'amplitude of a slow oscillation of the whole picture', 'px', low=0.0, high=10.0
    )
    camera_sway_frequency: float = setting(
        0.7, 'frequency of that oscillation', '1/s', low=0.01, high=10.0
    )
    camera_sway_direction: float = setting(
        0.4,
        'direction of that oscillation in the picture, from the columns',
        'rad',
        low=-3.2,
        high=3.2,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CompressionSettings:
    """Compression of the frames of a simulated film."""

    codec: str = setting(
        'jpeg',
        'jpeg: single frames at the given quality; jpeg_rate: single frames at the given `rate`; '
        'h264: a stream of that rate, decoded again; h264_crf: a stream of the quality `crf`, '
        'with key frames and B frames as x264 sets them (both need PyAV)',
        choices=('jpeg', 'jpeg_rate', 'h264', 'h264_crf'),
    )
    crf: float = setting(
        20.0,
        'h264_crf, and videos in .mp4: constant rate factor of x264; the larger, the coarser',
        low=0.0,
        high=51.0,
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
