"""The convolution of a likelihood with a Gaussian against the full sum."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.special import logsumexp

from nanorocks_ros.inference.likelihood_1d import Likelihood1D

NODES = np.linspace(0.78, 1.0, 221)


@pytest.mark.parametrize('width', [0.001, 0.02, 1.0])
@pytest.mark.parametrize('spread', [0.0005, 0.01])
def test_the_convolution_equals_the_full_sum(width, spread):
    logs = -0.5 * ((NODES - 0.91) / width) ** 2 + 0.3 * np.sin(40.0 * NODES)
    term = Likelihood1D(restitution=NODES, log_likelihood=logs).convolved(spread)
    step = min(0.25 * spread, 0.22 / 1000)
    fine = np.arange(0.78, 1.0 + step, step)
    apart = (fine - NODES[:, np.newaxis]) / spread
    whole = logsumexp(CubicSpline(NODES, logs)(fine) - 0.5 * apart**2, axis=1)
    np.testing.assert_allclose(term.log_likelihood, whole, rtol=1e-12, atol=1e-12)
