"""Frames that are missing between two that came.

A subscription that is full drops the oldest message and tells nobody, neither does a link that
loses one; the stamps of a camera with a steady rate show it.
"""

from __future__ import annotations

from collections import deque
from statistics import median

# Intervals that the rate is known from, at least and at most.
_FEWEST, _MOST = 15, 60
# A camera is steady when so many of its intervals differ from their median by less than that.
_STEADY, _DIFFERENCE = 0.7, 0.2
# An interval has a gap in it when it is so many times the median.
_GAP = 1.6
# Nothing comes for longer when a camera pauses or a player seeks: no frame is missing then, [ns].
_PAUSE_NS = 5_000_000_000


class Gaps:
    """Counts missing frames by the stamps of those that came.

    Attributes
    ----------
    missing : int
        Since the first frame; 0 for a camera without a steady rate.
    """

    def __init__(self):
        self.missing = 0
        self._last_ns = None
        self._intervals = deque(maxlen=_MOST)
        self._in_turn = 0

    def push(self, stamp_ns):
        """Note a frame; how many were missing right before it."""
        last_ns, self._last_ns = self._last_ns, stamp_ns
        if last_ns is None or stamp_ns <= last_ns:
            return 0
        interval = stamp_ns - last_ns
        if interval > _PAUSE_NS:
            return 0
        usual = self._usual()
        if usual is None or interval < _GAP * usual:
            self._in_turn = 0
            self._intervals.append(interval)
            return 0
        self._in_turn += 1
        if self._in_turn > _MOST:
            # Not a single one as before: the camera has another rate now.
            self._in_turn = 0
            self._intervals.clear()
        missing = round(interval / usual) - 1
        self.missing += missing
        return missing

    def _usual(self):
        """The interval between two frames, [ns]; None where there is none."""
        if len(self._intervals) < _FEWEST:
            return None
        middle = median(self._intervals)
        near = sum(abs(interval - middle) < _DIFFERENCE * middle for interval in self._intervals)
        return middle if near >= _STEADY * len(self._intervals) else None
