"""From merges and speeds to when beads began to stick, and below which speed they do."""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial, reduce
from operator import add, attrgetter
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import NanorocksError
from nanorocks_ros.inference.sticking.merge_likelihood import MergeLikelihood, MergeRates
from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle, sticking_cycle
from nanorocks_ros.inference.sticking.sticking_speed import StickingEstimate, sticking_estimate_of
from nanorocks_ros.physics.sticking_rates import slow_contacts
from nanorocks_ros.records import BodyEstimate, Merge, Quality, SpeedEstimate
from nanorocks_ros.stages.preprocess.shake_detection import NS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings

# Fewer speeds are no cycle.
_FEWEST_SPEEDS = 4
# A merge is used in what is said of an instant when it was known that much later at the latest.
_KNOWN_NS = 1_000_000_000
# Counts of bodies are kept that long; nobody asks of an instant more than seconds ago.
_KEPT_NS = 20 * NS
# Stamps that came over the wire are float32 seconds: 0.1 ms half an hour into a recording.
_ROUNDING_NS = 1_000_000

_stamp = attrgetter('stamp_ns')


@dataclass(slots=True)
class _Cycle:
    """What was seen since a shaking event; counts of bodies by their stamps."""

    number: int
    start_ns: int | None = None
    # Speeds and places are wrong by nobody knows how much.
    wrong_scale: bool = False
    stamps_ns: list[int] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    merges: list[Merge] = field(default_factory=list)
    bodies: list[BodyEstimate] = field(default_factory=list)


class StickingMeter:
    """Follows the merges of one tray, cycle by cycle.

    What it says of an instant depends only on records of times up to then, and merges known a
    second later at the latest, in whatever order they came in.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings.sticking
        self._tray = tray
        self._make_rates: Callable[[], MergeRates] | None = None
        with suppress(NanorocksError):
            # Without a theory of the tray merges are counted, but no speed follows from them.
            contacts = slow_contacts(tray)
            # Its curve is worked out now, while no image waits; a single bead has none.
            if contacts.rates.any():
                contacts.interpolated_rate_below(1.0, settings.sticking.measure)
            self._make_rates = partial(MergeRates, contacts, tray.count, settings.sticking.measure)
        self._restart()

    def _restart(self) -> None:
        self._cycles = {0: _Cycle(0)}
        self._last_ns: int | None = None
        self._finished: dict[int, StickingCycle] = {}
        self._terms: list[MergeLikelihood | None] = []
        self._all: StickingEstimate | None = None
        self._rates = self._make_rates() if self._make_rates else None

    def push(self, record: SpeedEstimate | BodyEstimate | Merge) -> None:
        """Take the next record; a speed whose stamp goes back starts all afresh."""
        if isinstance(record, SpeedEstimate):
            if self._last_ns is not None and record.stamp_ns <= self._last_ns:
                self._restart()
            self._last_ns = record.stamp_ns
        cycle = self._cycles.setdefault(record.cycle, _Cycle(record.cycle))
        if isinstance(record, Merge):
            cycle.merges.append(record)
        elif isinstance(record, BodyEstimate):
            insort(cycle.bodies, record, key=_stamp)
            # Half of them at once, for what is left has to move up.
            last_ns = cycle.bodies[-1].stamp_ns
            if last_ns - cycle.bodies[0].stamp_ns > 2 * _KEPT_NS:
                del cycle.bodies[: bisect_left(cycle.bodies, last_ns - _KEPT_NS, key=_stamp)]
        else:
            cycle.start_ns = record.cycle_start_ns
            cycle.wrong_scale |= bool(record.quality & Quality.WRONG_SCALE)
            # Before the first shaking event there may be hours, and no cycle.
            if cycle.start_ns is not None and np.isfinite(record.mean_projected_speed.value):
                cycle.stamps_ns.append(record.stamp_ns)
                cycle.speeds.append(record.mean_projected_speed.value)
        # Of earlier cycles nothing more is asked, once the next is on its way.
        for number in [one for one in self._cycles if one < record.cycle - 1]:
            del self._cycles[number]

    def bodies(self, cycle: int, stamp_ns: int) -> BodyEstimate | None:
        """The last count of bodies up to an instant of a cycle."""
        own = self._cycles.get(cycle)
        last_ns = stamp_ns + _ROUNDING_NS
        count = bisect_right(own.bodies, last_ns, key=_stamp) if own else 0
        if own is None or count == 0:
            return None
        # Of some with the same stamp the one that came in first.
        return own.bodies[bisect_left(own.bodies, _stamp(own.bodies[count - 1]), key=_stamp)]

    def onset(self, cycle: int, stamp_ns: int) -> float | None:
        """Time of the first merge since the shaking event, [s], as of an instant; None before."""
        own = self._cycles.get(cycle)
        known = [merge.stamp_ns for merge in self._known(own, stamp_ns)] if own else []
        if not known or own is None or own.start_ns is None:
            return None
        return (min(known) - own.start_ns) / NS

    def of_cycle(self, cycle: int, stamp_ns: int) -> StickingEstimate | None:
        """What the cycle says of the sticking speed up to an instant; None when nothing."""
        seen = self._seen(cycle, stamp_ns)
        return self._estimate([self._terms_of(seen)]) if seen else None

    def seen(self) -> tuple[StickingCycle, ...]:
        """All cycles since time last went back, the one under way among them, as known by now."""
        last = max(self._cycles)
        own = self._cycles[last]
        if own.stamps_ns:
            self.of_all(last, own.stamps_ns[-1])
        cycles = dict(self._finished)
        under_way = self._seen(last, own.stamps_ns[-1]) if own.stamps_ns else None
        if under_way is not None:
            cycles[last] = under_way
        return tuple(cycles[number] for number in sorted(cycles))

    def together(self, cycles: Sequence[StickingCycle]) -> StickingEstimate | None:
        """What some cycles of this tray say together, also such of other recordings."""
        if self._make_rates is None or not cycles:
            return None
        # Rates of their own, lest the cycle under way has to be worked out afresh.
        rates = self._make_rates()
        return self._estimate([self._terms_of(cycle, rates) for cycle in cycles])

    def of_all(self, cycle: int, stamp_ns: int) -> StickingEstimate | None:
        """The same of all cycles that were over by then."""
        before = cycle - 1
        if before > 0 and before not in self._finished:
            seen = self._seen(before, stamp_ns)
            if seen is not None:
                self._finished[before] = seen
                self._terms.append(self._terms_of(seen))
                self._all = self._estimate(self._terms)
        return self._all

    def _known(self, cycle: _Cycle, stamp_ns: int) -> list[Merge]:
        last_ns = stamp_ns + _ROUNDING_NS
        return [
            merge
            for merge in cycle.merges
            if merge.stamp_ns <= last_ns and merge.known_ns <= last_ns + _KNOWN_NS
        ]

    def _seen(self, cycle: int, stamp_ns: int) -> StickingCycle | None:
        own = self._cycles.get(cycle)
        # Without counts of bodies nobody looked for merges.
        if own is None or own.start_ns is None or own.wrong_scale or not own.bodies:
            return None
        used = int(np.searchsorted(own.stamps_ns, stamp_ns + _ROUNDING_NS))
        if used < _FEWEST_SPEEDS:
            return None
        return sticking_cycle(
            self._tray.count,
            self._known(own, stamp_ns),
            np.array(own.stamps_ns[:used], dtype=np.int64),
            np.array(own.speeds[:used]),
            own.start_ns,
        )

    def _terms_of(
        self, cycle: StickingCycle, rates: MergeRates | None = None
    ) -> MergeLikelihood | None:
        """What a cycle says of each sticking speed; None where that cannot be told."""
        rates = rates or self._rates
        with suppress(NanorocksError):
            return rates.terms(cycle) if rates else None
        return None

    def _estimate(self, terms: Sequence[MergeLikelihood | None]) -> StickingEstimate | None:
        """By all of some cycles; None where one of them cannot be used."""
        known = [term for term in terms if term is not None]
        if len(known) < len(terms):
            return None
        return sticking_estimate_of(
            reduce(add, known),
            rate_error=self._settings.rate_error,
            probability=self._settings.probability,
        )
