"""Medians and running quantiles against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.numerics.quantiles import Quantile, median

VALUES = np.random.default_rng(1).normal(size=60)


@pytest.mark.parametrize('size', [1, 2, 7, 60])
def test_the_median_is_that_of_numpy(size):
    assert median(VALUES[:size]) == np.median(VALUES[:size])


@pytest.mark.parametrize('share', [0.0, 0.1, 0.5, 0.93, 1.0])
def test_the_running_quantile_is_that_of_the_last_values(share):
    quantile = Quantile(share, 12)
    running = [quantile.push(float(value)) for value in VALUES]
    expected = [np.quantile(VALUES[max(0, k - 11) : k + 1], share) for k in range(VALUES.size)]
    assert running == expected
