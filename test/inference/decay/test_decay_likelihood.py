"""Likelihoods of decays against the same with dense matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.decay_likelihood import DecayLikelihood, decay_likelihood
from nanorocks_ros.inference.decay.decay_tables import tables_of
from nanorocks_ros.settings import PriorSettings

TRAY = load_trays()[1]
TIMES = np.arange(1.8, 20.0, 0.1)
SPEEDS = 7e-3 / (1.0 + TIMES / 5.0) * np.exp(0.03 * np.cos(7.0 * TIMES))


@pytest.fixture(scope='module')
def tables():
    return tables_of(library_of(TRAY), TRAY, PriorSettings())


def test_nuisances_are_integrated_over_as_by_a_determinant_and_an_inverse():
    rng = np.random.default_rng(1)
    half = rng.normal(size=(30, 8, 5)) * np.geomspace(0.1, 30.0, 30)[:, np.newaxis, np.newaxis]
    likelihood = DecayLikelihood(
        log_likelihood=rng.normal(size=30),
        gradient=rng.normal(0.0, 3.0, (30, 8)),
        information=half @ half.swapaxes(1, 2),
        deviation=np.zeros(30),
        samples=5,
    )
    expected = []
    for log, gradient, information in zip(
        likelihood.log_likelihood, likelihood.gradient, likelihood.information, strict=True
    ):
        matrix = np.eye(8) + information
        shift = np.linalg.inv(matrix) @ gradient
        share = min(1.0, 4.0 / np.abs(shift).max())
        gain = (share - 0.5 * share**2) * gradient @ shift
        expected.append(log + gain - 0.5 * math.log(np.linalg.det(matrix)))
    np.testing.assert_allclose(likelihood.integrated(), expected, rtol=1e-11, atol=1e-11)


def test_the_best_amplitude_leaves_residuals_that_no_other_makes_smaller(tables):
    likelihood = decay_likelihood(tables, TIMES, SPEEDS, 0.02 * SPEEDS, (0.01, 0.01))
    place = int(np.argmax(likelihood.log_likelihood))
    library = tables.decays
    bins = np.floor(np.log(TIMES / TIMES[0]) / library.step + 1e-9).astype(int)
    log_time, log_speed = (
        np.array([np.log(values[bins == k]).mean() for k in np.unique(bins)])
        for values in (TIMES, SPEEDS)
    )
    variance = np.array([0.02**2 / (bins == k).sum() for k in np.unique(bins)])
    axis = np.log(library.distances)
    # The covariance is that of the corners around the best place, at any amplitude it is near to.
    table = np.tensordot(
        tables.shares[place],
        library.covariance.reshape(-1, axis.size, axis.size)[tables.corners[place]],
        1,
    )
    costs = []
    for amplitude in log_speed[0] + np.linspace(0.0, 2.0, 401):
        residual = (
            log_speed - amplitude - np.interp(log_time + amplitude, axis, tables.mean[place])
        )
        first = int((log_time[0] + amplitude - axis[0]) / library.step)
        covariance = table[first : first + len(residual), first : first + len(residual)]
        matrix = covariance + np.diag(variance)
        costs.append(residual @ np.linalg.solve(matrix, residual))
    assert likelihood.deviation[place] == pytest.approx(min(costs), rel=0.1)
    assert likelihood.samples == len(log_time)
