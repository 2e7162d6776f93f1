"""Gives out recorded or simulated moments at the pace of their stamps."""

from __future__ import annotations

import time

from nanorocks_ros.nodes._pace import NS, Pace
from nanorocks_ros.nodes._takers import Takers

# How soon to look again at the soonest, and at the latest: somebody may resume meanwhile.
_SOON_S = 0.002
_LATEST_S = 0.02
# Then others have their turn: services, timers.
_SLICE_S = 0.005
# Until those who are known know their publishers as well: the first frames were lost otherwise.
_SETTLE_S = 1.0


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
        self._started = False
        self._complete = None
        self._pace = Pace(pacing.rate)
        self._look_ahead()
        self._first_ns = self._next[0] if self._next is not None else 0
        self._pace.go_to(self._first_ns)
        self.paused = paused
        self.takers = Takers(node)
        self.set_rate(pacing.rate)
        self._timer = node.create_timer(_SOON_S, self._tick, clock=node.steady_clock)

    @property
    def now_ns(self):
        """What time it is in the recording."""
        return self._pace.now_ns

    def pause(self):
        """Hold the time of the recording."""
        self.paused = True
        self._pace.hold()

    def resume(self):
        """Go on."""
        self.paused = False
        if self._started:
            self._pace.run()

    def set_rate(self, rate):
        """Go on at another rate."""
        self.rate = rate
        self._pace.set_rate(rate)
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
        self._look_ahead()
        self._pace.go_to(position_ns)

    def step(self, last):
        """Emit moments up to the first for which `last` holds; whether there was any."""
        while self._next is not None:
            moment = self._next[1]
            self._advance()
            if last(moment):
                return True
        return False

    def _look_ahead(self):
        self._next = next(self._moments, None)
        self._pace.next_ns = None if self._next is None else self._next[0]

    def _tick(self):
        if not self._started:
            if self.paused or not self._all_listen():
                self._look_again_in(_LATEST_S)
                return
            self._started = True
            self._pace.run()
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
        return min(max(self._pace.wait_s(), _SOON_S), _LATEST_S)

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
        if 0.0 < self._pacing.duration <= (self._next[0] - self._first_ns) / NS:
            self._next = None
            return False
        if self.rate == 0.0:
            return self.takers.ready()
        return self._pace.wait_s() == 0.0

    def _advance(self):
        stamp_ns, moment = self._next
        self._emit(stamp_ns, moment)
        self._pace.reached(stamp_ns)
        self._look_ahead()
