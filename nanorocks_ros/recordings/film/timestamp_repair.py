"""Stamps that rise from picture to picture, from what a film says of its times."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

Item = TypeVar('Item')

# Pictures that are looked ahead of, to tell one wrong time from a clock that was set back.
_AHEAD = 8
_HISTORY = 32
# Steps by which a time has to jump to be taken for a wrong one.
_JUMP = 4


class Stamped(NamedTuple, Generic[Item]):
    """Something and its stamp, [ns]."""

    stamp_ns: int
    item: Item


@dataclass(slots=True)
class Repairs:
    """What had to be done to the times of a film.

    Parameters
    ----------
    missing : int
        Pictures without a time.
    reordered : int
        Pictures that came too early, and were put in their place.
    replaced : int
        Pictures whose time was that of another, or far from those around it.
    set_back : int
        How often the clock was set back and goes on from there.
    """

    missing: int = 0
    reordered: int = 0
    replaced: int = 0
    set_back: int = 0


@dataclass(slots=True)
class Steady(Generic[Item]):
    """Makes times rise. Those that rise are left alone.

    Parameters
    ----------
    step_ns : int, [ns], > 0
        Usual time between two pictures, until the pictures tell.
    repairs : Repairs
    last_ns : int or None, [ns]
        Stamp given last.
    """

    step_ns: int
    repairs: Repairs = field(default_factory=Repairs)
    last_ns: int | None = None
    _shift_ns: int = 0
    _steps: deque[int] = field(default_factory=lambda: deque(maxlen=_HISTORY))

    def stamps(self, timed: Iterable[tuple[int | None, Item]]) -> Iterator[Stamped[Item]]:
        """Each item with its stamp, as soon as those behind it are known.

        Parameters
        ----------
        timed : iterable of (int or None, object)

        Yields
        ------
        Stamped
            Stamps rise strictly.
        """
        waiting: deque[tuple[int | None, Item]] = deque()
        for one in timed:
            waiting.append(one)
            if len(waiting) > _AHEAD:
                yield self._next(waiting)
        while waiting:
            yield self._next(waiting)

    def _next(self, waiting: deque[tuple[int | None, Item]]) -> Stamped[Item]:
        place = self._place(waiting)
        time_ns, item = waiting[place]
        del waiting[place]
        if self.last_ns is None:
            stamp_ns = self._first_stamp(time_ns, waiting)
        else:
            stamp_ns = self._stamp(time_ns, self._later(waiting))
        if self.last_ns is not None:
            self._steps.append(stamp_ns - self.last_ns)
        self.last_ns = stamp_ns
        return Stamped(stamp_ns, item)

    def _later(self, waiting: deque[tuple[int | None, Item]]) -> list[int]:
        return [one + self._shift_ns for one, _ in waiting if one is not None]

    def usual_ns(self) -> int:
        """The time between two pictures that is usual of late, [ns]."""
        if not self._steps:
            return self.step_ns
        return sorted(self._steps)[len(self._steps) // 2]

    def _place(self, waiting: deque[tuple[int | None, Item]]) -> int:
        """Which of those that wait is next: the first, unless others belong before it."""
        first = waiting[0][0]
        if first is None or len(waiting) < 2:
            return 0
        if self.last_ns is None:
            return self._place_of_first(first, waiting)
        lower, upper = self.last_ns - self._shift_ns, first
        before = [
            place
            for place, (time, _) in enumerate(waiting)
            if time is not None and lower < time < upper
        ]
        # Were it wrong, most of the others would lie before it.
        if not before or self._is_far(first + self._shift_ns, waiting, len(before)):
            return 0
        self.repairs.reordered += 1
        return min(before, key=lambda place: waiting[place][0] or 0)

    def _place_of_first(self, first: int, waiting: deque[tuple[int | None, Item]]) -> int:
        """Which is the first of all, where nothing before them tells whose time is wrong."""
        times = [time for time, _ in waiting if time is not None]
        # A clock that was set back shows times once more, or lies far behind.
        again = len(set(times)) < len(times)
        if again or not 0 < first - min(times) <= _JUMP * self.usual_ns():
            return 0
        self.repairs.reordered += 1
        return min(range(len(waiting)), key=lambda place: _or_later(waiting[place][0], first))

    def _is_far(self, time_ns: int, waiting: deque[tuple[int | None, Item]], before: int) -> bool:
        assert self.last_ns is not None
        jump = time_ns - self.last_ns > _JUMP * self.usual_ns()
        return jump and 2 * before >= len(waiting) - 1

    def _first_stamp(self, time_ns: int | None, waiting: deque[tuple[int | None, Item]]) -> int:
        """Without a time of its own, so many steps before those that have one."""
        if time_ns is not None:
            return time_ns
        self.repairs.missing += 1
        known = [(time, place) for place, (time, _) in enumerate(waiting) if time is not None]
        if not known:
            return 0
        first, place = known[0]
        near = (time for time, _ in known if time >= first - _JUMP * self.usual_ns())
        return min(near) - (place + 1) * self.usual_ns()

    def _stamp(self, time_ns: int | None, later: list[int]) -> int:
        assert self.last_ns is not None
        usual = self.usual_ns()
        if time_ns is None:
            self.repairs.missing += 1
            return self._between(later, usual)
        time_ns += self._shift_ns
        ahead = [one for one in later if one > self.last_ns]
        if time_ns > self.last_ns:
            wrong = [one for one in ahead if one < time_ns]
            if not wrong:
                return time_ns
        elif len(ahead) * 2 < len(later):
            self.repairs.set_back += 1
            self._shift_ns += self.last_ns + usual - time_ns
            return self.last_ns + usual
        self.repairs.replaced += 1
        return self._between(later, usual)

    def _between(self, later: list[int], usual: int) -> int:
        """A stamp behind the last one and before the next."""
        assert self.last_ns is not None
        following = min((one for one in later if one > self.last_ns), default=None)
        if following is None:
            return self.last_ns + usual
        return self.last_ns + max(1, min(usual, (following - self.last_ns) // 2))


def _or_later(time_ns: int | None, other_ns: int) -> int:
    return other_ns if time_ns is None else time_ns
