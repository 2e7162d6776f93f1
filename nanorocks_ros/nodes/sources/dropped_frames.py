"""Frames that were dropped between two that arrived.

A full subscription drops the oldest message without notice, and so does a link that loses one.
The stamps of a camera with a steady rate show it.
"""

from __future__ import annotations

from collections import deque
from statistics import median

# Intervals that the frame rate is computed from.
_MIN_INTERVALS, _MAX_INTERVALS = 15, 60
# The rate is steady when this share of the intervals differs from the median by less than that.
_STEADY_SHARE, _TOLERANCE = 0.7, 0.2
# Frames are missing in an interval of so many times the median.
_GAP = 1.6
# Longer intervals occur when a camera pauses or a player seeks: no frame is missing, [ns].
_PAUSE_NS = 5_000_000_000


class DroppedFrames:
    """Counts dropped frames by the stamps of those that arrived.

    Attributes
    ----------
    count : int
        Since the first frame; 0 for a camera without a steady rate.
    """

    def __init__(self) -> None:
        self.count = 0
        self._last_ns: int | None = None
        self._intervals: deque[int] = deque(maxlen=_MAX_INTERVALS)
        self._gaps_in_a_row = 0

    def push(self, stamp_ns: int) -> int:
        """Note a frame; how many frames are missing right before it."""
        last_ns, self._last_ns = self._last_ns, stamp_ns
        if last_ns is None or stamp_ns <= last_ns:
            return 0
        interval = stamp_ns - last_ns
        if interval > _PAUSE_NS:
            return 0
        usual = self._usual_interval()
        if usual is None or interval < _GAP * usual:
            self._gaps_in_a_row = 0
            self._intervals.append(interval)
            return 0
        self._gaps_in_a_row += 1
        if self._gaps_in_a_row > _MAX_INTERVALS:
            # No interval as before: the camera has another rate now.
            self._gaps_in_a_row = 0
            self._intervals.clear()
        missing = round(interval / usual) - 1
        self.count += missing
        return missing

    def _usual_interval(self) -> float | None:
        """The interval between two frames, [ns]; None without a steady rate."""
        if len(self._intervals) < _MIN_INTERVALS:
            return None
        middle = median(self._intervals)
        near = sum(abs(interval - middle) < _TOLERANCE * middle for interval in self._intervals)
        return middle if near >= _STEADY_SHARE * len(self._intervals) else None
