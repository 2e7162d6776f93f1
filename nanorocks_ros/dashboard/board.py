"""What the page shows: of each tray the present cycle and what was found last, and every node.

Nothing here waits for a client. Each keeps a `Cursor` of what it was told, and `Board.news` is the
difference to now: a slow client misses steps on the way, and a new one gets the whole cycle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from enum import IntEnum, IntFlag
from typing import TYPE_CHECKING, Any

from nanorocks_ros.records import (
    ClusterEstimate,
    CorEstimate,
    CorStatus,
    GroundTruth,
    SpeedEstimate,
)
from nanorocks_ros.wire.layouts import NS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from nanorocks_ros.experiment.trays import Tray

Shown = SpeedEstimate | CorEstimate | ClusterEstimate | GroundTruth
Row = list[float | None]

# Points of a curve; at ten a second the longest cycle of the flight has 600.
MOST_POINTS = 4096
# Cycles, nodes and values of a node that are remembered: a page needs no more.
_MOST_CYCLES, _MOST_NODES, _MOST_VALUES = 200, 64, 48
_LONGEST_NAME, _LONGEST_TEXT = 80, 300
_FORGOTTEN_S = 60.0
# The clock of a source that starts again; windows of one kind overlap by less.
_BACK_NS = NS // 2
_LEVELS = {0: 'ok', 1: 'warning', 2: 'error', 3: 'silent'}
_COLUMNS: dict[type, tuple[str, tuple[str, ...]]] = {
    SpeedEstimate: ('speed', ('mean_projected_speed', 'mean_projected_speed_error')),
    CorEstimate: (
        'cor',
        (
            'restitution',
            'restitution_lower',
            'restitution_upper',
            'wall_restitution',
            'wall_restitution_lower',
            'wall_restitution_upper',
        ),
    ),
    ClusterEstimate: ('cluster', ('combined_size', 'combined_size_error')),
    GroundTruth: ('truth', ('mean_projected_speed',)),
}
_NOT_SHOWN = {'stamp_ns', 'tray', 'cycle_start_ns'}


class Series:
    """Points of a curve in order of time, of which old ones are thinned when there are many."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.generation = 0

    def append(self, row: Row) -> None:
        """Add a point."""
        self.rows.append(row)
        if len(self.rows) > MOST_POINTS:
            self.rows = self.rows[:-1:2] + self.rows[-1:]
            self.generation += 1

    def cut(self, time: float) -> None:
        """Take back what is later."""
        kept = [row for row in self.rows if row[0] is None or row[0] <= time]
        if len(kept) < len(self.rows):
            self.rows = kept
            self.generation += 1

    def since(self, told: tuple[int, int]) -> tuple[int, list[Row]]:
        """Where new points begin, and the points."""
        generation, count = told
        first = count if generation == self.generation else 0
        return first, self.rows[first:]

    @property
    def end(self) -> tuple[int, int]:
        """What somebody knows who was told everything."""
        return self.generation, len(self.rows)


@dataclass
class Cursor:
    """What a client was told."""

    trays: dict[int, tuple[int, int]] = field(default_factory=dict)
    series: dict[tuple[int, str], tuple[int, int]] = field(default_factory=dict)
    finals: dict[int, int] = field(default_factory=dict)
    nodes: int = 0


@dataclass
class TrayBoard:
    """One tray.

    Parameters
    ----------
    description : str
    cycle : int
    start_ns : int or None
        The shaking event that opened the cycle.
    serial : int
        A new one for each cycle that is shown, also when a source starts again.
    version : int
        Rises with every record.
    """

    description: str
    cycle: int = -1
    start_ns: int | None = None
    serial: int = 0
    version: int = 0
    heard_s: float = 0.0
    series: dict[str, Series] = field(default_factory=dict)
    latest: dict[str, dict[str, Any]] = field(default_factory=dict)
    finals: dict[int, list[float | None]] = field(default_factory=dict)
    _stamps: dict[str, int] = field(default_factory=dict)
    _finals_version: int = 1

    def __post_init__(self) -> None:
        self._begin(-1)

    def take(self, record: Shown, now_s: float) -> None:
        """Note a record."""
        name, columns = _COLUMNS[type(record)]
        # A merge that became known later ends the window where beads began to stick.
        ended = (
            isinstance(record, CorEstimate)
            and record.status is not CorStatus.COOLING
            and record.cycle == self.cycle
        )
        if ended:
            self.series[name].cut(record.stamp_ns / NS)
        elif record.stamp_ns < self._stamps.get(name, record.stamp_ns) - _BACK_NS:
            self.finals.clear()
            self._finals_version += 1
            self._begin(record.cycle)
        if isinstance(record, CorEstimate) and record.status is CorStatus.FINAL:
            self._finish(record)
        self.version += 1
        self.heard_s = now_s
        if record.cycle > self.cycle:
            self._begin(record.cycle)
        if record.cycle < self.cycle:
            # Known seconds later, of the cycle before: only the number that is final counts.
            return
        self._stamps[name] = record.stamp_ns
        self._learn_start(record)
        self.latest[name] = as_fields(record)
        values = (_number(getattr(record, one)) for one in columns)
        self.series[name].append([_number(record.stamp_ns / NS), *values])

    def _begin(self, cycle: int) -> None:
        self.cycle, self.start_ns = cycle, None
        self.serial += 1
        self.series = {name: Series() for name, _ in _COLUMNS.values()}
        self.latest = {}
        self._stamps = {}

    def _finish(self, record: CorEstimate) -> None:
        self.finals[record.cycle] = [
            record.cycle,
            _number(record.restitution),
            _number(record.restitution_lower),
            _number(record.restitution_upper),
        ]
        self._finals_version += 1
        while len(self.finals) > _MOST_CYCLES:
            del self.finals[min(self.finals)]

    def _learn_start(self, record: Shown) -> None:
        if isinstance(record, SpeedEstimate) and record.cycle_start_ns is not None:
            self.start_ns = record.cycle_start_ns
        if self.start_ns is not None or not isinstance(record, CorEstimate):
            return
        if math.isfinite(record.window_end):
            # Whoever comes late has the latched estimates before the first speed.
            self.start_ns = record.stamp_ns - round(record.window_end * NS)

    def news(self, number: int, cursor: Cursor, now_s: float) -> dict[str, Any]:
        """What the cursor does not know yet; the cursor knows it afterwards."""
        known_serial = cursor.trays.get(number, (0, 0))[0]
        cursor.trays[number] = (self.serial, self.version)
        told: dict[str, Any] = {
            'description': self.description,
            'cycle': self.cycle,
            'serial': self.serial,
            'start': None if self.start_ns is None else _number(self.start_ns / NS),
            'age': round(now_s - self.heard_s, 1),
            'latest': self.latest,
        }
        if cursor.finals.get(number) != self._finals_version:
            cursor.finals[number] = self._finals_version
            told['finals'] = list(self.finals.values())
        for name, series in self.series.items():
            known = cursor.series.get((number, name), (0, 0))
            first, rows = series.since(known if known_serial == self.serial else (-1, 0))
            cursor.series[number, name] = series.end
            if rows or known_serial != self.serial:
                told[name] = {'from': first, 'rows': rows}
        return told


class Board:
    """Every tray and every node.

    Parameters
    ----------
    trays : mapping of int to Tray
        For what is said of them; others are shown without.
    """

    def __init__(self, trays: Mapping[int, Tray]) -> None:
        self._known = trays
        self._trays: dict[int, TrayBoard] = {}
        self._nodes: dict[str, dict[str, Any]] = {}
        self._nodes_version = 0

    def take(self, record: Shown, now_s: float) -> None:
        """Note a result.

        Parameters
        ----------
        record : SpeedEstimate, CorEstimate, ClusterEstimate or GroundTruth
        now_s : float, [s]
            Of a clock that never goes back.
        """
        self.expect(record.tray, now_s)
        self._trays[record.tray].take(record, now_s)

    def expect(self, number: int, now_s: float) -> None:
        """Show a tray of which nothing is known but that somebody will tell."""
        if number not in self._trays:
            self._trays[number] = TrayBoard(describe(self._known.get(number)), heard_s=now_s)

    def diagnose(
        self,
        statuses: Iterable[tuple[str, int, str, Sequence[tuple[str, str]]]],
        now_s: float,
    ) -> None:
        """Note what nodes say of themselves: name, level, text, and pairs of names and values."""
        for name, level, text, values in statuses:
            shown = clean(name, _LONGEST_NAME)
            if shown not in self._nodes and len(self._nodes) >= _MOST_NODES:
                continue
            self._nodes[shown] = {
                'level': _LEVELS.get(level, 'error'),
                'text': clean(text, _LONGEST_TEXT),
                'values': [
                    [clean(key, _LONGEST_NAME), clean(value, _LONGEST_TEXT)]
                    for key, value in values[:_MOST_VALUES]
                ],
                'heard_s': now_s,
            }
        self._nodes = {
            name: one for name, one in self._nodes.items() if now_s - one['heard_s'] < _FORGOTTEN_S
        }
        self._nodes_version += 1

    def news(self, cursor: Cursor, now_s: float) -> dict[str, Any]:
        """What the cursor does not know yet, empty when there is nothing."""
        told: dict[str, Any] = {}
        trays = {
            str(number): one.news(number, cursor, now_s)
            for number, one in sorted(self._trays.items())
            if cursor.trays.get(number) != (one.serial, one.version)
        }
        if trays:
            told['trays'] = trays
        if cursor.nodes != self._nodes_version:
            cursor.nodes = self._nodes_version
            told['nodes'] = [
                {
                    'name': name,
                    **{key: value for key, value in one.items() if key != 'heard_s'},
                    'age': round(now_s - one['heard_s'], 1),
                }
                for name, one in sorted(self._nodes.items())
            ]
        return told


def as_fields(record: Shown) -> dict[str, Any]:
    """The numbers of a record by name, None where one is not known; states as words."""
    found: dict[str, Any] = {}
    for one in fields(record):
        value = getattr(record, one.name)
        if one.name in _NOT_SHOWN:
            continue
        if isinstance(value, IntFlag):
            value = value.names() if hasattr(value, 'names') else int(value)
        elif isinstance(value, IntEnum):
            value = value.name.lower()
        elif isinstance(value, float):
            value = _number(value)
        found[one.name] = value
    return found


def describe(tray: Tray | None) -> str:
    """What lies in a tray, in words."""
    if tray is None:
        return ''
    kinds = []
    for one in tray.species:
        low, high = 1e3 * one.diameter_low, 1e3 * one.diameter_high
        size = f'{low:.3g}' if low == high else f'{low:.3g} to {high:.3g}'
        kinds.append(f'{one.count} {one.material} {size} mm')
    return clean(', '.join(kinds) + (', with chalk' if tray.chalk else ''), _LONGEST_TEXT)


def clean(text: str, longest: int) -> str:
    """A text from outside: cut, and without characters that turn or hide others."""
    shown = ''.join(one if one.isprintable() else '\N{REPLACEMENT CHARACTER}' for one in text)
    return shown if len(shown) <= longest else f'{shown[: longest - 1]}…'


def _number(value: float) -> float | None:
    # Stamps in seconds need the milliseconds, up to a day.
    return float(f'{value:.9g}') if math.isfinite(value) else None
