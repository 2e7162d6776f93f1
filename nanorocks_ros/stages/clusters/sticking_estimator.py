"""From merges and speeds to the onset of clustering and the sticking speed."""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial, reduce
from operator import add, attrgetter
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from nanorocks_ros.errors import NanorocksError
from nanorocks_ros.inference.sticking.bounce_tables import RunningBounces
from nanorocks_ros.inference.sticking.chance_proximity import first_merge_path
from nanorocks_ros.inference.sticking.merge_likelihood import MergeLikelihood, MergeRates
from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle, sticking_cycle
from nanorocks_ros.inference.sticking.sticking_speed import StickingEstimate, sticking_estimate_of
from nanorocks_ros.physics.sticking_rates import slow_contacts
from nanorocks_ros.records import (
    NS,
    BodyEstimate,
    Merge,
    PairCollision,
    Quality,
    SpeedEstimate,
)
from nanorocks_ros.stages.contacts.bound_beads import bound_since, is_free
from nanorocks_ros.stages.delays import clusters_after_ns, merges_after_ns
from nanorocks_ros.stages.stage import RestartingStage

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings

# Speeds that a cycle needs.
_FEWEST_SPEEDS = 4
# Counts of bodies are kept that much longer than the instants asked for lie back.
_KEPT_NS = 20 * NS
# Stamps that came over the wire may be rounded.
_ROUNDING_NS = 1_000_000

# Collisions are known two seconds after they happened, and estimates a second after their instant
# where `bodies.delay` is 0.
_COLLISION_NS = NS
Input = SpeedEstimate | BodyEstimate | Merge | PairCollision
_stamp = attrgetter('stamp_ns')


@dataclass(slots=True)
class _Cycle:
    """Records since a shaking event; counts of bodies are sorted by their stamps."""

    number: int
    start_ns: int | None = None
    # Errors of speeds and positions are unknown.
    wrong_scale: bool = False
    stamps_ns: list[int] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    merges: list[Merge] = field(default_factory=list)
    bodies: list[BodyEstimate] = field(default_factory=list)
    collisions: list[PairCollision] = field(default_factory=list)
    bounces: RunningBounces = field(default_factory=RunningBounces)


class StickingEstimator(RestartingStage[Input, NoReturn]):
    """Gathers the merges of one tray, cycle by cycle, for the sticking speed as of an instant.

    An estimate of an instant depends only on records of times up to then, and merges known
    `bodies.delay` later at the latest, in whatever order they came in. A speed whose stamp goes
    back starts all afresh.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    """

    clock = SpeedEstimate

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings.sticking
        self._tray = tray
        self._delay_ns = round(settings.cooling.delay * NS)
        self._merges_after_ns = merges_after_ns(settings.bodies)
        self._kept_ns = clusters_after_ns(settings.bodies) + _KEPT_NS
        self._first_merge_path = first_merge_path(tray, settings.bodies.false_alarm_rate)
        self._make_rates: Callable[[], MergeRates] | None = None
        with suppress(NanorocksError):
            # Without a theory of the tray merges are counted, but there is no sticking speed.
            contacts = slow_contacts(tray)
            # The curve is worked out now, while no image waits; a single bead has none.
            if contacts.rates.any():
                contacts.interpolated_rate_below(1.0, settings.sticking.measure)
            self._make_rates = partial(MergeRates, contacts, tray.count, settings.sticking.measure)
        self.reset()

    def _restart(self, stamp_ns: int | None = None) -> None:
        del stamp_ns
        self._cycles = {0: _Cycle(0)}
        self._finished: dict[int, StickingCycle] = {}
        self._terms: list[MergeLikelihood | None] = []
        self._all: StickingEstimate | None = None
        self._rates = self._make_rates() if self._make_rates else None

    def _process(self, record: Input) -> tuple[NoReturn, ...]:
        cycle = self._cycles.setdefault(record.cycle, _Cycle(record.cycle))
        if isinstance(record, Merge):
            cycle.merges.append(record)
        elif isinstance(record, PairCollision):
            insort(cycle.collisions, record, key=_stamp)
        elif isinstance(record, BodyEstimate):
            insort(cycle.bodies, record, key=_stamp)
            # Half of them at once, for what is left has to move up.
            last_ns = cycle.bodies[-1].stamp_ns
            if last_ns - cycle.bodies[0].stamp_ns > 2 * self._kept_ns:
                del cycle.bodies[: bisect_left(cycle.bodies, last_ns - self._kept_ns, key=_stamp)]
        else:
            cycle.start_ns = record.cycle_start_ns
            cycle.wrong_scale |= bool(record.quality & Quality.WRONG_SCALE)
            # Before the first shaking event there may be hours, and no cycle.
            if cycle.start_ns is not None and np.isfinite(record.mean_projected_speed.value):
                cycle.stamps_ns.append(record.stamp_ns)
                cycle.speeds.append(record.mean_projected_speed.value)
        # Two cycles back nothing is asked any more.
        for number in [number for number in self._cycles if number < record.cycle - 1]:
            del self._cycles[number]
        return ()

    def bodies(self, cycle: int, stamp_ns: int) -> BodyEstimate | None:
        """The last count of bodies up to an instant of a cycle."""
        own = self._cycles.get(cycle)
        last_ns = stamp_ns + _ROUNDING_NS
        count = bisect_right(own.bodies, last_ns, key=_stamp) if own else 0
        if own is None or count == 0:
            return None
        # Of several with the same stamp the one that came in first.
        return own.bodies[bisect_left(own.bodies, _stamp(own.bodies[count - 1]), key=_stamp)]

    def first_merge_ns(self, cycle: int, stamp_ns: int) -> int | None:
        """Stamp of the first merge of a cycle, as of an instant; None before."""
        own = self._cycles.get(cycle)
        known = self._known_merges(own, stamp_ns) if own else []
        return min((merge.stamp_ns for merge in known), default=None)

    def onset(self, cycle: int, stamp_ns: int) -> float | None:
        """Time of the first merge since the shaking event, [s], as of an instant; None before."""
        first_ns = self.first_merge_ns(cycle, stamp_ns)
        start_ns = None if first_ns is None else self._cycles[cycle].start_ns
        return None if first_ns is None or start_ns is None else (first_ns - start_ns) / NS

    def of_cycle(self, cycle: int, stamp_ns: int) -> StickingEstimate | None:
        """Sticking speed of the cycle up to an instant; None when it tells nothing."""
        cycle_so_far = self._cycle_until(cycle, stamp_ns)
        return self._estimate_by([self._terms_of(cycle_so_far)]) if cycle_so_far else None

    def cycles(self) -> tuple[StickingCycle, ...]:
        """All cycles since time last went back, with the one under way."""
        last = max(self._cycles)
        own = self._cycles[last]
        if own.stamps_ns:
            self.of_all(last, own.stamps_ns[-1])
        cycles = dict(self._finished)
        under_way = self._cycle_until(last, own.stamps_ns[-1]) if own.stamps_ns else None
        if under_way is not None:
            cycles[last] = under_way
        return tuple(cycles[number] for number in sorted(cycles))

    def together(self, cycles: Sequence[StickingCycle]) -> StickingEstimate | None:
        """Sticking speed of several cycles of this tray, also of other recordings."""
        if self._make_rates is None or not cycles:
            return None
        # Other rates, so that those of the cycle under way need not be worked out again.
        rates = self._make_rates()
        return self._estimate_by([self._terms_of(cycle, rates) for cycle in cycles])

    def of_all(self, cycle: int, stamp_ns: int) -> StickingEstimate | None:
        """Sticking speed of all cycles that were over by then."""
        before = cycle - 1
        if before > 0 and before not in self._finished:
            cycle_so_far = self._cycle_until(before, stamp_ns)
            if cycle_so_far is not None:
                self._finished[before] = cycle_so_far
                self._terms.append(self._terms_of(cycle_so_far))
                self._all = self._estimate_by(self._terms)
        return self._all

    def _known_merges(self, cycle: _Cycle, stamp_ns: int) -> list[Merge]:
        last_ns = stamp_ns + _ROUNDING_NS
        return [
            merge
            for merge in cycle.merges
            if merge.stamp_ns <= last_ns and merge.known_ns <= last_ns + self._merges_after_ns
        ]

    def _cycle_until(self, cycle: int, stamp_ns: int) -> StickingCycle | None:
        own = self._cycles.get(cycle)
        # Without counts of bodies there was no search for merges.
        if own is None or own.start_ns is None or own.wrong_scale or not own.bodies:
            return None
        used = int(np.searchsorted(own.stamps_ns, stamp_ns + _ROUNDING_NS))
        if used < _FEWEST_SPEEDS:
            return None
        merges = self._known_merges(own, stamp_ns)
        so_far = sticking_cycle(
            self._tray.count,
            merges,
            np.array(own.stamps_ns[:used], dtype=np.int64),
            np.array(own.speeds[:used]),
            own.start_ns,
            first_merge_path=self._first_merge_path,
        )
        if merges:
            return replace(so_far, bounces=self._bounces(own, merges, stamp_ns))
        counted = self.bodies(cycle, stamp_ns)
        return replace(so_far, undecided=counted.bodies.error if counted else 0.0)

    def _bounces(self, own: _Cycle, merges: list[Merge], stamp_ns: int) -> NDArray[np.float64]:
        """What collisions of free beads up to a second before an instant tell; empty without."""
        first_ns = (own.start_ns or 0) + self._delay_ns
        bound = bound_since(merges)
        collisions = [
            collision
            for collision in own.collisions
            if first_ns <= collision.stamp_ns <= stamp_ns - _COLLISION_NS
            and is_free(collision, bound)
        ]
        return own.bounces.of(collisions).speed_log_likelihood() if collisions else np.empty(0)

    def _terms_of(
        self, cycle: StickingCycle, rates: MergeRates | None = None
    ) -> MergeLikelihood | None:
        """Likelihood terms of a cycle for each sticking speed; None where there is no theory."""
        rates = rates or self._rates
        with suppress(NanorocksError):
            return rates.terms(cycle) if rates else None
        return None

    def _estimate_by(self, terms: Sequence[MergeLikelihood | None]) -> StickingEstimate | None:
        """Estimate from the terms of several cycles; None where one of them is missing."""
        known = [term for term in terms if term is not None]
        if len(known) < len(terms):
            return None
        return sticking_estimate_of(
            reduce(add, known),
            rate_error=self._settings.rate_error,
            probability=self._settings.probability,
        )
