"""The likelihood of a decay against its definition, and its slopes against differences."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.inference.decay.haff_likelihood import Decay

RNG = np.random.default_rng(4)
TIME = np.sort(RNG.uniform(0.3, 12.0, 25))
DECAY = Decay(
    time=TIME,
    starts=np.arange(25),
    counts=np.ones(25, dtype=np.intp),
    log_speed=np.log(6e-3 / (1.0 + TIME / 4.0)) + RNG.normal(0.0, 0.05, 25),
    variance=RNG.uniform(1e-4, 4e-4, 25),
    inner_distance=np.zeros(25),
    usual=np.log([0.02, 0.005]),
)
PARAMETERS = [
    np.log([4.0, 0.01, 0.004, 1.0]),
    np.log([0.7, 0.2, 1e-4, 3.0]),
    np.log([300.0, 1e-3, 0.03, 0.2]),
]


def by_definition(parameters):
    """Dense linear algebra, element by element as the formulas stand in the documentation."""
    tau, strength, quick, scale = np.exp(parameters)
    s = np.log1p(TIME / tau)
    gap = np.abs(s[:, None] - s)
    covariance = 0.5 * strength * (np.exp(-gap) - np.exp(-(s[:, None] + s)))
    covariance += quick * np.exp(-gap / 0.1) + np.diag(scale**2 * DECAY.variance)
    design = np.column_stack([np.ones_like(s), TIME / (TIME + tau)])
    information = design.T @ np.linalg.solve(covariance, design)
    data = DECAY.log_speed + s
    ones = design[:, 0]
    log_v0 = ones @ np.linalg.solve(covariance, data) / information[0, 0]
    residual = data - log_v0
    cost = residual @ np.linalg.solve(covariance, residual) + np.linalg.slogdet(covariance)[1]
    cost += (((parameters[1:3] - DECAY.usual) / [0.5, 1.0]) ** 2).sum()
    cost += np.linalg.slogdet(information)[1] + 2.0 * (log_v0 + parameters[0])
    return cost, log_v0, information


@pytest.mark.parametrize('parameters', PARAMETERS)
def test_the_likelihood_equals_its_definition(parameters):
    cost, log_v0, information = DECAY.generalised(parameters)
    expected = by_definition(parameters)
    assert cost == pytest.approx(expected[0], rel=1e-9)
    assert log_v0 == pytest.approx(expected[1], rel=1e-9)
    np.testing.assert_allclose(information, expected[2], rtol=1e-8)


@pytest.mark.parametrize('parameters', PARAMETERS)
def test_slopes_are_those_of_the_cost(parameters):
    cost, slope = DECAY.cost_and_slope(parameters)
    assert cost == DECAY.cost(parameters)
    for k, step in enumerate(1e-5 * np.eye(4)):
        expected = (DECAY.cost(parameters + step) - DECAY.cost(parameters - step)) / 2e-5
        assert slope[k] == pytest.approx(expected, rel=1e-5, abs=1e-5)
