"""Triangular factors of small matrices, against those of LAPACK."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_triangular

from nanorocks_ros.numerics.compiled import kernel
from nanorocks_ros.numerics.small_cholesky import eliminate, factorise, whiten


@pytest.mark.parametrize('size', [1, 2, 3, 24, 25])
@pytest.mark.parametrize('scale', [1.0, 1e-12, 1e12])
def test_columns_are_whitened_by_the_cholesky_factor(size, scale):
    rng = np.random.default_rng(size)
    half = rng.normal(size=(size, 2 * size))
    matrix = scale * (half @ half.T)
    factor, columns = matrix.copy(), rng.normal(size=(4, size))
    expected = np.linalg.cholesky(matrix)
    log_determinant = factorise(factor)
    assert log_determinant == pytest.approx(np.linalg.slogdet(matrix)[1], rel=1e-12)
    np.testing.assert_allclose(np.tril(factor, -1), np.tril(expected, -1), rtol=1e-9)
    np.testing.assert_allclose(1.0 / np.diag(factor), np.diag(expected), rtol=1e-11)
    for count in (1, 2, 3):
        whitened = columns.copy()
        whiten(factor, whitened, count)
        solved = solve_triangular(expected, columns[:count].T, lower=True).T
        np.testing.assert_allclose(whitened[:count], solved, rtol=1e-8)
        np.testing.assert_array_equal(whitened[count:], columns[count:])


@kernel
def solve(matrix, solution):
    eliminate(matrix, solution)


@pytest.mark.parametrize('size', [1, 3, 5])
def test_equations_within_a_kernel_have_the_solution_of_lapack(size):
    rng = np.random.default_rng(size)
    half = rng.normal(size=(size, size))
    matrix, right = half @ half.T + np.eye(size), rng.normal(size=size)
    solution = right.copy()
    solve(matrix.copy(), solution)
    assert solution == pytest.approx(np.linalg.solve(matrix, right), rel=1e-9)
