"""Logarithms of sums of exponentials against scipy."""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from nanorocks_ros.numerics.log_sums import log_sum


def test_sums_beyond_the_range_of_doubles_are_those_of_scipy():
    rng = np.random.default_rng(1)
    logs = rng.normal(-2000.0, 300.0, (7, 50))
    weights = rng.uniform(0.1, 2.0, 7)
    np.testing.assert_allclose(log_sum(logs), logsumexp(logs, axis=0), rtol=1e-14)
    expected = logsumexp(logs, axis=0, b=weights[:, np.newaxis])
    np.testing.assert_allclose(log_sum(logs, weights), expected, rtol=1e-14)


def test_the_sum_of_impossible_terms_is_impossible():
    logs = np.array([[-np.inf, -np.inf, 1.0], [-np.inf, 3.0, 1.0]])
    np.testing.assert_allclose(log_sum(logs), [-np.inf, 3.0, 1.0 + np.log(2.0)])
