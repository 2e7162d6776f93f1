"""Median of many numbers by counting in buckets, without unpredictable branches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Below this size a partition is as fast.
_MANY = 100
# Bits of a number that the bucket ignores: 32 buckets per factor of two.
_SHIFT = 47
# Numbers below the largest by 2^32 share the first bucket.
_BUCKETS = 1024
_INFINITE = 0x7FF << 52


@compiled
def median_of(values: NDArray[np.float64]) -> float:
    """The median of numbers that are not negative, at least one, (n,), contiguous.

    Equal to `numpy.median`. The bits of positive numbers, as integers, have the same order.
    """
    n = values.size
    bits = values.view(np.int64)
    smallest, largest = bits[0], bits[0]
    for k in range(n):
        smallest, largest = min(smallest, bits[k]), max(largest, bits[k])
    if n < _MANY or smallest < 0 or largest >= _INFINITE:
        return float(np.median(values))
    counts = np.zeros(_BUCKETS, dtype=np.int32)
    lowest = (largest >> _SHIFT) - (_BUCKETS - 1)
    for k in range(n):
        counts[max((bits[k] >> _SHIFT) - lowest, 0)] += 1
    # Ranks of the middle number, or of the two middle ones.
    low_rank, high_rank = (n - 1) // 2, n // 2
    first, below = 0, 0
    while below + counts[first] <= low_rank:
        below += counts[first]
        first += 1
    last, up_to = first, below + counts[first]
    while up_to <= high_rank:
        last += 1
        up_to += counts[last]
    near = np.empty(up_to - below)
    m = 0
    for k in range(n):
        if first <= max((bits[k] >> _SHIFT) - lowest, 0) <= last:
            near[m] = values[k]
            m += 1
    near.sort()
    return float((near[low_rank - below] + near[high_rank - below]) / 2)
