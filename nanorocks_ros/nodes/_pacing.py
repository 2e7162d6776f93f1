"""Gives out recorded or simulated moments at the pace of their stamps."""

from __future__ import annotations

import time

from nanorocks_ros.nodes._takers import Takers

# How soon to look again at the soonest, and at the latest: somebody may resume meanwhile.
_SOON_S = 0.002
_LATEST_S = 0.02
# Then others have their turn: services, timers.
_SLICE_S = 0.005
# Until those who are known know their publishers as well: the first frames were lost otherwise.
_SETTLE_S = 1.0
NS = 1_000_000_000


class Pacer:
    """Calls `emit` with each moment when its time has come.

    Late moments are made up for one by one; none is left out.

    Parameters
    ----------
    node : NanorocksNode
    moments : iterator of (int, object)
        Stamp [ns] and what to emit, in order.
    emit : callable
    pacing : PacingSettings
    finished : callable
        Called once after the last moment.
    paused : bool
        Wait for `resume`.

    Attributes
    ----------
    takers : Takers
        Who is waited for.
    paused : bool
    rate : float
    """

    def __init__(self, node, moments, emit, pacing, finished, paused=False):
        self._moments = moments
        self._emit = emit
        self._pacing = pacing
        self._finished = finished
        self._next = next(moments, None)
        self._first_ns = self._next[0] if self._next is not None else 0
        self._position_ns = self._first_ns
        self._since = None
        self._started = False
        self._complete = None
        self.rate = pacing.rate
        self.paused = paused
        self.takers = Takers(node)
        self.set_rate(pacing.rate)
        self._timer = node.create_timer(_SOON_S, self._tick, clock=node.steady_clock)

    @property
    def now_ns(self):
        """What time it is in the recording."""
        if self._since is None or self.rate == 0.0:
            return self._position_ns
        passed_ns = round((time.monotonic() - self._since) * self.rate * NS)
        ahead_ns = self._next[0] if self._next is not None else self._position_ns
        return max(self._position_ns, min(self._position_ns + passed_ns, ahead_ns))

    def pause(self):
        """Hold the time of the recording."""
        self._anchor(self.now_ns)
        self.paused = True

    def resume(self):
        """Go on."""
        self.paused = False
        self._anchor(self.now_ns)

    def set_rate(self, rate):
        """Go on at another rate."""
        position_ns = self.now_ns
        self.rate = rate
        self._anchor(position_ns)
        if rate == 0.0:
            self.takers.listen()

    def restart(self, moments, position_ns):
        """Go on elsewhere.

        Parameters
        ----------
        moments : iterator of (int, object)
        position_ns : int, [ns]
            What time it is there.
        """
        self._moments = moments
        self._next = next(moments, None)
        self._anchor(position_ns)

    def step(self, last):
        """Emit moments up to the first for which `last` holds; whether there was any."""
        while self._next is not None:
            moment = self._next[1]
            self._advance()
            if last(moment):
                return True
        return False

    def _anchor(self, position_ns):
        self._position_ns = position_ns
        self._since = time.monotonic() if self._started and not self.paused else None

    def _tick(self):
        if not self._started:
            if self.paused or not self._all_listen():
                self._look_again_in(_LATEST_S)
                return
            self._started = True
            self._anchor(self._position_ns)
        end = time.monotonic() + _SLICE_S
        while self._is_due():
            self._advance()
            if time.monotonic() >= end:
                break
        if self._next is None and not self.paused:
            self._timer.cancel()
            self._finished()
        else:
            self._look_again_in(self._wait_s())

    def _look_again_in(self, seconds):
        # Each turn of the executor costs as much as reading a frame: there are no idle ones.
        self._timer.timer_period_ns = round(seconds * NS)
        self._timer.reset()

    def _wait_s(self):
        """Until the next moment is due, or something else may have to be done."""
        if self._next is None or self.paused:
            return _LATEST_S
        if self.rate == 0.0:
            return _SOON_S
        return min(max(self._due() - time.monotonic(), _SOON_S), _LATEST_S)

    def _all_listen(self):
        wanted = self._pacing.listeners
        if self.takers.count() < wanted:
            self._complete = None
            return False
        now = time.monotonic()
        self._complete = now if self._complete is None else self._complete
        return now - self._complete >= (_SETTLE_S if wanted else 0.0)

    def _is_due(self):
        if self._next is None or self.paused:
            return False
        stamp_ns = self._next[0]
        if 0.0 < self._pacing.duration <= (stamp_ns - self._first_ns) / NS:
            self._next = None
            return False
        if self.rate == 0.0:
            return self.takers.ready()
        return stamp_ns < self._position_ns or time.monotonic() >= self._due()

    def _due(self):
        return self._since + (self._next[0] - self._position_ns) / NS / self.rate

    def _advance(self):
        stamp_ns, moment = self._next
        self._emit(stamp_ns, moment)
        self._next = next(self._moments, None)
        back = stamp_ns < self._position_ns
        if back or self.rate == 0.0 or self._since is None:
            self._anchor(stamp_ns)
