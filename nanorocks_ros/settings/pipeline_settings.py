"""Settings of the stages, from the camera frame to the restitution."""

from __future__ import annotations

from dataclasses import dataclass, field

from nanorocks_ros.settings.setting_fields import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class PreprocessSettings:
    """From the camera's frame to the gray crop of each tray."""

    regions_px: tuple[int, ...] = setting(
        (),
        'x, y, width, height of each tray in the rectified frame, in the order of `trays`; '
        'empty: as `layout` says',
        'px',
        low=0,
        whole=True,
    )
    layout: str = setting(
        'centred',
        'where the trays are: one alone, centred, or all as they lie on the plate, centred',
        choices=('centred', 'plate'),
    )
    calibration: str = setting(
        '',
        'calibration file: lens, regions and scale in one, in place of `regions_px`, `layout`, '
        '`pixels_per_metre` and camera_info; empty: none',
    )
    pixels_per_metre: float = setting(13500.0, 'scale of the picture', 'px/m', low=100.0, high=1e6)
    gray_mix: tuple[float, ...] = setting(
        (0.45, 0.45, 0.10), 'weights of blue, green and red in the gray mix', low=0.0, high=1.0
    )
    stabilise: bool = setting(True, 'follow the motion of each tray, and take it out')
    wall_width: float = setting(
        0.002,
        'width of the wall around a tray by which its motion is followed',
        'm',
        low=0.0001,
        high=0.01,
    )
    check_map: bool = setting(
        True,
        'look whether the trays are where they should be; where they are plainly somewhere else '
        'neither restitution nor cluster size is given',
    )
    shake_speed: float = setting(
        0.001,
        'a plate that starts to move faster than this is being shaken',
        'm/s',
        low=0.0001,
        high=10.0,
    )
    late_tolerance: float = setting(
        1.0,
        'a frame late by less is dropped, by more means a loop or a seek and resets the stages',
        's',
        low=0.0,
        high=60.0,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedSettings:
    """From gray crops to the mean projected speed."""

    method: str = setting(
        'auto',
        'how the speed is measured; auto: by tracking where nearly all beads can be followed, by '
        'the structure function elsewhere',
        choices=('auto', 'tracking', 'structure_function', 'binarised_area'),
    )
    interval: float = setting(0.1, 'time between two estimates', 's', low=0.0, high=10.0)
    longest_lag_frames: int = setting(
        48, 'longest lag of the structure function', 'frames', low=1, high=300
    )
    saturation: float = setting(
        0.15,
        'largest structure function used, as a fraction of its plateau',
        low=0.05,
        high=0.6,
    )
    geometry: str = setting(
        'exact',
        'binarised_area: moving area of a disc, exact or its Taylor form',
        choices=('exact', 'taylor'),
    )
    averaging: str = setting(
        'running_mean',
        'binarised_area: which frames are averaged before the difference',
        choices=('none', 'running_mean', 'block_mean'),
    )
    averaged_frames: int = setting(
        10, 'binarised_area: frames averaged', 'frames', low=1, high=100
    )
    time_step: str = setting(
        'compared',
        'binarised_area: time between the pictures compared, or one frame as printed',
        choices=('compared', 'one_frame'),
    )
    threshold: float = setting(
        5.0, 'binarised_area: threshold in units of the noise', low=0.5, high=50.0
    )
    area_factor: float = setting(
        1.0,
        'binarised_area: factor that manual tracks call for (`nanorocks calibrate-area`)',
        low=1e-3,
        high=1e3,
    )
    area_offset: float = setting(
        0.0,
        'binarised_area: what manual tracks call for to be added to that',
        'm/s',
        low=-0.1,
        high=0.1,
    )
    shake_ratio: float = setting(
        2.0,
        'a shaking event is a jump of the motion between two frames by this factor',
        low=1.1,
        high=100.0,
    )
    shortest_cycle: float = setting(
        5.0, 'two shaking events are at least this far apart', 's', low=0.0, high=3600.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingSettings:
    """From colour crops to the beads and their tracks."""

    least_area_seen: float = setting(
        0.3, 'share of its disc that a bead must show to be found', low=0.05, high=1.0
    )
    most_crowded: float = setting(
        0.6,
        'a gray species whose grains, side by side, would cover more of the tray is not followed',
        low=0.0,
        high=10.0,
    )
    longest_gap: float = setting(
        1.0, 'a bead that is hidden for longer gets a new number', 's', low=0.0, high=60.0
    )
    fastest: float = setting(0.05, 'no bead is faster in the picture', 'm/s', low=1e-4, high=10.0)
    window: float = setting(
        1.0, 'longest flight from which a velocity is measured', 's', low=0.05, high=10.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterSettings:
    """From gray crops to the width of their autocorrelation."""

    interval: float = setting(0.2, 'time between two autocorrelations', 's', low=0.0, high=60.0)
    level: float = setting(
        0.5, 'level of the autocorrelation whose area is measured', low=0.05, high=0.95
    )
    curve: str = setting(
        '',
        'file that tells cluster sizes from level areas, made by `nanorocks cluster-curve`; '
        'empty: the one for the tray that comes with the package',
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BodySettings:
    """From tracks to the beads that stick together."""

    interval: float = setting(0.2, 'time between two counts of bodies', 's', low=0.0, high=60.0)
    delay: float = setting(
        1.0,
        'bodies are counted so long afterwards: whether beads stick takes a while to see',
        's',
        low=0.0,
        high=60.0,
    )
    false_alarms: float = setting(
        0.01,
        'share of cycles without sticking in which beads are taken to stick together',
        low=1e-6,
        high=0.5,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StickingSettings:
    """From merges to the speed below which beads stick."""

    measure: str = setting(
        'normal',
        'which relative speed of two beads decides whether they stick: along the line of centres, '
        'or all of it',
        choices=('normal', 'total'),
    )
    rate_error: float = setting(
        0.1, 'relative standard error of the rates at which bodies meet', low=0.0, high=1.0
    )
    probability: float = setting(0.95, 'probability of the interval', low=0.5, high=0.999)


@dataclass(frozen=True, slots=True, kw_only=True)
class CoolingSettings:
    """From speeds to the coefficient of restitution."""

    relation: str = setting(
        'library',
        'what turns a decay into a restitution: simulated decays of the tray, or the closed form '
        'of the paper, which is wrong and kept for comparison',
        choices=('library', 'paper'),
    )
    decay_library: str = setting(
        '',
        'file of simulated decays, made by `nanorocks library`; empty: the one for the tray that '
        'comes with the package',
    )
    delay: float = setting(
        1.75, 'time from the shaking event to the first speed used', 's', low=0.0, high=600.0
    )
    duration: float = setting(
        20.0,
        'time to the last speed used, from the shaking event or from when the tray came to rest',
        's',
        low=0.5,
        high=3600.0,
    )
    calm_share: float = setting(
        0.05,
        'the first speed used is the one from which on the tray, on its springs, is slower than '
        'this share of the beads',
        low=0.0,
        high=10.0,
    )
    until_merge: bool = setting(
        True,
        'end with the first merge of the cycle: beads that stick take more energy than those that '
        'bounce',
    )
    rebounds: bool = setting(
        True, 'use rebounds from the side walls, seen in the tracks, besides the decay'
    )
    collisions: bool = setting(
        True, 'use collisions of two beads, seen in the tracks, besides the decay'
    )
    update_interval: float = setting(
        0.5, 'time between two live estimates', 's', low=0.0, high=60.0
    )
    fewest_samples: int = setting(8, 'speeds needed for a fit', low=4, high=10000)
    probability: float = setting(0.95, 'probability of the interval', low=0.5, high=0.999)


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorSettings:
    """From decays to the restitutions of beads and walls: what is known beforehand."""

    wall_low: float = setting(
        0.8,
        'lowest restitution that the walls may have, before anything is measured',
        low=0.78,
        high=1.0,
    )
    wall_high: float = setting(
        1.0, 'highest; equal to the lowest where it is known', low=0.78, high=1.0
    )
    floor_lid_spread: float = setting(
        0.4,
        'standard deviation of the logarithm of 1 - restitution of floor and lid over that of the '
        'side walls; 0: alike',
        low=0.0,
        high=1.0,
    )
    height_error: float = setting(
        0.1e-3, 'standard error of the inner height of a tray', 'm', low=0.0, high=1e-3
    )
    diameter_error: float = setting(
        0.01, 'relative standard error of the diameter of the beads', low=0.0, high=0.1
    )
    count_error: float = setting(
        0.3, 'standard error of the number of beads, where they were counted', low=0.0, high=100.0
    )
    anisotropy_spread: float = setting(
        0.5,
        'standard deviation of the logarithm of vertical over horizontal speeds after a shaking '
        'event',
        low=0.0,
        high=2.0,
    )
    start_spread: float = setting(
        1.0,
        'how far speeds after a shaking event may be from between even (1) and Maxwellian (-1)',
        low=0.0,
        high=2.0,
    )
    scale_error: float = setting(
        0.005, 'relative standard error of the scale of the picture', low=0.0, high=0.1
    )
    speed_bias: float = setting(
        0.01,
        'standard deviation of a relative error of the speeds for each factor e in speed',
        low=0.0,
        high=0.2,
    )
    grain_scale_error: float = setting(
        0.3,
        'relative standard error of speeds by the structure function in trays with grains, whose '
        'outlines change as they turn',
        low=0.0,
        high=1.0,
    )
    grain_speed_bias: float = setting(
        0.1,
        'standard deviation of a relative error of such speeds for each factor e in speed',
        low=0.0,
        high=0.5,
    )
    collision_bias: float = setting(
        0.008,
        'standard deviation of what the restitution of the beads by all collisions together may '
        'be off by',
        low=0.0,
        high=0.2,
    )
    rebound_bias: float = setting(
        0.001, 'the same of that of the walls by rebounds', low=0.0, high=0.2
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PipelineSettings:
    """The settings of the whole data path."""

    trays: tuple[int, ...] = setting((1,), 'trays to analyse', low=1, high=8, whole=True)
    trays_file: str = setting('', 'YAML file of trays; empty: the trays that were flown')
    preprocess: PreprocessSettings = field(default_factory=PreprocessSettings)
    speed: SpeedSettings = field(default_factory=SpeedSettings)
    tracking: TrackingSettings = field(default_factory=TrackingSettings)
    clusters: ClusterSettings = field(default_factory=ClusterSettings)
    bodies: BodySettings = field(default_factory=BodySettings)
    sticking: StickingSettings = field(default_factory=StickingSettings)
    cooling: CoolingSettings = field(default_factory=CoolingSettings)
    prior: PriorSettings = field(default_factory=PriorSettings)
