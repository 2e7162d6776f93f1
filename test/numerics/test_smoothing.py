"""Smoothing of curves by polynomials in a moving window."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_filter

from nanorocks_ros.numerics.smoothing import savitzky_golay


@pytest.mark.parametrize('shape', [(9,), (40,), (3, 25), (4, 2, 3, 30)])
def test_curves_are_smoothed_as_by_scipy_bit_by_bit(shape):
    curves = np.random.default_rng(1).normal(size=shape).cumsum(axis=-1)
    assert np.array_equal(savitzky_golay(curves, 9, 3), savgol_filter(curves, 9, 3, axis=-1))


def test_a_polynomial_of_the_order_of_the_fit_stays():
    x = np.linspace(-1.0, 2.0, 31)
    cubic = 1.0 - 2.0 * x + 0.5 * x**3
    assert savitzky_golay(cubic, 9, 3) == pytest.approx(cubic, abs=1e-12)
