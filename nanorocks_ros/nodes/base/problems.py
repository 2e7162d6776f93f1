"""Problems that last: how serious, and since when; a problem that is over is told no longer.

Tested by ``test/nodes/base/test_problems.py``.
"""

from __future__ import annotations

import math
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
    """A problem that a node has now.

    Parameters
    ----------
    level : Level
    text : str
    alarm : str
        What the live page calls it in its alarms, such as `CAMERA_SILENT`; empty: no alarm.
    """

    level: Level
    text: str
    alarm: str = ''


CAMERA_SILENT, NO_PUBLISHER = 'camera silent', 'no publisher'
FRAMES_LOST, DISK_LOW, RECORDING_STOPPED = 'frames lost', 'disk low', 'recording stopped'

# Refused messages are an error while they come, and a warning for some time after, [s].
_STILL_COMES_S, _REMEMBERED_S = 2.0, 30.0
# Silence of a camera that has a publisher, [s], or so many intervals between its frames.
_SILENT_S = {Level.WARN: 2.0, Level.ERROR: 10.0}
_SILENT_INTERVALS = 3.0
# Rates are of this time, [s].
_RATE_S = 10.0
# A disk is low by the space on it, [bytes], or by the time until it is full, [s].
_LEAST_FREE = {Level.ERROR: 100_000_000, Level.WARN: 1_000_000_000}
_LEAST_LEFT_S = {Level.ERROR: 60.0, Level.WARN: 600.0}
# How fast the disk fills is of at least this time, [s].
_FILLING_S = 30.0


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
                    CAMERA_SILENT,
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


class DiskSpace:
    """Space on the disk of a recording.

    Parameters
    ----------
    where : str
        The recording.
    clock : callable
        Seconds on a clock that never goes back.
    """

    def __init__(self, where: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._where, self._clock = where, clock
        self._seen: deque[tuple[float, int]] = deque()

    def problem(self, free: int) -> Problem | None:
        """A warning below 1 GB or 10 minutes, an error below 0.1 GB or one minute.

        Parameters
        ----------
        free : int, [bytes]
            Now.
        """
        left_s = self._seconds_left(free)
        for level in (Level.ERROR, Level.WARN):
            if free < _LEAST_FREE[level] or left_s < _LEAST_LEFT_S[level]:
                filled = f', full in {left_s:.0f} s at this rate' if math.isfinite(left_s) else ''
                return Problem(
                    level,
                    f'{self._where}: {free / 1e9:.1f} GB left on the disk{filled}; make room, or '
                    'record elsewhere',
                    DISK_LOW,
                )
        return None

    def _seconds_left(self, free: int) -> float:
        """Time until the disk is full, as it filled lately, [s]; infinite where it does not."""
        now = self._clock()
        self._seen.append((now, free))
        while len(self._seen) > 2 and now - self._seen[1][0] >= _FILLING_S:
            self._seen.popleft()
        since, before = self._seen[0]
        if now - since < _FILLING_S or before <= free:
            return math.inf
        return free * (now - since) / (before - free)
