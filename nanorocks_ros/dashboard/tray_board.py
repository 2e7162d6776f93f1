"""One tray on the page: curves of the current cycle, latest results, past cycles.

A `Cursor` per client records what was sent to it.

Tested by ``test/dashboard/test_board.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum, IntFlag
from typing import TYPE_CHECKING, Any

from nanorocks_ros.dashboard.curves import Series
from nanorocks_ros.dashboard.past_cycles import PastCycles
from nanorocks_ros.outputs.json_values import finite_or_none
from nanorocks_ros.records import (
    NS,
    ArrayRecord,
    CorEstimate,
    CorStatus,
    GroundTruth,
    Headline,
    Quality,
    SpeedEstimate,
)
from nanorocks_ros.records.headlines import reason_for_contacts
from nanorocks_ros.records.result_words import LOOK, LOOK_LIVE, flags_in_words, reason_of
from nanorocks_ros.wire.flat_records import flat_names, flat_value
from nanorocks_ros.wire.products import CURVES

if TYPE_CHECKING:
    from nanorocks_ros.dashboard.curves import Row

# Past cycles that are kept.
_MOST_CYCLES = 200
# A step back by more is a restart of the source; windows of a method overlap by less.
_BACK_NS = NS // 2
_NOT_SHOWN = {'stamp_ns', 'tray', 'cycle_start_ns'}


@dataclass
class Cursor:
    """What was sent to a client."""

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
    heard_s : float, [s]
        Time of the last measured record; the truth does not count.
    past : PastCycles
    """

    description: str
    cycle: int = -1
    start_ns: int | None = None
    serial: int = 0
    version: int = 0
    heard_s: float = 0.0
    past: PastCycles = field(default_factory=lambda: PastCycles(0))
    series: dict[str, Series] = field(default_factory=dict)
    latest: dict[str, dict[str, Any]] = field(default_factory=dict)
    finals: dict[int, list[float | None]] = field(default_factory=dict)
    _stamps: dict[str, int] = field(default_factory=dict)
    _finals_version: int = 1

    def __post_init__(self) -> None:
        self._clear()

    def take(self, record: ArrayRecord, now_s: float) -> None:
        """Note a record."""
        self.version += 1
        if isinstance(record, GroundTruth):
            self._take_truth(record)
            return
        name = CURVES[type(record)].name
        # A merge that became known later ends the window where beads began to stick.
        ended = (
            isinstance(record, CorEstimate)
            and record.status is not CorStatus.COOLING
            and record.cycle == self.cycle
        )
        last_ns = self._stamps.get(name, record.stamp_ns)
        if ended:
            self.series[name].cut(record.stamp_ns / NS)
        elif record.stamp_ns < last_ns - _BACK_NS:
            self._start_again(record, last_ns)
        if isinstance(record, CorEstimate) and record.status is CorStatus.FINAL:
            self._finish(record)
        self.heard_s = now_s
        if record.cycle > self.cycle:
            self._keep_cycle(record)
            self._begin(record)
        if record.cycle < self.cycle:
            # Late, of an earlier cycle.
            self.past.amend(record.cycle, name, as_fields(record), _row(record))
            return
        self._learn_start(record)
        self._note(record)

    def _take_truth(self, truth: GroundTruth) -> None:
        """Add the truth by time, whatever its cycle.

        The simulator counts cycles from its start, a measuring node from when it joined.
        """
        if truth.stamp_ns < self._stamps.get('truth', truth.stamp_ns) - _BACK_NS:
            self.series['truth'].cut(-math.inf)
        self._note(truth)

    def _note(self, record: ArrayRecord) -> None:
        name = CURVES[type(record)].name
        self._stamps[name] = record.stamp_ns
        self.latest[name] = as_fields(record)
        self.series[name].append(_row(record))

    def _keep_cycle(self, following: ArrayRecord) -> None:
        """Keep the cycle that is over, unless it is the time before the first shaking event.

        The truth is not delayed by measuring: what is of the following cycle is left out.
        """
        if self.cycle < 1:
            return
        rows = {name: series.rows for name, series in self.series.items()}
        end_ns = getattr(following, 'cycle_start_ns', None) or following.stamp_ns
        rows['truth'] = [row for row in rows['truth'] if (row[0] or 0.0) < end_ns / NS]
        start = None if self.start_ns is None else _number(self.start_ns / NS)
        self.past.keep(self.cycle, start, self.latest, rows)
        self._finals_version += 1

    def _start_again(self, record: ArrayRecord, last_ns: int) -> None:
        """Drop the results from before the clock of the source went back from `last_ns`."""
        self.finals.clear()
        self.past.forget()
        self._finals_version += 1
        # The truth may have gone back first, and then belongs to what begins here.
        if self._stamps.get('truth', last_ns) > (record.stamp_ns + last_ns) // 2:
            self._clear()
        self._begin(record)

    def _begin(self, record: ArrayRecord) -> None:
        """Show the cycle of a record, with the truth since its start, or since the record."""
        truth, latest = self.series['truth'], self.latest.get('truth')
        stamp_ns = self._stamps.get('truth')
        self._clear()
        self.cycle = record.cycle
        self._learn_start(record)
        since_ns = record.stamp_ns if self.start_ns is None else self.start_ns
        truth.drop_before(since_ns / NS)
        if latest is not None and stamp_ns is not None and truth.rows:
            self.series['truth'], self.latest['truth'] = truth, latest
            self._stamps['truth'] = stamp_ns

    def _clear(self) -> None:
        self.start_ns = None
        self.serial += 1
        self.series = {product.name: Series() for product in CURVES.values()}
        self.latest = {}
        self._stamps = {}

    def _finish(self, record: CorEstimate) -> None:
        self.finals[record.cycle] = [
            record.cycle,
            _number(record.restitution.value),
            _number(record.restitution.lower),
            _number(record.restitution.upper),
        ]
        self._finals_version += 1
        while len(self.finals) > _MOST_CYCLES:
            del self.finals[min(self.finals)]

    def _learn_start(self, record: ArrayRecord) -> None:
        if isinstance(record, SpeedEstimate) and record.cycle_start_ns is not None:
            self.start_ns = record.cycle_start_ns
        if self.start_ns is not None or not isinstance(record, CorEstimate):
            return
        # Where beads stick the window ends with the decay, before the last contact counts.
        sticks = Quality.STICKING in record.quality
        if math.isfinite(record.window_end) and not sticks:
            # A late subscriber gets the latched estimates before the first speed.
            self.start_ns = record.stamp_ns - round(record.window_end * NS)

    def news(self, number: int, cursor: Cursor, now_s: float) -> dict[str, Any]:
        """The changes since the cursor; the cursor is moved to now."""
        known_serial = cursor.trays.get(number, (0, 0))[0]
        cursor.trays[number] = (self.serial, self.version)
        news: dict[str, Any] = {
            'description': self.description,
            'cycle': self.cycle,
            'serial': self.serial,
            'start': None if self.start_ns is None else _number(self.start_ns / NS),
            'age': round(now_s - self.heard_s, 1),
            'latest': self.latest,
        }
        if cursor.finals.get(number) != self._finals_version:
            cursor.finals[number] = self._finals_version
            news['finals'] = list(self.finals.values())
            news['past'] = self.past.numbers
        for name, series in self.series.items():
            known = cursor.series.get((number, name), (0, 0))
            first, rows = series.since(known if known_serial == self.serial else (-1, 0))
            cursor.series[number, name] = series.end
            if rows or known_serial != self.serial:
                news[name] = {'from': first, 'rows': rows}
        return news


def as_fields(record: ArrayRecord) -> dict[str, Any]:
    """The numbers of a record by flat name, None where one is not known; states as words."""
    elements: dict[str, Any] = {}
    for name in flat_names(type(record)):
        if name in _NOT_SHOWN:
            continue
        value = flat_value(record, name)
        if isinstance(value, Quality):
            elements['flags'] = [
                f'{flag.text}; {flag.remedy.replace(LOOK, LOOK_LIVE)}'
                for flag in flags_in_words(value)
            ]
        if isinstance(value, IntFlag):
            value = value.names() if hasattr(value, 'names') else int(value)
        elif isinstance(value, IntEnum):
            value = value.name.lower()
        elif isinstance(value, float):
            value = _number(value)
        elements[name] = value
    if isinstance(record, CorEstimate) and (reason := reason_of(record)) is not None:
        elements['reason'] = reason.text
    if isinstance(record, CorEstimate) and record.headline is Headline.CONTACTS:
        elements['headline_reason'] = reason_for_contacts(
            record.tension, record.wall_friction, record.quality
        )
    return elements


def _row(record: ArrayRecord) -> Row:
    values = (_number(flat_value(record, column)) for column in CURVES[type(record)].curve)
    return [_number(record.stamp_ns / NS), *values]


def _number(value: float) -> float | None:
    # Stamps in seconds need the milliseconds, up to a day.
    return finite_or_none(float(f'{value:.9g}'))
