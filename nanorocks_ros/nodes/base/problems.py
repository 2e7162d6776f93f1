"""Problems that last: how serious, and since when; a problem that is over is told no longer.

Tested by ``test/nodes/base/test_problems.py``.
"""

from __future__ import annotations

import time
from collections import deque
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable


class Level(IntEnum):
    """How serious a problem is; the values are those of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


class Problem(NamedTuple):
    """A problem that a node has now."""

    level: Level
    text: str


# Refused messages are an error while they come, and a warning for some time after, [s].
_STILL_COMES_S, _REMEMBERED_S = 2.0, 30.0
# Silence of a camera that has a publisher, [s], or so many intervals between its frames.
_SILENT_S = {Level.WARN: 2.0, Level.ERROR: 10.0}
_SILENT_INTERVALS = 3.0
# Rates are of this time, [s].
_RATE_S = 10.0


class Refusals:
    """Messages that were refused.

    Parameters
    ----------
    clock : callable
        Seconds on a clock that never goes back.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._last: tuple[float, str] | None = None
        self._count = 0

    def add(self, text: str) -> None:
        """Note a refused message."""
        self._last = self._clock(), text
        self._count += 1

    def problem(self) -> Problem | None:
        """An error while messages are refused, a warning shortly after."""
        if self._last is None:
            return None
        at, text = self._last
        age = self._clock() - at
        if age <= _STILL_COMES_S:
            return Problem(Level.ERROR, text)
        if age <= _REMEMBERED_S:
            return Problem(
                Level.WARN, f'{self._count} messages refused so far, none for {age:.0f} s: {text}'
            )
        return None


class Silence:
    """Time since the last message of a topic that has a publisher.

    Parameters
    ----------
    topic : str
    clock : callable
        Seconds on a clock that never goes back.
    """

    def __init__(self, topic: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._topic, self._clock = topic, clock
        self._since: float | None = None
        self._interval = 0.0
        self._heard = False

    def hear(self) -> None:
        """Note a message."""
        now = self._clock()
        if self._heard and self._since is not None:
            self._interval = now - self._since
        self._since, self._heard = now, True

    def problem(self, publishers: int) -> Problem | None:
        """A warning after 2 s, an error after 10 s, later for a camera that is slower.

        Parameters
        ----------
        publishers : int
            Of the topic, now.
        """
        if publishers == 0:
            # Another problem, told by another; the next publisher has its own time.
            self._since, self._heard = None, False
            return None
        if self._since is None:
            self._since = self._clock()
        silent = self._clock() - self._since
        slow = min(self._interval, _SILENT_S[Level.ERROR]) * _SILENT_INTERVALS
        for level in (Level.ERROR, Level.WARN):
            if silent > max(_SILENT_S[level], slow):
                return Problem(
                    level,
                    f'{self._topic}: no frame for {silent:.0f} s although it has a publisher; is '
                    'the camera stopped, the player paused, or its quality of service another?',
                )
        return None


class Losses:
    """Things that are lost, as a rate.

    Parameters
    ----------
    clock : callable
        Seconds on a clock that never goes back.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._recent: deque[tuple[float, int]] = deque()

    def add(self, count: int) -> None:
        """Note losses."""
        if count:
            self._recent.append((self._clock(), count))

    def rate(self) -> float:
        """Losses per second in the last 10 s, [1/s]."""
        now = self._clock()
        while self._recent and now - self._recent[0][0] > _RATE_S:
            self._recent.popleft()
        return sum(count for _, count in self._recent) / _RATE_S
