"""Cholesky factors and equations of small symmetric matrices, compiled.

For a few rows the overhead of a LAPACK call exceeds the work.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined, kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Beyond these limits a product could overflow or underflow.
_LEAST, _MOST = 1e-150, 1e150
# Largest shift of a nuisance, in standard deviations.
_FARTHEST = 4.0


@kernel
def factorise(matrix: NDArray[np.float64]) -> float:
    """Cholesky factor in the lower half, in place, with inverse diagonal; ln of the determinant.

    Two elements of a row are computed at a time: the sum of one alone would wait for each term.
    """
    log_determinant, product = 0.0, 1.0
    for i in range(matrix.shape[0]):
        row = matrix[i]
        for j in range(0, i - 1, 2):
            upper, lower = matrix[j], matrix[j + 1]
            a, b = row[j], row[j + 1]
            for k in range(j):
                a -= row[k] * upper[k]
                b -= row[k] * lower[k]
            a *= upper[j]
            row[j], row[j + 1] = a, (b - a * lower[j]) * lower[j + 1]
        if i % 2 == 1:
            upper, a = matrix[i - 1], row[i - 1]
            for k in range(i - 1):
                a -= row[k] * upper[k]
            row[i - 1] = a * upper[i - 1]
        rest = row[i]
        for k in range(i):
            rest -= row[k] * row[k]
        product *= rest
        if not _LEAST < product < _MOST:
            log_determinant, product = log_determinant + math.log(product), 1.0
        row[i] = 1.0 / math.sqrt(rest)
    return log_determinant + math.log(product)


@kernel
def whiten(factor: NDArray[np.float64], columns: NDArray[np.float64], count: int) -> None:
    """Solve with a factor of `factorise` for the first columns, in place; two at a time."""
    for first in range(0, count, 2):
        # An odd last column is paired with itself.
        column, next_column = columns[first], columns[min(first + 1, count - 1)]
        for i in range(factor.shape[0]):
            row = factor[i]
            a, b = column[i], next_column[i]
            for k in range(i):
                a -= row[k] * column[k]
                b -= row[k] * next_column[k]
            column[i], next_column[i] = a * row[i], b * row[i]


@inlined
def eliminate(matrix: NDArray[np.float64], solution: NDArray[np.float64]) -> None:
    """Replace the right side of equations by their solution, within a kernel.

    Parameters
    ----------
    matrix : ndarray (n, n)
        Symmetric and positive definite: no row is exchanged. Overwritten.
    solution : ndarray (n,)
    """
    count = len(solution)
    for k in range(count):
        for i in range(k + 1, count):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k, count):
                matrix[i, j] -= factor * matrix[k, j]
            solution[i] -= factor * solution[k]
    for k in range(count - 1, -1, -1):
        for i in range(k + 1, count):
            solution[k] -= matrix[k, i] * solution[i]
        solution[k] /= matrix[k, k]


@compiled
def integrate(
    gradients: NDArray[np.float64],
    informations: NDArray[np.float64],
    gains: NDArray[np.float64],
) -> None:
    """Gain of the log likelihood by the integration over nuisances with unit Gaussian priors.

    Parameters
    ----------
    gradients, informations : ndarray (n_places, n_z), (n_places, n_z, n_z)
    gains : ndarray (n_places,)
        Filled in.
    """
    n = gradients.shape[1]
    # The information and the prior, as L D L^T: pivots, and L below the diagonal.
    lower, pivots = np.empty((n, n)), np.empty(n)
    shift = np.empty(n)
    for place in range(gradients.shape[0]):
        log_determinant = 0.0
        for i in range(n):
            shift[i] = gradients[place, i]
            for j in range(i + 1):
                total = informations[place, i, j]
                for k in range(j):
                    total -= lower[i, k] * lower[j, k] * pivots[k]
                if i == j:
                    pivots[i] = 1.0 + total
                    log_determinant += math.log(abs(pivots[i]))
                else:
                    lower[i, j] = total / pivots[j]
                    shift[i] -= lower[i, j] * shift[j]
        farthest, product = 0.0, 0.0
        for i in range(n - 1, -1, -1):
            shift[i] /= pivots[i]
            for k in range(i + 1, n):
                shift[i] -= lower[k, i] * shift[k]
            farthest = max(farthest, abs(shift[i]))
            product += gradients[place, i] * shift[i]
        # Beyond that the dependence is not linear: the shift is limited.
        share = min(1.0, _FARTHEST / max(farthest, _FARTHEST))
        gains[place] = (share - 0.5 * share**2) * product - 0.5 * log_determinant
