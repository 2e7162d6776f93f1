"""The median of many numbers, against numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.numerics.median import median_of, quantile_of


@pytest.mark.parametrize('n', [1, 2, 7, 99, 100, 101, 200, 4321])
def test_the_median_equals_that_of_numpy_bit_by_bit(n):
    rng = np.random.default_rng(n)
    for values in (
        rng.random(n),
        np.square(rng.normal(0.0, 1e-6, n)),
        # Far below the largest, next to each other, the same, zero.
        np.concatenate([np.exp(rng.normal(0.0, 40.0, n)), [1e290]]),
        1.0 + 1e-15 * rng.integers(0, 9, n),
        rng.integers(0, 3, n).astype(float),
        np.zeros(n),
    ):
        assert median_of(values) == np.median(values)


def test_infinite_and_negative_numbers_are_handled():
    values = np.random.default_rng(1).normal(0.0, 1.0, 500)
    assert median_of(values) == np.median(values)
    values = np.append(np.abs(values), [np.inf, np.inf])
    assert median_of(values) == np.median(values)


@pytest.mark.parametrize('n', [1, 2, 11, 500])
@pytest.mark.parametrize('share', [0.0, 0.1, 0.5, 0.93])
def test_a_quantile_lies_between_the_two_nearest_numbers(n, share):
    values = np.random.default_rng(n).normal(0.0, 1.0, n)
    assert quantile_of(values, share) == pytest.approx(np.quantile(values, share), rel=1e-14)


def test_a_quantile_of_unknown_numbers_is_unknown():
    assert np.isnan(quantile_of(np.array([1.0, np.nan, 0.0]), 0.1))
