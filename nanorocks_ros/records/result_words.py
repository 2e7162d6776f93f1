"""What flags and states mean in words, each with a remedy: the one register of such texts.

The terminal, the JSON of `nanorocks analyse`, reports and the live page take their words from
here.

Tested by ``test/studies/analysis/results/test_cycle_words.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.records.cluster_estimates import sizes_disagree
from nanorocks_ros.records.headlines import CONTRADICTED, Headline, reason_for_contacts
from nanorocks_ros.records.quality_flags import (
    CorRelation,
    CorStatus,
    Quality,
    SpeedMethod,
    StickingStatus,
)

if TYPE_CHECKING:
    from nanorocks_ros.records.restitution_estimates import CorEstimate
    from nanorocks_ros.records.values import Interval, Measured, MeasuredInterval

LARGEST_FIT_ERROR = 0.5
"""Relative standard error above which an initial speed or a Haff time means nothing."""


# Part of the distance from the edge of a prior to the upper limit, in which the lower limit is
# at the edge.
_AT_EDGE = 0.04


class Words(NamedTuple):
    """What is the case, and what to do about it."""

    text: str
    remedy: str


class FlagWords(NamedTuple):
    """A flag by its name, what it means, and what to do about it."""

    name: str
    text: str
    remedy: str


LOOK = 'look at the picture with `nanorocks look BAG -o steps.png`'
"""A remedy where a recording is analysed; BAG stands for its name."""
LOOK_LIVE = 'look at the picture of the tray on this page'
"""The same where there is no recording."""

FLAGS = {
    Quality.SATURATED: Words(
        'more than 1 % of the pixels are at full scale', 'reduce the exposure; speeds still hold'
    ),
    Quality.LOW_CONTRAST: Words('dark and bright hardly differ: no beads, or no light', LOOK),
    Quality.FEW_BEADS: Words(
        'the tracks do not show all beads, or are not reliable',
        f'{LOOK}; speeds of the structure function still hold',
    ),
    Quality.GLARE: Words(
        'reflections hide more than 1 % of the tray', 'move the lamp, or trust slow beads less'
    ),
    Quality.STABILISATION_LOST: Words(
        'the motion of the tray could not be measured, or tray and camera move and cannot be told '
        'apart',
        'below a few mm/s the motion is in the speeds; mount the camera firmly, and film the rim '
        'of the tray, too',
    ),
    Quality.GRAY_CAMERA: Words(
        'the pictures have no colour: no tracks, species are not separated', 'film in colour'
    ),
    Quality.FROZEN: Words(
        'the picture did not change for a quarter of a second',
        'check the camera, unless beads rest in a film without noise',
    ),
    Quality.HALF_FRAME: Words(
        'part of a frame was missing', 'the estimate bridges it; check the recording'
    ),
    Quality.WRONG_SCALE: Words(
        'the trays are not where the settings say, or rulers of the scale differ by more than '
        '5 %; a notice says which',
        f'{LOOK}; set --preprocess-pixels-per-metre or --preprocess-regions-px, or calibrate',
    ),
    Quality.UNCERTAIN: Words(
        'speeds may be wrong by more than 20 %, or 10 % for crowded grains',
        'use their errors; film at a higher rate, or closer',
    ),
    Quality.UNCALIBRATED: Words(
        'speeds by the binarised area are not calibrated',
        'run `nanorocks calibrate-area` with manual tracks',
    ),
    Quality.INCONSISTENT: Words(
        'decay, rebounds and collisions contradict each other: something happens that is not '
        'simulated, such as friction, sticking or drag',
        'the restitutions are those of contacts alone; compare decay_restitution and '
        'contact_restitution',
    ),
    Quality.DOUBTFUL_SCALE: Words(
        'rulers of the scale (told, radii, contacts, walls) differ by more than 2 %, or the size '
        'of the tray in the picture changes; a notice says which',
        'correct what the notice names: --preprocess-pixels-per-metre, sizes in the trays file, '
        'or zoom and focus of the camera',
    ),
    Quality.ACCELERATED: Words(
        'all beads are accelerated the same way, which changes their speeds: the tray falls or '
        'turns',
        'the restitutions are those of contacts alone; compare acceleration with the flight log',
    ),
    Quality.SPEED_DEPENDENT: Words(
        CONTRADICTED,
        'the restitutions are those of contacts alone, and lose as much energy in the contacts '
        'that were seen; impact_restitution and wall_impact_restitution are those at impact_speed '
        'and wall_impact_speed, the exponents say how 1 - restitution goes with speed, '
        'contact_restitution is the constant one',
    ),
    Quality.STICKING: Words(
        'beads began to stick in the cycle: the decay counts up to the first merge, contacts of '
        'free beads to the end, and rebounds of bodies where those of free beads are fewer than '
        'ten',
        'nothing needs to be done; onset, body_rebounds and sticking_speed say more',
    ),
    Quality.SKIPPED_FRAMES: Words(
        'all beads move by several steps at once in more than 4 % of the frames: frames are '
        'missing that the time stamps do not show',
        'give the frames the times at which they were taken, or film again without losses',
    ),
    Quality.FRICTION_UNKNOWN: Words(
        'beads count as smooth, since rebounds do not tell whether they rub; if they do, the '
        'restitutions come out too low',
        'measure the friction with spare beads and set --prior-friction and '
        '--prior-friction-error; or film more cycles, or closer, so that more rebounds are seen',
    ),
}
"""Meaning and remedy of each flag."""

NO_SHAKING = Words(
    'no shaking event was seen',
    'film the shaking and the rest before it; if the film shows it, lower --speed-shake-ratio '
    'or --preprocess-shake-speed; contacts alone need none: nanorocks measure FILM',
)
NO_SPEEDS = Words('no speed could be measured', LOOK)
METHODS = {
    SpeedMethod.TRACKING: 'tracking',
    SpeedMethod.STRUCTURE_FUNCTION: 'structure function',
    SpeedMethod.BINARISED_AREA: 'binarised area',
}
RELATIONS = {
    CorRelation.LIBRARY: 'simulated decays',
    CorRelation.PAPER: 'closed form of the paper',
}


def flags_in_words(quality: Quality) -> list[FlagWords]:
    """Each flag that is set, with its meaning and remedy."""
    words = []
    for flag in Quality:
        if flag in quality and flag.name:
            name = flag.name.lower()
            words.append(FlagWords(name, *FLAGS[flag]))
    return words


def size_flag(autocorrelation: MeasuredInterval, tracks: Measured) -> FlagWords | None:
    """A flag where autocorrelation and tracks disagree on the beads of a cluster; None else.

    Parameters
    ----------
    autocorrelation : MeasuredInterval, [beads]
    tracks : Measured, [beads]
        Weight-averaged size of bodies.
    """
    if not sizes_disagree(autocorrelation, tracks):
        return None
    limits = f'{autocorrelation.lower:.1f} to {autocorrelation.upper:.1f}'
    return FlagWords(
        'cluster_size',
        f'the autocorrelation says {limits} beads a cluster, the tracks {tracks.value:.1f}',
        'look at the end of the cycle with `nanorocks look BAG --at SECONDS -o steps.png`: if '
        'beads lie together, the tracks miss that they stick; if not, calibrate the '
        'autocorrelation for this camera with `nanorocks cluster-curve`',
    )


class WallPrior(NamedTuple):
    """Ends of the flat prior of the walls."""

    lowest: float = 0.0
    highest: float = 1.0


def wall_flag(cor: CorEstimate, prior: WallPrior) -> FlagWords | None:
    """A flag where the walls lean on an end of their prior, with its name; None else."""
    walls = cor.wall_restitution
    low, high = prior.lowest, prior.highest
    remedy = 'lower --prior-min-wall-restitution (0.5 at least)'
    # A likelihood that falls from the edge on, flat, half-normal or exponential, puts the lower
    # quantile of 0.025 at 0.03, 0.014, 0.007 of the upper one; with its peak inside, it is more.
    if walls.lower - low < _AT_EDGE * (walls.upper - low):
        place = f'{low:g} (prior.min_wall_restitution)'
    elif high < 1.0 and high - walls.upper < _AT_EDGE * (high - walls.lower):
        place = f'{high:g} (prior.max_wall_restitution)'
        remedy = 'raise --prior-max-wall-restitution'
    else:
        return None
    return FlagWords(
        'wall_limit',
        f'the walls are at an end of what is allowed, {place}; those of the beads make up for it',
        f'{remedy} if such walls are possible',
    )


def reason_of(cor: CorEstimate) -> Words | None:
    """Why a cycle has no restitution; None where it has one."""
    if cor.status in (CorStatus.COOLING, CorStatus.FINAL):
        return None
    if cor.quality & Quality.WRONG_SCALE:
        return FLAGS[Quality.WRONG_SCALE]
    if cor.status is CorStatus.NO_DECAY:
        return Words(
            'the speeds do not fall',
            'look at them with `nanorocks speeds BAG -o speeds.png`; does the camera move, or '
            'was the tray shaken again?',
        )
    contacts = f'{cor.rebounds} rebounds and {cor.collisions} collisions'
    if cor.headline is Headline.CONTACTS:
        why = reason_for_contacts(cor.tension, cor.wall_friction, cor.quality)
        return Words(
            f'only contacts count{", since " if why else ""}{why}, and {contacts} tell too little '
            'of the beads',
            'film more cycles, longer, and closer or at a higher rate',
        )
    if math.isnan(cor.window_start):
        return Words(
            f'too few speeds before the end of the cycle or the first merge: {cor.samples}',
            'film longer; where beads stick early, film closer, so that contacts are found',
        )
    if math.isnan(cor.reduced_chi_square):
        return Words(
            'the speeds are those of grains, whose bias is not known, and no contact was seen',
            'film closer, so that grains are tracked and contacts found',
        )
    return Words(
        f'the decay, with {contacts}, allows almost any restitution',
        'film more cycles, longer after the shaking, and closer or at a higher rate',
    )


def fitted(quantity: Measured) -> bool:
    """Whether a fitted speed or time means anything: it is known to half of itself."""
    return quantity.known and 0.0 < quantity.error <= LARGEST_FIT_ERROR * quantity.value


def sticking_in_words(status: StickingStatus, speed: Interval, onset: float) -> str:
    """The sticking speed of a cycle, and when beads began to stick.

    Parameters
    ----------
    status : StickingStatus
    speed : Interval, [m/s]
    onset : float, [s]
        First merge, since the shaking event; NaN: none.
    """
    began = f', from {onset:.1f} s after the shaking event on' if math.isfinite(onset) else ''
    match status:
        case StickingStatus.MEASURED:
            limits = f'[{_mm(speed.lower)}, {_mm(speed.upper)}]'
            return f'beads stick below {_mm(speed.value)} mm/s {limits}{began}'
        case StickingStatus.NO_MERGE:
            limit = f'; the sticking speed is below {_mm(speed.upper)} mm/s'
            return 'no merge was seen' + (limit if math.isfinite(speed.upper) else '')
        case StickingStatus.NO_UPPER_LIMIT:
            limit = f'; the sticking speed is above {_mm(speed.lower)} mm/s'
            above = limit if math.isfinite(speed.lower) and speed.lower > 0.0 else ''
            return f'beads stick{began}{above}; there is no upper limit'
        case StickingStatus.STUCK_FROM_THE_START:
            return 'beads stuck together from the start; the sticking speed is not known'
        case _:
            return 'not known, since beads were not tracked'


def _mm(speed: float) -> str:
    """A speed in mm/s with the digits that mean something."""
    return f'{1e3 * speed:.3g}' if math.isfinite(speed) else 'unknown'
