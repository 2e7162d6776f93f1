"""What time it is in a recording, and when its moments are due: held, faster, slower, back."""

from __future__ import annotations

import time

NS = 1_000_000_000


class Pace:
    """The time of a recording, which runs with a clock, but never past what is still to come.

    Parameters
    ----------
    rate : float
        Seconds of recording per second; 0: its time moves with its moments only.
    clock : callable
        Seconds on a clock that never goes back.

    Attributes
    ----------
    next_ns : int or None
        Stamp of the next moment; None: there is none.
    """

    def __init__(self, rate, clock=time.monotonic):
        self._clock = clock
        self._rate = rate
        # Time is counted from a position, and since when; it is held while that is not known.
        self._position_ns = 0
        self._since = None
        # Of the last moment: the position is older, so it does not show that stamps went back.
        self._last_ns = 0
        self.next_ns = None

    @property
    def now_ns(self):
        """What time it is in the recording."""
        if self._since is None or self._rate == 0.0:
            return self._position_ns
        passed_ns = round((self._clock() - self._since) * self._rate * NS)
        ahead_ns = self._last_ns if self.next_ns is None else max(self.next_ns, self._last_ns)
        return max(self._position_ns, min(self._position_ns + passed_ns, ahead_ns))

    def go_to(self, position_ns):
        """Be elsewhere, held or running as before."""
        self._last_ns = position_ns
        self._count_from(position_ns, held=self._since is None)

    def hold(self):
        """Stand still."""
        self._count_from(self.now_ns, held=True)

    def run(self):
        """Go on."""
        self._count_from(self.now_ns, held=False)

    def set_rate(self, rate):
        """Go on at another rate."""
        position_ns = self.now_ns
        self._rate = rate
        self._count_from(position_ns, held=self._since is None)

    def wait_s(self):
        """How long until the next moment is due; not held, and at a rate above 0."""
        if self.next_ns < self._last_ns:
            return 0.0
        due = self._since + (self.next_ns - self._position_ns) / NS / self._rate
        return max(due - self._clock(), 0.0)

    def reached(self, stamp_ns):
        """Note that a moment has come."""
        back = stamp_ns < self._last_ns
        self._last_ns = stamp_ns
        held = self._since is None
        if back or held or self._rate == 0.0:
            self._count_from(stamp_ns, held)

    def _count_from(self, position_ns, held):
        self._position_ns = position_ns
        self._since = None if held else self._clock()
