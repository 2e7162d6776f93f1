"""Gives out recorded or simulated moments at the pace of their stamps."""

from __future__ import annotations

import time

from nanorocks_ros.wire import topics

_TICK_S = 0.002
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
    """

    def __init__(self, node, moments, emit, pacing, finished):
        self._node = node
        self._moments = moments
        self._emit = emit
        self._pacing = pacing
        self._finished = finished
        self._next = next(moments, None)
        self._origin = None
        self._timer = node.create_timer(_TICK_S, self._tick, clock=node.steady_clock)

    def _tick(self):
        if self._next is None:
            self._timer.cancel()
            self._finished()
            return
        if self._origin is None and self._listeners() < self._pacing.listeners:
            return
        stamp_ns, moment = self._next
        now = time.monotonic()
        if self._origin is None:
            self._origin = (stamp_ns, now)
        elapsed = (stamp_ns - self._origin[0]) / NS
        if 0.0 < self._pacing.duration <= elapsed:
            self._next = None
            return
        if self._pacing.rate > 0.0 and now < self._origin[1] + elapsed / self._pacing.rate:
            return
        self._emit(stamp_ns, moment)
        self._next = next(self._moments, None)
        if self._next is not None and self._next[0] < stamp_ns:
            self._origin = (self._next[0], now)

    def _listeners(self):
        return sum(
            self._node.output(topic).get_subscription_count()
            for topic in (topics.RAW, topics.RAW_COMPRESSED)
        )
