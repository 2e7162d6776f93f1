"""Stable sort for compiled code, independent of the versions of libraries."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray


@compiled
def stable_argsort(values: NDArray[np.float64] | NDArray[np.integer]) -> NDArray[np.int64]:
    """Indices of the values from the smallest to the largest, and NaN; equals keep their order.

    Runs of 1, 2, 4, ... values are merged two by two. The sorts of numba take far longer to
    compile: they call themselves, and are made once more for each type.
    """
    n = values.size
    order = np.arange(n)
    merged = np.empty(n, dtype=np.int64)
    run = 1
    while run < n:
        for start in range(0, n, 2 * run):
            _merge(values, order, merged, start, run)
        order, merged = merged, order
        run *= 2
    return order


@compiled
def _merge(
    values: NDArray[np.float64] | NDArray[np.integer],
    order: NDArray[np.int64],
    merged: NDArray[np.int64],
    start: int,
    run: int,
) -> None:
    """Merge two neighbouring runs of an order, each of them rising."""
    middle = min(start + run, order.size)
    end = min(start + 2 * run, order.size)
    low, high = start, middle
    for k in range(start, end):
        if high == end or (
            low < middle and not _is_above(values[order[low]], values[order[high]])
        ):
            merged[k] = order[low]
            low += 1
        else:
            merged[k] = order[high]
            high += 1


@compiled
def _is_above(value: float, other: float) -> bool:
    """Whether a value is sorted behind another; NaN is behind all others."""
    return value > other or (math.isnan(value) and not math.isnan(other))
