"""Whether the beads of a film are recognised well enough to use the result, in words."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nanorocks_ros.outputs.json_values import json_values
from nanorocks_ros.records import Quality
from nanorocks_ros.records.result_words import FLAGS, FlagWords

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.recognition_counts import SpeciesCounts

EXIT_NOT_USABLE = 3
"""Exit code of commands that are done, with a result that cannot be used."""

_PERCENT = 100.0
_MM = 1e3
# Seen beads over expected ones: nothing, too few to use, and fewer than told (as `FEW_BEADS`).
_NOTHING, _TOO_FEW, _FEW = 0.05, 0.5, 0.85
# The same above which something else is taken for beads.
_TOO_MANY = 1.2
# Beads that are seen where any number may be: fewer are nothing.
_LEAST_SEEN = 0.1
# Shares of the discs that tell of something other than beads.
_MAX_AT_REST, _MAX_OVERLAPPING, _MAX_ELONGATED = 0.5, 0.3, 0.4
# Share of the speeds near the limit: flagged, and not usable.
_NEAR_LIMIT, _AT_LIMIT = 0.01, 0.05
_MAX_WRONG_SCALE = 0.5
# Difference of the diameter of the discs from the one told, as a part: flagged, and not usable.
# Blur and light move the outlines of beads of a few pixels by a tenth.
_OTHER_SIZE, _WRONG_SIZE = 0.12, 0.18
# Power of the time below which displacements are those of diffusion, not of flight.
_FREE_FLIGHT = 1.35
# Shorter tracks, where any number may be, are not those of beads; from this many frames on.
_SHORT_TRACK, _ENOUGH_FRAMES = 5.0, 20

# Pixels that stand out from the floor: times its scatter, gray levels, and share of the picture.
_OUTSTANDING, _LEAST_LEVELS, _LEAST_OUTSTANDING = 4.0, 8.0, 1e-3

_SEE = 'look at the rings with `nanorocks track BAG --picture tracks.png`'


class Scenery(NamedTuple):
    """What the picture says of the beads, beside the tracks.

    Parameters
    ----------
    contrast : str
        `bright` where what stands out is brighter than the floor, `dark`, or '': not known.
    elongated : float
        Share of the outlines, each of one object, that are no circles; NaN: not known.
    """

    contrast: str = ''
    elongated: float = float('nan')


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """How well one species of a tray was recognised.

    Parameters
    ----------
    tray : int
    material : str
    text : str
        A sentence with the numbers.
    usable : bool
    flags : tuple of FlagWords
        What is wrong, and what to do about it; the first is the gravest. Empty: nothing.
    """

    tray: int
    material: str
    text: str
    usable: bool
    flags: tuple[FlagWords, ...] = ()

    @property
    def word(self) -> str:
        """`usable`, `usable with care` or `NOT USABLE`, with the names of the flags."""
        names = ', '.join(flag.name for flag in self.flags)
        if not self.usable:
            return f'NOT USABLE ({names})'
        return f'usable with care ({names})' if names else 'usable'

    def lines(self) -> list[str]:
        """The verdict, and a line for each flag."""
        return [
            f'{self.text}: {self.word}',
            *(f'{flag.name}: {flag.text}; {flag.remedy}' for flag in self.flags),
        ]


class _Fault(NamedTuple):
    """Something that may be wrong: whether it is, whether it is grave, and the words."""

    applies: bool
    grave: bool
    words: FlagWords


def recognition_verdict(counts: SpeciesCounts, scenery: Scenery | None = None) -> Verdict:
    """The verdict on one species.

    Parameters
    ----------
    counts : SpeciesCounts
    scenery : Scenery, optional
        What the picture says, where somebody looked.

    Returns
    -------
    Verdict
    """
    scenery = scenery or Scenery()
    faults = [fault for fault in _faults(counts, scenery) if fault.applies]
    return Verdict(
        tray=counts.tray,
        material=counts.material,
        text=_sentence(counts),
        usable=not any(fault.grave for fault in faults),
        flags=tuple(fault.words for fault in sorted(faults, key=lambda fault: not fault.grave)),
    )


def recognition_verdicts(
    counts: Iterable[SpeciesCounts], scenery: Scenery | None = None
) -> tuple[Verdict, ...]:
    """The verdicts on all species that are tracked; crowded grains are not, and have none."""
    return tuple(recognition_verdict(row, scenery) for row in counts if row.followed)


def scenery_of(gray: NDArray[np.uint8]) -> Scenery:
    """What a picture of the tray says of its beads.

    Parameters
    ----------
    gray : ndarray of uint8, (rows, columns)
    """
    values = gray.astype(np.float64)
    off = values - np.median(values)
    scatter = 1.4826 * float(np.median(np.abs(off)))
    outstanding = np.abs(off) > max(_OUTSTANDING * scatter, _LEAST_LEVELS)
    if outstanding.mean() < _LEAST_OUTSTANDING:
        return Scenery()
    return Scenery(contrast='bright' if off[outstanding].sum() > 0.0 else 'dark')


def verdict_as_json(verdict: Verdict) -> dict[str, Any]:
    """A verdict as plain values."""
    values: dict[str, Any] = json_values(asdict(verdict))
    values['flags'] = [flag._asdict() for flag in verdict.flags]
    return values


def _sentence(counts: SpeciesCounts) -> str:
    name = f'tray {counts.tray}, {counts.material}'
    if counts.expected is None:
        return f'{name}: {counts.seen:.1f} beads seen, mean of {counts.frames} frames'
    if counts.complete >= 0.5 and counts.seen <= _TOO_MANY * counts.expected:
        share = _PERCENT * counts.complete
        return f'{name}: all {counts.expected} beads seen in {share:.0f} % of frames'
    share = _PERCENT * counts.seen / max(counts.expected, 1)
    return f'{name}: {counts.seen:.1f} of {counts.expected} beads seen ({share:.0f} %)'


def _faults(counts: SpeciesCounts, scenery: Scenery) -> list[_Fault]:
    return [*_number_faults(counts, scenery), *_shape_faults(counts, scenery), *_scale(counts)]


def _number_faults(counts: SpeciesCounts, scenery: Scenery) -> list[_Fault]:
    """Nothing, too few or too many seen."""
    if counts.expected is None:
        nothing = counts.seen < _LEAST_SEEN
        few = too_few = many = False
    else:
        share = counts.seen / max(counts.expected, 1)
        nothing = share < _NOTHING
        few, too_few = _NOTHING <= share < _FEW, share < _TOO_FEW
        many = share > _TOO_MANY
    # Where most beads are seen, others are hidden, not of another look.
    look, remedy = _contrast_words(counts, scenery if nothing or too_few else Scenery())
    return [
        _Fault(nothing, True, FlagWords('nothing_seen', f'no bead was recognised{look}', remedy)),
        _Fault(
            few,
            too_few,
            FlagWords(
                'few_seen',
                f'fewer beads than the trays file tells{look}',
                f'{_SEE}; correct the count, or {remedy}',
            ),
        ),
        _Fault(
            many,
            True,
            FlagWords(
                'too_many_seen',
                'more discs than the trays file tells: something else is taken for beads',
                f'{_SEE}; correct count and diameter_mm, or give the colour of the beads '
                '(`colour: "#c03020"`)',
            ),
        ),
        _flicker(counts),
    ]


def _contrast_words(counts: SpeciesCounts, scenery: Scenery) -> tuple[str, str]:
    """Why nothing may be seen, and the remedy."""
    if counts.learnt:
        return '', 'correct diameter_mm, the scale, and colour and look of the species, if given'
    if scenery.contrast == 'bright':
        return ', and the beads look brighter than the floor', 'add `look: bright` to the species'
    if scenery.contrast == 'dark':
        return '', 'correct diameter_mm and the scale, or add `look: dark` to the species'
    return '', 'add `look: auto` to the species, or its `colour:`'


def _flicker(counts: SpeciesCounts) -> _Fault:
    short = counts.track_length < _SHORT_TRACK and counts.frames >= _ENOUGH_FRAMES
    return _Fault(
        short and counts.seen >= _LEAST_SEEN,
        True,
        FlagWords(
            'short_tracks',
            f'discs are followed for {counts.track_length:.0f} frames only: noise, or too '
            'fast to link',
            f'{_SEE}; film at a higher rate, or give diameter and colour of the beads',
        ),
    )


def _shape_faults(counts: SpeciesCounts, scenery: Scenery) -> list[_Fault]:
    """Discs that are no beads: by their rest, by their shape."""
    rods = counts.overlapping > _MAX_OVERLAPPING or scenery.elongated > _MAX_ELONGATED
    return [
        _Fault(
            counts.at_rest > _MAX_AT_REST,
            True,
            FlagWords(
                'never_move',
                f'{_PERCENT * counts.at_rest:.0f} % of the discs never move: parts of the '
                'container, or beads at rest',
                f'{_SEE}; correct diameter_mm or colour, or leave them out with `masks_mm:`',
            ),
        ),
        _Fault(
            rods,
            True,
            FlagWords(
                'elongated',
                'outlines are no circles: rods or clumps, each taken for several beads',
                f'{_SEE}; only round beads can be measured',
            ),
        ),
    ]


def _scale(counts: SpeciesCounts) -> list[_Fault]:
    """Speeds at the limit of the links; a scale and sizes that are at odds with the picture."""
    limit = _MM * counts.max_speed
    other = counts.diameter_ratio - 1.0
    wrong = FLAGS[Quality.WRONG_SCALE]
    return [
        _Fault(
            counts.near_limit > _NEAR_LIMIT,
            counts.near_limit > _AT_LIMIT,
            FlagWords(
                'speed_limit',
                f'{_PERCENT * counts.near_limit:.0f} % of the speeds are near {limit:g} mm/s, '
                'the largest that is linked; faster beads are lost',
                f'raise it: --tracking-max-speed {3.0 * counts.max_speed:g}',
            ),
        ),
        _Fault(
            counts.spread_exponent < _FREE_FLIGHT,
            False,
            FlagWords(
                'diffusive',
                'beads do not fly straight from frame to frame (squared displacements grow as '
                f'time to the power {counts.spread_exponent:.1f}, 2 in free flight): a mean speed '
                'depends on the lag',
                'film at a higher rate, or compare diffusion instead of speeds',
            ),
        ),
        _Fault(
            abs(other) > _OTHER_SIZE,
            abs(other) > _WRONG_SIZE,
            FlagWords(
                'other_size',
                f'the discs are at least {_PERCENT * abs(other):.0f} % '
                f'{"larger" if other > 0.0 else "smaller"} than the diameter that is told',
                f'{_SEE}; correct the diameter, or have it found: `auto`',
            ),
        ),
        _Fault(
            counts.wrong_scale > _MAX_WRONG_SCALE,
            True,
            FlagWords('wrong_scale', wrong.text, wrong.remedy),
        ),
    ]
