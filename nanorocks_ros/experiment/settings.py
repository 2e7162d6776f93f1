"""Every number a user may change: one frozen dataclass per stage, one field per number.

A field yields the ROS parameter with its range, the command-line flag and the row in the
documentation. Nothing else holds a default.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

Scalar = bool | int | float | str
Value = Scalar | tuple[int, ...] | tuple[float, ...]
SettingsType = TypeVar('SettingsType')


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """What a setting may be: a closed range, or a list of names."""

    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    whole: bool = False


def _setting(default: Value, doc: str, unit: str = '', **bounds: Any) -> Any:
    return field(default=default, metadata={'doc': doc, 'unit': unit, 'bounds': Bounds(**bounds)})


@dataclass(frozen=True, slots=True, kw_only=True)
class PreprocessSettings:
    """From the camera's frame to the gray crop of each tray."""

    regions_px: tuple[int, ...] = _setting(
        (),
        'x, y, width, height of each tray in the rectified frame, in the order of `trays`; '
        'empty: as `layout` says',
        'px',
        low=0,
        whole=True,
    )
    layout: str = _setting(
        'centred',
        'where the trays are: one alone, centred, or all as they lie on the plate, centred',
        choices=('centred', 'plate'),
    )
    calibration: str = _setting(
        '',
        'calibration file: lens, regions and scale in one, in place of `regions_px`, `layout`, '
        '`pixels_per_metre` and camera_info; empty: none',
    )
    pixels_per_metre: float = _setting(
        13500.0, 'scale of the picture', 'px/m', low=100.0, high=1e6
    )
    gray_mix: tuple[float, ...] = _setting(
        (0.45, 0.45, 0.10), 'weights of blue, green and red in the gray mix', low=0.0, high=1.0
    )
    stabilise: bool = _setting(True, 'follow the motion of each tray, and take it out')
    wall_width: float = _setting(
        0.002,
        'width of the wall around a tray by which its motion is followed',
        'm',
        low=0.0001,
        high=0.01,
    )
    check_map: bool = _setting(
        True,
        'look whether the trays are where they should be; where they are plainly somewhere else '
        'neither restitution nor cluster size is given',
    )
    shake_speed: float = _setting(
        0.001,
        'a plate that starts to move faster than this is being shaken',
        'm/s',
        low=0.0001,
        high=10.0,
    )
    late_tolerance: float = _setting(
        1.0,
        'a frame late by less is dropped, by more means a loop or a seek and resets the stages',
        's',
        low=0.0,
        high=60.0,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedSettings:
    """From gray crops to the mean projected speed."""

    method: str = _setting(
        'auto',
        'how the speed is measured; auto: by tracking where nearly all beads can be followed, by '
        'the structure function elsewhere',
        choices=('auto', 'tracking', 'structure_function', 'binarised_area'),
    )
    interval: float = _setting(0.1, 'time between two estimates', 's', low=0.0, high=10.0)
    longest_lag_frames: int = _setting(
        48, 'longest lag of the structure function', 'frames', low=1, high=300
    )
    saturation: float = _setting(
        0.15,
        'largest structure function used, as a fraction of its plateau',
        low=0.05,
        high=0.6,
    )
    geometry: str = _setting(
        'exact',
        'binarised_area: moving area of a disc, exact or its Taylor form',
        choices=('exact', 'taylor'),
    )
    averaging: str = _setting(
        'running_mean',
        'binarised_area: which frames are averaged before the difference',
        choices=('none', 'running_mean', 'block_mean'),
    )
    averaged_frames: int = _setting(
        10, 'binarised_area: frames averaged', 'frames', low=1, high=100
    )
    time_step: str = _setting(
        'compared',
        'binarised_area: time between the pictures compared, or one frame as printed',
        choices=('compared', 'one_frame'),
    )
    threshold: float = _setting(
        5.0, 'binarised_area: threshold in units of the noise', low=0.5, high=50.0
    )
    area_factor: float = _setting(
        1.0,
        'binarised_area: factor that manual tracks call for (`nanorocks calibrate-area`)',
        low=1e-3,
        high=1e3,
    )
    area_offset: float = _setting(
        0.0,
        'binarised_area: what manual tracks call for to be added to that',
        'm/s',
        low=-0.1,
        high=0.1,
    )
    shake_ratio: float = _setting(
        2.0,
        'a shaking event is a jump of the motion between two frames by this factor',
        low=1.1,
        high=100.0,
    )
    shortest_cycle: float = _setting(
        5.0, 'two shaking events are at least this far apart', 's', low=0.0, high=3600.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingSettings:
    """From colour crops to the beads and their tracks."""

    least_area_seen: float = _setting(
        0.3, 'share of its disc that a bead must show to be found', low=0.05, high=1.0
    )
    most_crowded: float = _setting(
        0.6,
        'a gray species whose grains, side by side, would cover more of the tray is not followed',
        low=0.0,
        high=10.0,
    )
    longest_gap: float = _setting(
        1.0, 'a bead that is hidden for longer gets a new number', 's', low=0.0, high=60.0
    )
    fastest: float = _setting(0.05, 'no bead is faster in the picture', 'm/s', low=1e-4, high=10.0)
    window: float = _setting(
        1.0, 'longest flight from which a velocity is measured', 's', low=0.05, high=10.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterSettings:
    """From gray crops to the width of their autocorrelation."""

    interval: float = _setting(0.2, 'time between two autocorrelations', 's', low=0.0, high=60.0)
    level: float = _setting(
        0.5, 'level of the autocorrelation whose area is measured', low=0.05, high=0.95
    )
    curve: str = _setting(
        '',
        'file that tells cluster sizes from level areas, made by `nanorocks cluster-curve`; '
        'empty: the one for the tray that comes with the package',
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BodySettings:
    """From tracks to the beads that stick together."""

    interval: float = _setting(0.2, 'time between two counts of bodies', 's', low=0.0, high=60.0)
    delay: float = _setting(
        1.0,
        'bodies are counted so long afterwards: whether beads stick takes a while to see',
        's',
        low=0.0,
        high=60.0,
    )
    false_alarms: float = _setting(
        0.01,
        'share of cycles without sticking in which beads are taken to stick together',
        low=1e-6,
        high=0.5,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StickingSettings:
    """From merges to the speed below which beads stick."""

    measure: str = _setting(
        'normal',
        'which relative speed of two beads decides whether they stick: along the line of centres, '
        'or all of it',
        choices=('normal', 'total'),
    )
    rate_error: float = _setting(
        0.1, 'relative standard error of the rates at which bodies meet', low=0.0, high=1.0
    )
    probability: float = _setting(0.95, 'probability of the interval', low=0.5, high=0.999)


@dataclass(frozen=True, slots=True, kw_only=True)
class CoolingSettings:
    """From speeds to the coefficient of restitution."""

    relation: str = _setting(
        'library',
        'what turns a decay into a restitution: simulated decays of the tray, or the closed form '
        'of the paper, which is wrong and kept for comparison',
        choices=('library', 'paper'),
    )
    decay_library: str = _setting(
        '',
        'file of simulated decays, made by `nanorocks library`; empty: the one for the tray that '
        'comes with the package',
    )
    delay: float = _setting(
        1.75, 'time from the shaking event to the first speed used', 's', low=0.0, high=600.0
    )
    duration: float = _setting(
        20.0,
        'time to the last speed used, from the shaking event or from when the tray came to rest',
        's',
        low=0.5,
        high=3600.0,
    )
    calm_share: float = _setting(
        0.05,
        'the first speed used is the one from which on the tray, on its springs, is slower than '
        'this share of the beads',
        low=0.0,
        high=10.0,
    )
    until_merge: bool = _setting(
        True,
        'end with the first merge of the cycle: beads that stick take more energy than those that '
        'bounce',
    )
    rebounds: bool = _setting(
        True, 'use rebounds from the side walls, seen in the tracks, besides the decay'
    )
    collisions: bool = _setting(
        True, 'use collisions of two beads, seen in the tracks, besides the decay'
    )
    update_interval: float = _setting(
        0.5, 'time between two live estimates', 's', low=0.0, high=60.0
    )
    fewest_samples: int = _setting(8, 'speeds needed for a fit', low=4, high=10000)
    probability: float = _setting(0.95, 'probability of the interval', low=0.5, high=0.999)


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorSettings:
    """From decays to the restitutions of beads and walls: what is known beforehand."""

    wall_low: float = _setting(
        0.8,
        'lowest restitution that the walls may have, before anything is measured',
        low=0.78,
        high=1.0,
    )
    wall_high: float = _setting(
        1.0, 'highest; equal to the lowest where it is known', low=0.78, high=1.0
    )
    floor_lid_spread: float = _setting(
        0.4,
        'standard deviation of the logarithm of 1 - restitution of floor and lid over that of the '
        'side walls; 0: alike',
        low=0.0,
        high=1.0,
    )
    height_error: float = _setting(
        0.1e-3, 'standard error of the inner height of a tray', 'm', low=0.0, high=1e-3
    )
    diameter_error: float = _setting(
        0.01, 'relative standard error of the diameter of the beads', low=0.0, high=0.1
    )
    count_error: float = _setting(
        0.3, 'standard error of the number of beads, where they were counted', low=0.0, high=100.0
    )
    anisotropy_spread: float = _setting(
        0.5,
        'standard deviation of the logarithm of vertical over horizontal speeds after a shaking '
        'event',
        low=0.0,
        high=2.0,
    )
    start_spread: float = _setting(
        1.0,
        'how far speeds after a shaking event may be from between even (1) and Maxwellian (-1)',
        low=0.0,
        high=2.0,
    )
    scale_error: float = _setting(
        0.005, 'relative standard error of the scale of the picture', low=0.0, high=0.1
    )
    speed_bias: float = _setting(
        0.01,
        'standard deviation of a relative error of the speeds for each factor e in speed',
        low=0.0,
        high=0.2,
    )
    grain_scale_error: float = _setting(
        0.3,
        'relative standard error of speeds by the structure function in trays with grains, whose '
        'outlines change as they turn',
        low=0.0,
        high=1.0,
    )
    grain_speed_bias: float = _setting(
        0.1,
        'standard deviation of a relative error of such speeds for each factor e in speed',
        low=0.0,
        high=0.5,
    )
    collision_bias: float = _setting(
        0.008,
        'standard deviation of what the restitution of the beads by all collisions together may '
        'be off by',
        low=0.0,
        high=0.2,
    )
    rebound_bias: float = _setting(
        0.001, 'the same of that of the walls by rebounds', low=0.0, high=0.2
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PipelineSettings:
    """The settings of the whole data path."""

    trays: tuple[int, ...] = _setting((1,), 'trays to analyse', low=1, high=8, whole=True)
    trays_file: str = _setting('', 'YAML file of trays; empty: the trays that were flown')
    preprocess: PreprocessSettings = field(default_factory=PreprocessSettings)
    speed: SpeedSettings = field(default_factory=SpeedSettings)
    tracking: TrackingSettings = field(default_factory=TrackingSettings)
    clusters: ClusterSettings = field(default_factory=ClusterSettings)
    bodies: BodySettings = field(default_factory=BodySettings)
    sticking: StickingSettings = field(default_factory=StickingSettings)
    cooling: CoolingSettings = field(default_factory=CoolingSettings)
    prior: PriorSettings = field(default_factory=PriorSettings)


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationSettings:
    """A simulated tray and the camera over it."""

    tray: int = _setting(1, 'tray to simulate', low=1, high=8)
    seed: int = _setting(1, 'seed of everything random', low=0, high=2**31 - 1)
    restitution: float = _setting(
        0.89, 'coefficient of restitution between beads', low=0.0, high=1.0
    )
    restitution_width: float = _setting(
        0.0,
        'full width of the even distribution that the restitution of each collision is drawn from',
        low=0.0,
        high=1.0,
    )
    wall_restitution: float = _setting(
        0.99, 'coefficient of restitution at the walls', low=0.0, high=1.0
    )
    floor_lid_difference: float = _setting(
        0.0,
        'restitution of floor and lid less that of the side walls; both stay within 0 and 1',
        low=-1.0,
        high=1.0,
    )
    sticking_speed: float = _setting(
        0.0, 'beads that meet more slowly stick together', 'm/s', low=0.0, high=1.0
    )
    wall_sticking_speed: float = _setting(
        0.0, 'beads that meet a wall more slowly stay there', 'm/s', low=0.0, high=1.0
    )
    sticking_measure: str = _setting(
        'normal',
        'speed compared with the sticking speed: along the normal of the contact, or all of it',
        choices=('normal', 'total'),
    )
    tangential_restitution: float = _setting(
        -1.0,
        'tangential restitution between beads; -1: smooth, 1: perfectly rough',
        low=-1.0,
        high=1.0,
    )
    wall_tangential_restitution: float = _setting(
        -1.0, 'tangential restitution at the walls; -1: smooth', low=-1.0, high=1.0
    )
    friction: float = _setting(
        1e6,
        'coefficient of friction of rough beads, above which contacts slide; large: none slides',
        low=0.0,
        high=1e6,
    )
    wall_friction: float = _setting(1e6, 'the same of rough beads at the walls', low=0.0, high=1e6)
    speeds: str = _setting(
        'uniform',
        'speeds after a shaking event: even in [0, 2 mean], Maxwellian, or those of a tray whose '
        'walls were really shaken, scaled to the mean',
        choices=('uniform', 'maxwellian', 'shaken'),
    )
    vertical_speed_factor: float = _setting(
        1.0,
        'by how much velocities across the tray, towards the camera, are larger after a shaking '
        'event than `speeds` says',
        low=0.0,
        high=100.0,
    )
    shake_frequency: float = _setting(
        5.0, 'speeds=shaken: frequency of the walls', '1/s', low=0.1, high=1000.0
    )
    shake_periods: int = _setting(20, 'speeds=shaken: periods of the walls', low=1, high=10000)
    mean_speed: float = _setting(
        0.007, 'mean 3-D speed after a shaking event', 'm/s', low=0.0, high=1.0
    )
    first_shake: float = _setting(
        1.0, 'time of the first shaking event; the beads rest before it', 's', low=0.0, high=3600.0
    )
    shake_period: float = _setting(60.0, 'time between shaking events', 's', low=0.1, high=3600.0)
    frame_rate: float = _setting(30.0, 'frames per second', '1/s', low=0.1, high=1000.0)
    width_px: int = _setting(1920, 'width of the picture', 'px', low=16, high=8192)
    height_px: int = _setting(1080, 'height of the picture', 'px', low=16, high=8192)
    pixels_per_metre: float = _setting(
        13500.0, 'scale of the picture', 'px/m', low=100.0, high=1e6
    )
    noise: float = _setting(
        2.0, 'standard deviation of the sensor noise', 'gray levels', low=0.0, high=64.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneSettings:
    """The whole plate under the camera, and what camera and light do; a strength of 0 is off."""

    trays: tuple[int, ...] = _setting(
        (1, 2, 3, 4, 5, 6, 7, 8), 'trays with beads in them', low=1, high=8, whole=True
    )
    pixels_per_metre: float = _setting(
        12500.0, 'scale in the middle of the lens', 'px/m', low=1000.0, high=1e5
    )
    fisheye: float = _setting(
        0.6,
        'angle from the axis at which the lens sees the middle of the left edge of the rectified '
        'picture; 0: a straight lens',
        'rad',
        low=0.0,
        high=1.2,
    )
    lens_distortion: tuple[float, ...] = _setting(
        (-0.02, 0.004, 0.0, 0.0), 'k1 to k4 of the fisheye lens', low=-1.0, high=1.0
    )
    lens_offset_px: tuple[float, ...] = _setting(
        (9.0, -6.0), 'column and row of the axis, from the middle', 'px', low=-500.0, high=500.0
    )
    defocus_px: float = _setting(
        0.7, 'standard deviation of the blur of the lens', 'px', low=0.0, high=10.0
    )
    noise: float = _setting(
        2.0, 'standard deviation of the sensor noise', 'gray levels', low=0.0, high=64.0
    )
    vignetting: float = _setting(
        0.25, 'light lost from the middle of the picture to its left edge', low=0.0, high=0.9
    )
    gradient: float = _setting(
        0.12,
        'light gained from edge to edge, along columns and half of it along rows',
        low=0.0,
        high=1.0,
    )
    flicker: float = _setting(
        0.015, 'amplitude of the bands of light that roll over the picture', low=0.0, high=0.5
    )
    flicker_period: float = _setting(
        4.1, 'time in which a band comes round', 's', low=0.01, high=1000.0
    )
    shading: float = _setting(
        1.0, 'shading of the beads; 0: discs of one even colour', low=0.0, high=1.0
    )
    highlights: float = _setting(1.0, 'mirror images of the lamp on the beads', low=0.0, high=2.0)
    shadows: float = _setting(0.25, 'light that the beads keep from the floor', low=0.0, high=1.0)
    chalk: float = _setting(
        1.0, 'dust on beads, floor and walls of the trays that have chalk', low=0.0, high=2.0
    )
    glare: float = _setting(
        1.0, 'reflections of the LEDs in the window over trays 2 and 4', low=0.0, high=5.0
    )
    ovality: float = _setting(
        0.12,
        'copper beads: spread of the axis ratio from 1, drawn for each; areas stay',
        low=0.0,
        high=0.4,
    )
    irregularity: float = _setting(
        0.12, 'JSC-1 grains: spread of the outline; areas stay', low=0.0, high=0.3
    )
    turning: float = _setting(
        1.0,
        'spread of the angular speeds of beads and grains about the line of sight, after shaking',
        'rad/s',
        low=0.0,
        high=100.0,
    )
    swing: float = _setting(
        0.0002, 'first amplitude of the plate on its springs', 'm', low=0.0, high=0.002
    )
    swing_frequency: float = _setting(1.5, 'of the swing', '1/s', low=0.1, high=15.0)
    swing_damping: float = _setting(
        0.16, 'decay of its amplitude; 0.16: to 2 % in 25 s', '1/s', low=0.0, high=10.0
    )
    swing_direction: float = _setting(
        0.6, 'angle from the columns to its direction in the picture', 'rad', low=-3.2, high=3.2
    )
    swing_knocks: bool = _setting(
        True, 'whether the swinging walls pass on their motion to beads that hit them'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CompressionSettings:
    """How the pictures of a simulated film are compressed."""

    codec: str = _setting(
        'jpeg',
        'jpeg: every picture by itself, as the quality makes it; jpeg_rate: so that the film has '
        'the size asked for; h264: as a stream of that size, decoded again (needs PyAV)',
        choices=('jpeg', 'jpeg_rate', 'h264'),
    )
    rate: float = _setting(
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

    whole_scene: bool = _setting(
        False, 'film the whole plate with the trays of `scene.trays`, not one tray alone'
    )
    effects: str = _setting(
        'all',
        'of the scene: all as strong as set, or none at all',
        choices=('all', 'none'),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSettings:
    """Which camera topic a node listens to."""

    transport: str = _setting(
        'raw',
        'raw: camera/image_raw, compressed: camera/image_raw/compressed',
        choices=('raw', 'compressed'),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PacingSettings:
    """How fast and how long frames are given out."""

    rate: float = _setting(
        1.0,
        'seconds of recording per second; 0: as fast as the nodes of the graph keep up',
        low=0.0,
        high=1000.0,
    )
    duration: float = _setting(
        0.0, 'give out so much of the recording; 0: all that there is', 's', low=0.0, high=1e6
    )
    listeners: int = _setting(
        0,
        'nodes that take the camera, or the tray images made of it, to wait for before the first '
        'frame',
        low=0,
        high=100,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BagSettings:
    """Which bag is played, and which part of it."""

    bag: str = _setting('', 'path of the bag to play')
    start: float = _setting(
        0.0, 'begin so long after the first message of the bag', 's', low=0.0, high=1e7
    )
    loop: bool = _setting(False, 'start again at the end of the part that is played')


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayerSettings:
    """What is played of a bag, and where in it the player is."""

    results: bool = _setting(
        True,
        'play what an earlier analysis found, too; false where a graph works it out again',
    )
    paused: bool = _setting(False, 'wait at the start until told to go on')
    position: float = _setting(
        0.0,
        'begin, or when set later jump to, so long after the first message',
        's',
        low=0.0,
        high=1e7,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceSettings:
    """Where the frames of the composed pipeline come from."""

    source: str = _setting(
        'simulator',
        'where the frames come from',
        choices=('simulator', 'bag', 'topic'),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkSettings:
    """How the work of the composed pipeline is shared out."""

    workers: int = _setting(
        -1,
        'processes that follow the trays; 0: none, a thread does; -1: for several trays as many '
        'as there are cores besides one, up to four',
        low=-1,
        high=64,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordSettings:
    """What the composed pipeline records while it works."""

    record: str = _setting(
        '', 'path of a new bag for the camera and all results; empty: nothing is recorded'
    )
    record_quality: int = _setting(
        95, 'JPEG quality of frames that do not come compressed', low=1, high=100
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardSettings:
    """Where and how the live page is served."""

    host: str = _setting(
        '127.0.0.1',
        'address to listen on; one that other machines can reach is served with a token only',
    )
    port: int = _setting(8321, 'port to listen on; 0: any that is free', low=0, high=65535)
    token: str = _setting(
        '',
        'what a browser must know, 12 characters or more; empty: that of the environment variable '
        'NANOROCKS_DASHBOARD_TOKEN, else none on a loopback address, and elsewhere one that is '
        'made up and printed',
    )
    picture_rate: float = _setting(
        8.0, 'pictures of a tray a browser gets at most', '1/s', low=0.1, high=30.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardGraphSettings:
    """What the live page has to know of the graph that it shows."""

    trays_file: str = _setting('', 'YAML file of trays; empty: the trays that were flown')
    parent: int = _setting(
        0,
        'number of the process that started it, and that it ends with; 0: none',
        low=0,
        high=2**31 - 1,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LivePageSettings:
    """Whether the pipeline serves the live page."""

    dashboard: bool = _setting(False, 'serve the live page, from a process of its own')


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingRow:
    """One setting, as the documentation, the ROS parameter and the flag need it."""

    name: str
    default: Value
    doc: str
    unit: str
    bounds: Bounds


def rows(settings: Any, prefix: str = '') -> Iterator[SettingRow]:
    """Every setting under a dataclass of settings, nested ones with dotted names."""
    for item in fields(settings):
        value = getattr(settings, item.name)
        if is_dataclass(value):
            yield from rows(value, f'{prefix}{item.name}.')
        else:
            yield SettingRow(
                name=prefix + item.name,
                default=value,
                doc=item.metadata['doc'],
                unit=item.metadata['unit'],
                bounds=item.metadata['bounds'],
            )


def _number_problem(value: float, bounds: Bounds) -> str | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return f'{value!r} is not a number'
    if not math.isfinite(value):
        return f'{value!r} is not finite'
    if bounds.whole and not float(value).is_integer():
        return f'{value!r} is not a whole number'
    if not bounds.low <= value <= bounds.high:
        return f'{value!r} is outside [{bounds.low:g}, {bounds.high:g}]'
    return None


def problem(row: SettingRow, value: Any) -> str | None:
    """Why a value cannot be this setting, or None when it can."""
    if isinstance(row.default, bool):
        return None if isinstance(value, bool) else f'{value!r} is neither true nor false'
    if isinstance(row.default, str):
        choices = row.bounds.choices
        if not isinstance(value, str):
            return f'{value!r} is not a text'
        if choices and value not in choices:
            return f'{value!r} is none of {", ".join(choices)}'
        return None
    if isinstance(row.default, tuple):
        if isinstance(value, str):
            return f'{value!r} is not a list of numbers'
        found = (_number_problem(item, row.bounds) for item in _listed(value))
        return next((text for text in found if text), None)
    if isinstance(row.default, int) and isinstance(value, float) and not value.is_integer():
        return f'{value!r} is not a whole number'
    return _number_problem(value, row.bounds)


def _listed(value: Any) -> list[Any]:
    """A list as it is; a single number does for a list of one."""
    return list(value) if hasattr(value, '__iter__') else [value]


def _coerced(row: SettingRow, value: Any) -> Value:
    if isinstance(row.default, tuple):
        return tuple(int(item) if row.bounds.whole else float(item) for item in _listed(value))
    kind = type(row.default)
    return kind(value)


def with_values(settings: SettingsType, values: Mapping[str, Any], where: str) -> SettingsType:
    """The settings with some values replaced, all of them checked.

    Parameters
    ----------
    settings : dataclass of settings
    values : mapping
        Dotted setting name to new value.
    where : str
        What to name in the error: a file, a node, the command line.

    Raises
    ------
    ConfigurationError
        For an unknown name or a value outside its range; every problem is listed.
    """
    known = {row.name: row for row in rows(settings)}
    problems = [f'no setting {name!r}' for name in values if name not in known]
    for name, value in values.items():
        text = problem(known[name], value) if name in known else None
        if text:
            problems.append(f'{name}: {text}')
    if problems:
        raise ConfigurationError(
            where, '; '.join(problems), 'see docs/reference/parameters.md for names and ranges'
        )
    changed: SettingsType = _replaced(
        settings, {name: _coerced(known[name], value) for name, value in values.items()}
    )
    return changed


def _replaced(settings: Any, values: Mapping[str, Value]) -> Any:
    own = {name: value for name, value in values.items() if '.' not in name}
    for group in {name.split('.', 1)[0] for name in values if '.' in name}:
        inner = {
            name.split('.', 1)[1]: value
            for name, value in values.items()
            if name.startswith(f'{group}.')
        }
        own[group] = _replaced(getattr(settings, group), inner)
    return replace(settings, **own)
