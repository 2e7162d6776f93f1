"""Repair of the time stamps of a film: missing, out of order, wrong, or set back."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

Item = TypeVar('Item')

# Number of following frames that distinguish a single wrong time from a clock that was set back.
_LOOKAHEAD = 8
# Number of steps whose median is the usual step.
_HISTORY = 32
# A jump by more usual steps than this may be a wrong time.
_MAX_JUMP = 4


class Stamped(NamedTuple, Generic[Item]):
    """Something and its stamp, [ns]."""

    stamp_ns: int
    item: Item


@dataclass(slots=True)
class RepairCounts:
    """Number of repairs to the times of a film.

    Parameters
    ----------
    missing : int
        Frames without a time.
    reordered : int
        Frames that were out of order and were moved.
    replaced : int
        Frames whose time was a duplicate or far from those of the neighbouring frames.
    set_back : int
        Steps back of the clock; the stamps continue from the time before the step.
    """

    missing: int = 0
    reordered: int = 0
    replaced: int = 0
    set_back: int = 0


@dataclass(slots=True)
class TimestampRepair(Generic[Item]):
    """Make time stamps rise strictly. Stamps that rise already are not changed.

    Parameters
    ----------
    step_ns : int, [ns], > 0
        Usual time between two frames, used until the frames show it.
    repairs : RepairCounts
    last_ns : int or None, [ns]
        Last stamp that was returned.
    """

    step_ns: int
    repairs: RepairCounts = field(default_factory=RepairCounts)
    last_ns: int | None = None
    _shift_ns: int = 0
    _steps: deque[int] = field(default_factory=lambda: deque(maxlen=_HISTORY))

    def repaired(self, timed: Iterable[tuple[int | None, Item]]) -> Iterator[Stamped[Item]]:
        """Yield each item with its stamp as soon as the items behind it are known.

        Parameters
        ----------
        timed : iterable of (int or None, object)

        Yields
        ------
        Stamped
            Stamps rise strictly.
        """
        waiting: deque[tuple[int | None, Item]] = deque()
        for pair in timed:
            waiting.append(pair)
            if len(waiting) > _LOOKAHEAD:
                yield self._next(waiting)
        while waiting:
            yield self._next(waiting)

    def _next(self, waiting: deque[tuple[int | None, Item]]) -> Stamped[Item]:
        index = self._next_index(waiting)
        time_ns, item = waiting[index]
        del waiting[index]
        if self.last_ns is None:
            stamp_ns = self._first_stamp(time_ns, waiting)
        else:
            stamp_ns = self._stamp(time_ns, self._later(waiting))
        if self.last_ns is not None:
            self._steps.append(stamp_ns - self.last_ns)
        self.last_ns = stamp_ns
        return Stamped(stamp_ns, item)

    def _later(self, waiting: deque[tuple[int | None, Item]]) -> list[int]:
        return [time + self._shift_ns for time, _ in waiting if time is not None]

    def usual_ns(self) -> int:
        """Median time between two of the last frames, [ns]."""
        if not self._steps:
            return self.step_ns
        return sorted(self._steps)[len(self._steps) // 2]

    def _next_index(self, waiting: deque[tuple[int | None, Item]]) -> int:
        """Index of the next item: the first, unless others belong before it."""
        first = waiting[0][0]
        if first is None or len(waiting) < 2:
            return 0
        if self.last_ns is None:
            return self._first_index(first, waiting)
        lower, upper = self.last_ns - self._shift_ns, first
        before = [
            index
            for index, (time, _) in enumerate(waiting)
            if time is not None and lower < time < upper
        ]
        # If the first time is wrong, most of the others are before it.
        if not before or self._is_jump(first + self._shift_ns, waiting, len(before)):
            return 0
        self.repairs.reordered += 1
        return min(before, key=lambda index: waiting[index][0] or 0)

    def _first_index(self, first: int, waiting: deque[tuple[int | None, Item]]) -> int:
        """Index of the first item of the film, for which there is no earlier stamp."""
        times = [time for time, _ in waiting if time is not None]
        # A clock that was set back repeats times, or lies far behind.
        repeated = len(set(times)) < len(times)
        if repeated or not 0 < first - min(times) <= _MAX_JUMP * self.usual_ns():
            return 0
        self.repairs.reordered += 1
        return min(range(len(waiting)), key=lambda index: _or_later(waiting[index][0], first))

    def _is_jump(self, time_ns: int, waiting: deque[tuple[int | None, Item]], before: int) -> bool:
        """Whether a time is far ahead of the last stamp and most of the others are before it."""
        assert self.last_ns is not None
        jump = time_ns - self.last_ns > _MAX_JUMP * self.usual_ns()
        return jump and 2 * before >= len(waiting) - 1

    def _first_stamp(self, time_ns: int | None, waiting: deque[tuple[int | None, Item]]) -> int:
        """Stamp of the first item; if it has no time, extrapolated from the next items."""
        if time_ns is not None:
            return time_ns
        self.repairs.missing += 1
        known = [(time, index) for index, (time, _) in enumerate(waiting) if time is not None]
        if not known:
            return 0
        first, index = known[0]
        near = (time for time, _ in known if time >= first - _MAX_JUMP * self.usual_ns())
        return min(near) - (index + 1) * self.usual_ns()

    def _stamp(self, time_ns: int | None, later: list[int]) -> int:
        assert self.last_ns is not None
        usual = self.usual_ns()
        if time_ns is None:
            self.repairs.missing += 1
            return self._between(later, usual)
        time_ns += self._shift_ns
        ahead = [time for time in later if time > self.last_ns]
        if time_ns > self.last_ns:
            if not any(time < time_ns for time in ahead):
                return time_ns
        elif len(ahead) * 2 < len(later):
            self.repairs.set_back += 1
            self._shift_ns += self.last_ns + usual - time_ns
            return self.last_ns + usual
        self.repairs.replaced += 1
        return self._between(later, usual)

    def _between(self, later: list[int], usual: int) -> int:
        """A stamp between the last one and the next."""
        assert self.last_ns is not None
        following = min((time for time in later if time > self.last_ns), default=None)
        if following is None:
            return self.last_ns + usual
        return self.last_ns + max(1, min(usual, (following - self.last_ns) // 2))


def _or_later(time_ns: int | None, other_ns: int) -> int:
    return other_ns if time_ns is None else time_ns
