"""Errors of inputs pass through relations to first order."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.physics.error_propagation import Estimate, propagated


def test_errors_of_a_product_add_in_squares_of_their_parts():
    estimate = propagated(
        lambda x, y: x * y, x=Estimate(value=2.0, error=0.1), y=Estimate(value=5.0, error=0.3)
    )
    assert estimate.value == pytest.approx(10.0)
    assert estimate.error == pytest.approx(math.hypot(5.0 * 0.1, 2.0 * 0.3), rel=1e-9)


def test_a_plain_number_has_no_error():
    assert propagated(lambda x, y: x / y, x=3.0, y=4.0) == Estimate(value=0.75, error=0.0)


def test_the_error_of_a_curved_relation_is_that_of_many_draws():
    drawn = np.sqrt(np.random.default_rng(3).normal(0.3, 0.01, 200_000))
    estimate = propagated(lambda x: math.sqrt(x), x=Estimate(value=0.3, error=0.01))
    assert estimate.error == pytest.approx(drawn.std(), rel=0.02)


@pytest.mark.parametrize(('value', 'error'), [(math.nan, 0.0), (1.0, -0.1), (1.0, math.inf)])
def test_an_estimate_that_is_not_finite_is_refused(value, error):
    with pytest.raises(ConfigurationError, match='finite'):
        Estimate(value=value, error=error)
