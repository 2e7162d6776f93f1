"""Settings of the stages, from the camera frame to the restitution.

Tested by ``test/settings/test_setting_fields.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from nanorocks_ros.settings.restitution_settings import (
    CoolingSettings,
    PriorSettings,
    StickingSettings,
)
from nanorocks_ros.settings.setting_fields import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class PreprocessSettings:
    """From the camera frame to the gray crop of each tray."""

    regions_px: tuple[int, ...] = setting(
        (),
        'x, y, width, height of each tray in the rectified frame, in the order of `trays`; '
        'empty: from `layout`',
        'px',
        low=0,
        whole=True,
    )
    layout: str = setting(
        'centred',
        'position of the trays in the frame: a single tray in the centre, or the plate with all '
        'trays in the centre',
        choices=('centred', 'plate'),
    )
    calibration: str = setting(
        '',
        'calibration file with lens, regions and scale; it replaces `regions_px`, `layout`, '
        '`pixels_per_metre` and camera_info; empty: none',
        everyday=True,
        placeholder='YAML',
    )
    pixels_per_metre: float = setting(
        13500.0, 'image scale', 'px/m', everyday=True, low=1.0, high=1e9
    )
    gray_mix: tuple[float, ...] = setting(
        (0.45, 0.45, 0.10), 'weights of blue, green and red in the gray mix', low=0.0, high=1.0
    )
    stabilise: bool = setting(True, 'measure the motion of each tray and remove it')
    wall_width: float = setting(
        0.002,
        'width of the wall around a tray that its motion is measured on',
        'm',
        low=0.0001,
        high=0.01,
    )
    check_tray_positions: bool = setting(
        True,
        'compare the tray positions in the image with the regions; a tray that is displaced '
        'gives neither restitution nor cluster size',
        deprecated='check_map',
    )
    shake_speed: float = setting(
        0.001,
        'plate speed above which a shaking event starts',
        'm/s',
        low=0.0001,
        high=10.0,
    )
    late_tolerance: float = setting(
        1.0,
        'frames late by less than this are dropped; a larger step back counts as a loop or seek '
        'and resets all stages',
        's',
        low=0.0,
        high=60.0,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedSettings:
    """From gray crops to the mean projected speed."""

    method: str = setting(
        'auto',
        'method of the speed measurement; auto: tracking if nearly all beads have tracks, else '
        'the structure function',
        choices=('auto', 'tracking', 'structure_function', 'binarised_area'),
    )
    interval: float = setting(0.1, 'time between two estimates', 's', low=0.0, high=10.0)
    max_lag_frames: int = setting(
        48,
        'largest lag of the structure function',
        'frames',
        deprecated='longest_lag_frames',
        low=1,
        high=300,
    )
    saturation: float = setting(
        0.15,
        'largest value of the structure function used, as a fraction of its plateau',
        low=0.05,
        high=0.6,
    )
    crowded_saturation: float = setting(
        0.25,
        'the same in trays with too many grains to track them',
        low=0.05,
        high=0.6,
    )
    geometry: str = setting(
        'exact',
        'binarised_area: moving area of a disc, exact or its Taylor expansion',
        choices=('exact', 'taylor'),
    )
    averaging: str = setting(
        'running_mean',
        'binarised_area: average of frames before the difference',
        choices=('none', 'running_mean', 'block_mean'),
    )
    averaged_frames: int = setting(
        10, 'binarised_area: number of frames in the average', 'frames', low=1, high=100
    )
    time_step: str = setting(
        'compared',
        'binarised_area: time step of the speed: between the frames compared, or one frame as '
        'printed in the paper',
        choices=('compared', 'one_frame'),
    )
    threshold: float = setting(
        5.0,
        'binarised_area: threshold of the difference, in standard deviations of the noise',
        low=0.5,
        high=50.0,
    )
    area_factor: float = setting(
        1.0,
        'binarised_area: factor of the speed, from manual tracks (`nanorocks calibrate-area`)',
        low=1e-3,
        high=1e3,
    )
    area_offset: float = setting(
        0.0,
        'binarised_area: offset added to the speed, from manual tracks',
        'm/s',
        low=-0.1,
        high=0.1,
    )
    shake_ratio: float = setting(
        2.0,
        'factor by which the motion must jump between two frames for a shaking event',
        low=1.1,
        high=100.0,
    )
    min_cycle_duration: float = setting(
        5.0,
        'smallest time between two shaking events',
        's',
        deprecated='shortest_cycle',
        low=0.0,
        high=3600.0,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingSettings:
    """From colour crops to the beads and their tracks."""

    min_visible_fraction: float = setting(
        0.3,
        'smallest visible fraction of the disc of a bead for a detection',
        deprecated='least_area_seen',
        low=0.05,
        high=1.0,
    )
    max_covered_fraction: float = setting(
        0.6,
        'largest fraction of the tray that the grains of a gray species, side by side, may cover; '
        'a species above it is not tracked',
        deprecated='most_crowded',
        low=0.0,
        high=10.0,
    )
    memory: float = setting(
        1.0,
        'longest time without a detection after which a bead keeps its track',
        's',
        deprecated='longest_gap',
        low=0.0,
        high=60.0,
    )
    max_speed: float = setting(
        0.0,
        'largest projected speed a bead may have when linking; 0: 0.05 for beads of the flight, '
        'half of the distance of neighbours between frames for beads that are learnt',
        'm/s',
        deprecated='fastest',
        low=0.0,
        high=100.0,
    )
    window: float = setting(
        1.0, 'longest piece of a track that a velocity is fitted to', 's', low=0.05, high=10.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterSettings:
    """From gray crops to the width of their autocorrelation."""

    interval: float = setting(0.2, 'time between two autocorrelations', 's', low=0.0, high=60.0)
    level: float = setting(
        0.5, 'level of the autocorrelation at which its area is measured', low=0.05, high=0.95
    )
    curve: str = setting(
        '',
        'file with the relation of cluster size to level area, made by `nanorocks '
        'cluster-curve`; empty: the file in the package for the tray',
        placeholder='NPZ',
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BodySettings:
    """From tracks to bodies: beads that stick together."""

    interval: float = setting(0.2, 'time between two counts of bodies', 's', low=0.0, high=60.0)
    delay: float = setting(
        6.0,
        'time after a frame at which its bodies are counted; sticking shows only in later frames',
        's',
        low=0.0,
        high=60.0,
    )
    false_alarm_rate: float = setting(
        0.01,
        'fraction of cycles without sticking in which a body is reported',
        deprecated='false_alarms',
        low=1e-6,
        high=0.5,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PipelineSettings:
    """The settings of the whole data path."""

    trays: tuple[int, ...] = setting(
        (1,), 'trays to analyse', everyday=True, placeholder='K', low=1, high=8, whole=True
    )
    trays_file: str = setting(
        '',
        'YAML file of trays; empty: the trays of the flight',
        everyday=True,
        placeholder='YAML',
    )
    preprocess: PreprocessSettings = field(default_factory=PreprocessSettings)
    speed: SpeedSettings = field(default_factory=SpeedSettings)
    tracking: TrackingSettings = field(default_factory=TrackingSettings)
    clusters: ClusterSettings = field(default_factory=ClusterSettings)
    bodies: BodySettings = field(default_factory=BodySettings)
    sticking: StickingSettings = field(default_factory=StickingSettings)
    cooling: CoolingSettings = field(default_factory=CoolingSettings)
    prior: PriorSettings = field(default_factory=PriorSettings)
