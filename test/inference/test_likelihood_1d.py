"""The convolution of a likelihood with a Gaussian against the full sum."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.special import logsumexp

from nanorocks_ros.inference.likelihood_1d import Likelihood1D, Posterior1D

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


def gaussian(mean, spread):
    return Likelihood1D(
        restitution=NODES, log_likelihood=-0.5 * ((NODES - mean) / spread) ** 2 - 7.0
    )


@pytest.mark.parametrize('spread', [0.0004, 0.01])
def test_the_posterior_of_a_gaussian_is_that_gaussian(spread):
    posterior = gaussian(0.9, spread).posterior((0.78, 1.0))
    assert posterior.mean == pytest.approx(0.9, abs=1e-3 * spread)
    assert posterior.deviation == pytest.approx(spread, rel=1e-2)
    lower, upper = posterior.quantiles(np.array([0.025, 0.975]))
    assert (lower, upper) == pytest.approx(
        (0.9 - 1.96 * spread, 0.9 + 1.96 * spread), abs=spread / 50
    )


def test_a_prior_cuts_the_posterior_and_a_known_restitution_is_a_point():
    cut = gaussian(0.9, 0.01).posterior((0.9, 1.0))
    assert cut.quantiles(np.array([0.0]))[0] == pytest.approx(0.9)
    assert cut.mean == pytest.approx(0.9 + 0.01 * np.sqrt(2.0 / np.pi), rel=1e-3)
    known = gaussian(0.9, 0.01).posterior((0.97, 0.97))
    assert (known.mean, known.deviation) == (0.97, 0.0)
    assert known.quantiles(np.array([0.025, 0.975])).tolist() == [0.97, 0.97]


def test_a_shift_moves_the_likelihood_up():
    moved = gaussian(0.9, 0.01).shifted(0.02).posterior((0.78, 1.0))
    assert moved.mean == pytest.approx(0.92, abs=1e-5)
    assert gaussian(0.9, 0.01).shifted(0.0).posterior((0.78, 1.0)).mean == pytest.approx(0.9)


def test_a_mixture_has_the_mean_and_the_quantiles_of_both():
    axis = np.linspace(0.0, 1.0, 2001)
    first, second = (
        Posterior1D(restitution=axis, probability=weight / weight.sum())
        for weight in (np.exp(-0.5 * ((axis - mean) / 0.02) ** 2) for mean in (0.4, 0.8))
    )
    mixture = first.mixed_with(second, 0.25)
    assert mixture.mean == pytest.approx(0.5, abs=1e-3)
    assert mixture.deviation == pytest.approx(math.hypot(0.02, 0.4 * math.sqrt(0.1875)), rel=0.01)
    assert mixture.quantiles(np.array([0.375, 0.875])) == pytest.approx([0.4, 0.8], abs=2e-3)
    assert first.mixed_with(second, 0.0).mean == pytest.approx(0.4, abs=1e-3)
    assert mixture.probability.sum() == pytest.approx(1.0)


def test_a_posterior_weighted_with_a_gaussian_is_the_product_of_both():
    axis = np.linspace(0.0, 1.0, 2001)
    own = np.exp(-0.5 * ((axis - 0.8) / 0.03) ** 2)
    posterior = Posterior1D(restitution=axis, probability=own / own.sum())
    product = posterior.weighted(0.9, 0.04)
    assert product.mean == pytest.approx((0.8 / 0.03**2 + 0.9 / 0.04**2) / (0.03**-2 + 0.04**-2))
    assert product.deviation == pytest.approx((0.03**-2 + 0.04**-2) ** -0.5, rel=1e-3)
    # Where both exclude each other the posterior is believed.
    assert posterior.weighted(5.0, 0.01).mean == pytest.approx(posterior.mean)
