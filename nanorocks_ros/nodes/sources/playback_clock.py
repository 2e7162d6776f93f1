"""The time of a recording while it is played: paused, faster, slower, back."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from collections.abc import Callable


class PlaybackClock:
    """The time of a recording, which runs at a rate, but never past the next moment.

    It is paused at first.

    Parameters
    ----------
    rate : float
        Seconds of recording per second; 0: time moves with the moments only.
    clock : callable
        Seconds on a clock that never goes back.

    Attributes
    ----------
    next_ns : int or None, [ns]
        Stamp of the next moment; None: there is none.
    """

    def __init__(self, rate: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._rate = rate
        # Time counts from this position since this second of the clock; None while paused.
        self._position_ns = 0
        self._since: float | None = None
        # Of the last moment. The position is older, so it does not show that stamps went back.
        self._last_ns = 0
        self.next_ns: int | None = None

    @property
    def now_ns(self) -> int:
        """The time of the recording, [ns]."""
        if self._since is None or self._rate == 0.0:
            return self._position_ns
        passed_ns = round((self._clock() - self._since) * self._rate * NS)
        ahead_ns = self._last_ns if self.next_ns is None else max(self.next_ns, self._last_ns)
        return max(self._position_ns, min(self._position_ns + passed_ns, ahead_ns))

    def seek(self, position_ns: int) -> None:
        """Go to another time; paused or running as before."""
        self._last_ns = position_ns
        self._count_from(position_ns, paused=self._since is None)

    def pause(self) -> None:
        """Stop."""
        self._count_from(self.now_ns, paused=True)

    def resume(self) -> None:
        """Run on from where time stopped."""
        self._count_from(self.now_ns, paused=False)

    def set_rate(self, rate: float) -> None:
        """Run on at another rate."""
        position_ns = self.now_ns
        self._rate = rate
        self._count_from(position_ns, paused=self._since is None)

    def seconds_until_next(self) -> float:
        """How long until the next moment is due, [s].

        Raises
        ------
        RuntimeError
            When the clock is paused, or there is no next moment.
        """
        return max(self._until_next(), 0.0)

    def seconds_late(self) -> float:
        """How long the next moment has been due, [s]; 0 while paused and at the end."""
        if self.next_ns is None or self._since is None or self._rate == 0.0:
            return 0.0
        return max(-self._until_next(), 0.0)

    def _until_next(self) -> float:
        """Time to the next moment, [s]; negative when it is late."""
        if self.next_ns is None or self._since is None:
            raise RuntimeError('no moment is due while the clock is paused or at the end')
        if self.next_ns < self._last_ns:
            return 0.0
        due = self._since + (self.next_ns - self._position_ns) / NS / self._rate
        return due - self._clock()

    def advance(self, stamp_ns: int) -> None:
        """Note the moment that is played now."""
        went_back = stamp_ns < self._last_ns
        self._last_ns = stamp_ns
        paused = self._since is None
        if went_back or paused or self._rate == 0.0:
            self._count_from(stamp_ns, paused=paused)

    def _count_from(self, position_ns: int, *, paused: bool) -> None:
        self._position_ns = position_ns
        self._since = None if paused else self._clock()
