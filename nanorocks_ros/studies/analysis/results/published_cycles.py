"""What `nanorocks analyse` published of cycles: figures show it first.

Tested by ``test/cli/figures/test_published_first.py``.
"""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.outputs.html_report import number, with_interval
from nanorocks_ros.recordings.bag.bag_folder import read_metadata
from nanorocks_ros.records import CorEstimate, CorRelation, Headline, headline_in_words
from nanorocks_ros.records.result_words import RELATIONS, flags_in_words, reason_of
from nanorocks_ros.studies.analysis.results.result_tables import read_columns
from nanorocks_ros.studies.analysis.results.results_folder import truth_keys
from nanorocks_ros.studies.analysis.results.results_json import last_of_each_cycle
from nanorocks_ros.studies.results.results_provenance import BAG_NAME
from nanorocks_ros.wire.array_layouts import from_array, layout

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.records import Interval

_LETTERS, _NO_BREAK = 112, '\N{NO-BREAK SPACE}'
_NEEDED = 'time', 'cycle', 'status', 'relation', 'restitution', 'headline'
_ALONE = ('joint', 'decay', 'contact')
_NAMES = {'joint': 'both together', 'decay': 'decay alone', 'contact': 'contacts alone'}
_SHOWN_BY = {Headline.JOINT: 'joint', Headline.DECAY: 'decay', Headline.CONTACTS: 'contact'}


class Truth(NamedTuple):
    """The restitutions of a simulation, where it is known."""

    beads: float
    walls: float


def published_cycles(speeds: Path, tray: int) -> list[CorEstimate]:
    """The final estimate of every cycle, from the table beside that of the speeds.

    Parameters
    ----------
    speeds : Path
        ``tray_K_speed.csv``; ``tray_K_cor.csv`` beside it holds what was published.
    tray : int

    Returns
    -------
    list of CorEstimate
        In order of time; empty where there is no such table.
    """
    path = speeds.with_name(speeds.name.replace('_speed.csv', '_cor.csv'))
    if path == speeds or not path.is_file():
        return []
    names = [field.name for field in layout(CorEstimate).fields]
    try:
        # A table of an earlier version lacks what was not known then.
        columns = read_columns(path, _NEEDED, names)
        unknown = np.full(len(columns['cycle']), np.nan)
        rows = np.column_stack([columns.get(name, unknown) for name in names])
        return last_of_each_cycle(
            [from_array(CorEstimate, row, tray=tray, epoch_ns=0, where=str(path)) for row in rows]
        )
    except (RecordingError, FrameError, ValueError):
        return []


def truth_of(folder: Path, tray: int) -> Truth | None:
    """The restitutions of the simulation that made the recording of some results; None else."""
    try:
        metadata = read_metadata(folder / BAG_NAME)
        beads, walls = (float(metadata[key]) for key in truth_keys(tray))
    except (RecordingError, LookupError, ValueError):
        return None
    return Truth(beads, walls)


def published_lines(cors: list[CorEstimate], truth: Truth | None = None) -> list[str]:
    """The published restitution first, with its source, then the others, flags and the truth.

    Parameters
    ----------
    cors : list of CorEstimate
        Final estimates of one cycle or more.
    truth : Truth, optional

    Returns
    -------
    list of str
        Empty where nothing was published and nothing is known.
    """
    lines = []
    if cors:
        mark = ':' if len(cors) == 1 else ','
        lines = [f'analyse{mark} {published_text(cors)}']
    if len(cors) == 1:
        lines += _other_lines(cors[0])
    if truth is not None:
        lines.append(f'truth: beads {truth.beads:g}, walls {truth.walls:g}')
    return [part for line in lines for part in _wrapped(line)]


def _wrapped(line: str) -> list[str]:
    """A line in parts, broken after semicolons where that is enough."""
    unbroken = '; '.join(part.replace(' ', _NO_BREAK) for part in line.split('; '))
    parts = textwrap.wrap(unbroken, _LETTERS, break_long_words=False)
    if any(len(part) > _LETTERS for part in parts):
        parts = textwrap.wrap(line, _LETTERS)
    return [part.replace(_NO_BREAK, ' ') for part in parts]


def published_text(cors: list[CorEstimate]) -> str:
    """The published restitutions of a cycle, or of several, and what they come from.

    Parameters
    ----------
    cors : list of CorEstimate
        Final estimates of one cycle or more.
    """
    if len(cors) > 1:
        return _range_text(cors)
    (cor,) = cors
    walls = ''
    if math.isfinite(cor.wall_restitution.value):
        walls = f', walls {_text(cor.wall_restitution)}'
    if reason_of(cor) is not None:
        return f'restitution of beads unknown{walls}'
    return f'beads {_text(cor.restitution)} (95 %){walls}, {_source(cor)}'


def _other_lines(cor: CorEstimate) -> list[str]:
    """Why a cycle has no restitution, or the others that it has, and what is wrong."""
    reason = reason_of(cor)
    if reason is not None:
        return [f'reason: {reason.text}']
    lines = []
    others = [
        f'{_NAMES[name]} {_text(value)}'
        for name in _ALONE
        if name != _SHOWN_BY.get(cor.headline)
        and math.isfinite((value := getattr(cor, f'{name}_restitution')).value)
    ]
    if cor.relation is not CorRelation.PAPER and math.isfinite(cor.paper_restitution):
        others.append(f'closed form of the paper {number(cor.paper_restitution)}')
    if others:
        lines.append(f'others, beads: {"; ".join(others)}')
    if flags := flags_in_words(cor.quality):
        lines.append(f'flags: {"; ".join(flag.text for flag in flags)}')
    return lines


def _source(cor: CorEstimate) -> str:
    if cor.relation is CorRelation.PAPER:
        return f'from the {RELATIONS[cor.relation]}; interval of statistics only'
    words = headline_in_words(cor.headline, cor.tension, cor.wall_friction, cor.quality)
    return f'from {words}'


def _range_text(cors: list[CorEstimate]) -> str:
    """The published restitutions of several cycles: from the lowest to the highest."""
    known = sorted(cor.restitution.value for cor in cors if reason_of(cor) is None)
    if not known:
        return f'restitution of beads unknown in all {len(cors)} cycles'
    sources = {_source(cor).split(',')[0].split(';')[0] for cor in cors if reason_of(cor) is None}
    named = ', or '.join(sorted(sources))
    return (
        f'{len(known)} of {len(cors)} cycles: beads {number(known[0])} to '
        f'{number(known[-1])}, median {number(float(np.median(known)))}, {named}'
    )


def _text(interval: Interval) -> str:
    return with_interval(interval.value, (interval.lower, interval.upper))
