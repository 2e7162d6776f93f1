"""Emits recorded or simulated moments at the pace of their stamps."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from nanorocks_ros.nodes.base.problems import Level, Problem
from nanorocks_ros.nodes.sources.flow_control import FlowControl
from nanorocks_ros.nodes.sources.playback_clock import PlaybackClock
from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from nanorocks_ros.nodes.base.node import NanorocksNode
    from nanorocks_ros.settings import PacingSettings

# Shortest and longest period of the timer: somebody may resume meanwhile.
_MIN_PERIOD_S = 0.002
_MAX_PERIOD_S = 0.02
# Then other callbacks have their turn: services, timers.
_SLICE_S = 0.005
# A player that is later than this cannot keep up, [s]; it is logged again after, [s].
_LATE_S, _REPEAT_LATE_S = 1.0, 30.0
# Until discovery is complete on the side of the listeners, too: the first frames were lost
# otherwise.
_SETTLE_S = 1.0


class Player:
    """Calls `emit` with each moment when its time has come.

    Late moments are emitted one after the other without a pause; none is left out.

    Parameters
    ----------
    node : NanorocksNode
    moments : iterator of (int, object)
        Stamp [ns] and what to emit, in order.
    emit : callable
        Takes both.
    pacing : PacingSettings
    finished : callable
        Called once after the last moment.

    Attributes
    ----------
    flow_control : FlowControl
    paused : bool
    rate : float
        Seconds of recording per second; 0: as fast as the nodes process the frames.
    """

    def __init__(
        self,
        node: NanorocksNode,
        moments: Iterator[tuple[int, Any]],
        emit: Callable[[int, Any], None],
        pacing: PacingSettings,
        finished: Callable[[], None],
    ) -> None:
        self._moments, self._emit = moments, emit
        self._pacing, self._finished = pacing, finished
        self._started = False
        self._complete_since: float | None = None
        self._clock = PlaybackClock(pacing.rate)
        self._next: tuple[int, Any] | None = None
        self._look_ahead()
        self._first_ns = self._next[0] if self._next is not None else 0
        self._clock.seek(self._first_ns)
        self.paused = False
        self.flow_control = FlowControl(node)
        self.set_rate(pacing.rate)
        self._node = node
        node.diagnostics.watched.append(self._behind)
        self._timer = node.create_timer(_MIN_PERIOD_S, self._tick, clock=node.steady_clock)

    @property
    def now_ns(self) -> int:
        """The time of the recording, [ns]."""
        return self._clock.now_ns

    def pause(self) -> None:
        """Stop the time of the recording."""
        self.paused = True
        self._clock.pause()

    def resume(self) -> None:
        """Play on."""
        self.paused = False
        if self._started:
            self._clock.resume()

    def set_rate(self, rate: float) -> None:
        """Play on at another rate."""
        self.rate = rate
        self._clock.set_rate(rate)
        if rate == 0.0:
            self.flow_control.start()

    def seek(self, moments: Iterator[tuple[int, Any]], position_ns: int) -> None:
        """Play on from another position.

        Parameters
        ----------
        moments : iterator of (int, object)
            From there.
        position_ns : int, [ns]
        """
        self._moments = moments
        self._look_ahead()
        self._clock.seek(position_ns)

    def step(self, is_last: Callable[[Any], bool]) -> bool:
        """Emit moments up to the first for which `is_last` holds; whether there was one."""
        while self._next is not None:
            moment = self._next[1]
            self._emit_next(*self._next)
            if is_last(moment):
                return True
        return False

    def _behind(self) -> Problem | None:
        """A warning while the moments are emitted later and later."""
        late = self._clock.seconds_late()
        if late < _LATE_S:
            return None
        text = (
            f'{late:.0f} s behind the pace of rate:={self.rate:g}: this machine is too slow; set '
            'a lower rate, or rate:=0.0 to play as fast as the graph follows'
        )
        self._node.get_logger().warning(text, throttle_duration_sec=_REPEAT_LATE_S)
        return Problem(Level.WARN, text)

    def _look_ahead(self) -> None:
        self._next = next(self._moments, None)
        self._clock.next_ns = None if self._next is None else self._next[0]

    def _tick(self) -> None:
        if not self._started:
            if self.paused or not self._has_listeners():
                self._set_period(_MAX_PERIOD_S)
                return
            self._started = True
            self._clock.resume()
        self._emit_due()
        if self._next is None and not self.paused:
            self._timer.cancel()
            self._finished()
        else:
            self._set_period(self._wait_s())

    def _emit_due(self) -> None:
        end = time.monotonic() + _SLICE_S
        while self._next is not None and self._is_due(self._next[0]):
            self._emit_next(*self._next)
            if time.monotonic() >= end:
                break

    def _set_period(self, seconds: float) -> None:
        # Each call of the timer costs as much as reading a frame, so the period follows the
        # moments.
        self._timer.timer_period_ns = round(seconds * NS)
        self._timer.reset()

    def _wait_s(self) -> float:
        """Until the next moment is due, or something else may have to be done, [s]."""
        if self._next is None or self.paused:
            return _MAX_PERIOD_S
        if self.rate == 0.0:
            return _MIN_PERIOD_S
        return min(max(self._clock.seconds_until_next(), _MIN_PERIOD_S), _MAX_PERIOD_S)

    def _has_listeners(self) -> bool:
        """Whether as many nodes listen as the settings ask for, since 1 s."""
        wanted = self._pacing.listeners
        if self.flow_control.listener_count() < wanted:
            self._complete_since = None
            return False
        now = time.monotonic()
        self._complete_since = now if self._complete_since is None else self._complete_since
        return now - self._complete_since >= (_SETTLE_S if wanted else 0.0)

    def _is_due(self, stamp_ns: int) -> bool:
        if self.paused:
            return False
        if 0.0 < self._pacing.duration <= (stamp_ns - self._first_ns) / NS:
            self._next = None
            return False
        if self.rate == 0.0:
            return self.flow_control.is_ready()
        return self._clock.seconds_until_next() == 0.0

    def _emit_next(self, stamp_ns: int, moment: Any) -> None:
        self._emit(stamp_ns, moment)
        self._clock.advance(stamp_ns)
        self._look_ahead()
