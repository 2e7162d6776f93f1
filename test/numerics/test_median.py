"""The median of many numbers, against numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.numerics.median import median_of


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
