"""Cholesky solver of the small covariances of `haff_likelihood`, compiled.

Tested by ``test/inference/decay/test_haff_likelihood.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray


@compiled
def whiten(
    covariance: NDArray[np.float64], white: NDArray[np.float64], columns: NDArray[np.float64]
) -> float:
    """Whiten columns with the Cholesky factor of a covariance, in place; its log determinant.

    Matrices this small gain nothing from a threaded BLAS: on a busy machine its threads wait for
    each other, so that a fit took seconds, and their order may change the last digit.

    Parameters
    ----------
    covariance : ndarray (n, n)
        The part on and above the diagonal is used; the factor is left there.
    white : ndarray (n,)
        Added to the diagonal.
    columns : ndarray (k, n)
        Each row is replaced by its solution.
    """
    n = covariance.shape[0]
    # A flat array with unsigned indices lets the compiler vectorise the loop.
    flat = covariance.reshape(-1)
    log_determinant = 0.0
    for j in range(n):
        row = np.uint64(j * n)
        pivot = math.sqrt(covariance[j, j] + white[j])
        log_determinant += 2.0 * math.log(pivot)
        covariance[j, j] = pivot
        for i in range(j + 1, n):
            flat[row + np.uint64(i)] /= pivot
        for k in range(j + 1, n):
            factor, other = flat[row + np.uint64(k)], np.uint64(k * n)
            for i in range(k, n):
                flat[other + np.uint64(i)] -= flat[row + np.uint64(i)] * factor
        for c in range(columns.shape[0]):
            columns[c, j] /= pivot
            factor = columns[c, j]
            for i in range(j + 1, n):
                columns[c, i] -= flat[row + np.uint64(i)] * factor
    return log_determinant


@compiled
def inverse_with_columns(
    factor: NDArray[np.float64], columns: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Solutions of covariance x = columns, and the inverse of the covariance.

    Parameters
    ----------
    factor : ndarray (n, n)
        Cholesky factor, as `whiten` leaves it.
    columns : ndarray (3, n)

    Returns
    -------
    ndarray (n, 3 + n)
        The three solutions, then the inverse.
    """
    n = factor.shape[0]
    width = 3 + n
    solution = np.zeros((n, width))
    flat = solution.reshape(-1)
    for j in range(n):
        solution[j, 3 + j] = 1.0
        for c in range(3):
            solution[j, c] = columns[c, j]
    for j in range(n):
        _eliminate_row(flat, factor, width, j, range(j), True)
    for j in range(n - 1, -1, -1):
        _eliminate_row(flat, factor, width, j, range(j + 1, n), False)
    return solution


@compiled
def _eliminate_row(
    flat: NDArray[np.float64],
    factor: NDArray[np.float64],
    width: int,
    j: int,
    solved_rows: range,
    forward: bool,
) -> None:
    """Row j of a solution, from `solved_rows`."""
    row = np.uint64(j * width)
    for k in solved_rows:
        multiplier, other = factor[k, j] if forward else factor[j, k], np.uint64(k * width)
        for i in range(width):
            flat[row + np.uint64(i)] -= multiplier * flat[other + np.uint64(i)]
    pivot = factor[j, j]
    for i in range(width):
        flat[row + np.uint64(i)] /= pivot
