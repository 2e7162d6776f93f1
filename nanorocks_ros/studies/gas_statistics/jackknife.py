"""Errors of functions of sums over blocks, by leaving out one block after the other.

Tested by ``test/studies/gas_statistics/test_velocity_distribution.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

_LEAST_BLOCKS = 2


def block_sums(
    values: NDArray[np.float64], block: NDArray[np.int64], n_blocks: int
) -> NDArray[np.float64]:
    """Sums of the rows of each block, (n_blocks, ...).

    Parameters
    ----------
    values : ndarray (m, ...)
    block : ndarray of int, (m,), >= 0
    n_blocks : int
    """
    sums = np.zeros((n_blocks, *values.shape[1:]))
    np.add.at(sums, block, values)
    return sums


def jackknife(
    sums: NDArray[np.float64],
    function: Callable[[NDArray[np.float64]], NDArray[np.float64] | float],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A function of sums over all blocks, less its bias to first order, and its standard error.

    Parameters
    ----------
    sums : ndarray (n_blocks, n)
        Of each block; blocks without any are left out.
    function : callable
        From the sum over blocks to a number or an array.

    Returns
    -------
    value, error : ndarray
        The error is NaN with a single block.
    """
    used = sums[np.any(sums != 0.0, axis=1)]
    total = used.sum(axis=0)
    value = np.asarray(function(total), dtype=np.float64)
    n = len(used)
    if n < _LEAST_BLOCKS:
        return value, np.full(value.shape, math.nan)
    without = np.array([function(total - block) for block in used])
    error = np.sqrt((n - 1.0) * without.var(axis=0))
    return n * value - (n - 1.0) * without.mean(axis=0), error
