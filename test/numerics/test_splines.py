"""Compiled splines against those of scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline, CubicSpline

from nanorocks_ros.numerics.splines import spline_at, spline_basis, spline_slopes


@pytest.mark.parametrize('count', [4, 5, 40])
def test_a_spline_through_uneven_nodes_is_that_of_scipy_beyond_its_ends_too(count):
    rng = np.random.default_rng(count)
    nodes = np.cumsum(rng.uniform(0.1, 1.0, count))
    values = rng.normal(size=count)
    at = np.linspace(nodes[0] - 0.1, nodes[-1] + 0.1, 333)
    interpolated = spline_at(nodes, values, spline_slopes(nodes, values), at)
    np.testing.assert_allclose(
        interpolated, CubicSpline(nodes, values)(at), rtol=1e-10, atol=1e-11
    )


def test_b_splines_are_those_of_scipy_and_sum_to_one():
    inner = np.sort(np.random.default_rng(1).uniform(0.0, 1.0, 7))
    knots = np.concatenate([np.zeros(4), inner, np.ones(4)])
    at = np.concatenate([np.linspace(0.0, 1.0, 101), inner])
    basis = spline_basis(knots, at)
    expected = BSpline.design_matrix(at, knots, 3).toarray()
    np.testing.assert_allclose(basis, expected, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(basis.sum(axis=1), 1.0, rtol=1e-13)
