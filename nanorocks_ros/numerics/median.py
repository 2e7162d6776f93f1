"""Median of many numbers by counting in buckets, without unpredictable branches; quantiles."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.stable_sort import stable_argsort

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Below this size a sort is as fast.
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
        order = stable_argsort(values)
        return float((values[order[(n - 1) // 2]] + values[order[n // 2]]) / 2)
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
    order = stable_argsort(near)
    return float((near[order[low_rank - below]] + near[order[high_rank - below]]) / 2)


@compiled
def quantile_of(values: NDArray[np.float64], share: float) -> float:
    """The quantile of numbers, at least one, (n,), between the two nearest; NaN where one is.

    As `numpy.quantile`, but for rounding, for a share below 1.
    """
    order = stable_argsort(values)
    if math.isnan(values[order[-1]]):
        return math.nan
    rank = 1 + (values.size - 1) * share
    below = math.floor(rank)
    rest = rank - below
    if below == values.size:
        return float(values[order[-1]])
    return float(values[order[below - 1]] * (1 - rest) + values[order[below]] * rest)
