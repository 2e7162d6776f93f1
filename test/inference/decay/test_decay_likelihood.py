"""Likelihoods of decays against the same with dense matrices."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import reduce
from operator import add

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.decay_likelihood import decay_likelihood
from nanorocks_ros.inference.decay.decay_tables import FRICTIONS, tables_of
from nanorocks_ros.inference.decay.grid_likelihood import MOST_CYCLES, DecayLikelihood
from nanorocks_ros.inference.posterior import posterior_of
from nanorocks_ros.records import Measured
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
        start=np.zeros(30),
        gradient=rng.normal(0.0, 3.0, (30, 8)),
        information=half @ half.swapaxes(1, 2),
        deviation=np.zeros(30),
        samples=5,
        decays=1,
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


@pytest.mark.parametrize('gradient', [0.0, 3.0, -250.0])
def test_the_deviation_is_that_of_the_likeliest_nuisances(gradient):
    information, expected = 80.0, 900.0
    likelihood = DecayLikelihood(
        log_likelihood=np.zeros(2),
        start=np.zeros(2),
        gradient=np.array([[0.0], [gradient]]),
        information=np.full((2, 1, 1), information),
        deviation=np.array([5.0, expected]),
        samples=40,
        decays=1,
    )
    nuisance = np.linspace(-4.0, 4.0, 80_001)
    log_likelihood = gradient * nuisance - 0.5 * information * nuisance**2
    likeliest = np.argmax(log_likelihood - 0.5 * nuisance**2)
    least = expected - 2.0 * log_likelihood[likeliest]
    assert likelihood.deviation_at(1) == pytest.approx(least, abs=1e-2)
    assert likelihood.deviation_at(0) == 5.0


def test_frictions_are_compared_up_to_the_next_one_above_the_highest(tables):
    decay = TIMES, SPEEDS, 0.02 * SPEEDS, (0.01, 0.01)
    whole = decay_likelihood(tables, *decay)
    assert [friction for friction, _ in whole.rough] == list(FRICTIONS)
    some = decay_likelihood(tables, *decay, highest_friction=0.01)
    assert [friction for friction, _ in some.rough] == [0.004, 0.012]
    for (_, part), (_, same) in zip(some.rough, whole.rough, strict=False):
        np.testing.assert_array_equal(part.log_likelihood, same.log_likelihood)
    none = decay_likelihood(tables, *decay, highest_friction=0.0)
    assert none.rough == ()
    np.testing.assert_array_equal(none.integrated(), whole.integrated())
    twice = whole + whole
    assert [friction for friction, _ in twice.rough] == list(FRICTIONS)
    np.testing.assert_allclose(
        twice.rough[-1][1].log_likelihood, 2.0 * whole.rough[-1][1].log_likelihood
    )


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


def test_a_dragged_decay_is_read_as_that_of_the_gas_without_drag(tables):
    drag = 0.05
    still = TIMES / (1.0 + 0.5 * drag * TIMES)
    dragged_times = -np.log1p(-drag * still) / drag
    speeds = np.interp(still, TIMES, SPEEDS) * np.exp(-drag * dragged_times)
    camera = (0.01, 0.01)
    read = decay_likelihood(
        tables, dragged_times, speeds, 0.02 * speeds, camera, Measured(drag, 0.0)
    )
    same = np.interp(still, TIMES, SPEEDS)
    expected = decay_likelihood(tables, still, same, 0.02 * same, camera)
    np.testing.assert_allclose(read.integrated(), expected.integrated(), atol=1e-6)


@pytest.mark.parametrize('drag', [0.0, 0.03])
def test_the_gradient_by_the_drag_is_that_of_likelihoods_for_other_drags(tables, drag):
    error, step = 1e-2, 1e-2

    def at(value):
        measured = Measured(value, error)
        return decay_likelihood(tables, TIMES, SPEEDS, 0.05 * SPEEDS, (0.0, 0.0), measured)

    # The number of bins changes with the clock, and all likelihoods with it: only the difference
    # between restitutions counts.
    best = int(np.argmax(at(drag).log_likelihood))
    beads = int(np.argmin(np.abs(tables.restitution - 0.5)))
    walls = int(np.argmin(np.abs(tables.wall_restitution - 0.9)))
    other = beads * tables.wall_restitution.size + walls
    high, low = (at(drag + sign * step).log_likelihood for sign in (1.0, -1.0))
    slopes = (high - low) / (2.0 * step) * error
    gradient = at(drag).gradient[:, -2]
    expected = slopes[best] - slopes[other]
    assert abs(expected) > 5.0
    assert gradient[best] - gradient[other] == pytest.approx(expected, rel=0.25)


@pytest.mark.parametrize('drag', [0.0, 0.03])
def test_the_gradient_by_the_start_is_that_of_likelihoods_for_other_starts(tables, drag):
    # Late times that fill equally many bins however they are counted.
    time = np.arange(12.0, 24.0, 0.25)
    speeds = 6e-3 / (1.0 + time / 4.0)
    error, step = 0.5, 0.05

    def at(later):
        measured, camera = Measured(drag, 0.0), (0.0, 0.0)
        decay = time - later, speeds, 0.05 * speeds
        return decay_likelihood(
            tables, *decay, camera, measured, highest_friction=0.0, start_error=error
        )

    unmoved, early, late = at(0.0), at(-step), at(step)
    assert early.samples == unmoved.samples == late.samples
    slopes = (late.log_likelihood - early.log_likelihood) / (2.0 * step) * error
    gradient = unmoved.gradient[:, -1]
    # The best place, and two that are less likely: only differences count.
    best, unlikely, other = np.argsort(-unmoved.log_likelihood)[[0, 300, 400]]
    for place in (unlikely, other):
        expected = slopes[place] - slopes[best]
        assert abs(expected) > 1.0
        assert gradient[place] - gradient[best] == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize('faster', [1.0 / 30.0, 30.0])
def test_a_film_of_other_speeds_than_expected_is_read_as_one_of_those(tables, faster):
    beads, walls = np.meshgrid(tables.restitution, tables.wall_restitution, indexing='ij')
    place = int(np.argmin(np.hypot(beads.ravel() - 0.6, walls.ravel() - 0.95)))
    time = np.arange(1.75, 20.0, 0.25)
    start = math.exp(tables.start[0])
    distances = np.log(tables.decays.distances)
    speed = start * np.exp(np.interp(np.log(start * time), distances, tables.mean[place]))

    def restitution(time, speed):
        decay = decay_likelihood(tables, time, speed, 0.02 * speed, (0.01, 0.01))
        posterior = posterior_of(tables, decay.integrated(), (0.9, 1.0))
        return posterior.quantiles(np.array([0.025, 0.5, 0.975]))

    lower, value, upper = restitution(time, speed)
    _, other, _ = restitution(time / faster, speed * faster)

    assert abs(other - value) < 0.1 * (upper - lower)


def test_fluctuations_of_speeds_are_no_bias_of_the_camera(tables):
    # What measured speeds share with their residuals is small beside the scatter of one cycle.
    cycles, bias = 400, 0.01
    library = tables.decays
    beads, walls = np.meshgrid(tables.restitution, tables.wall_restitution, indexing='ij')
    place = int(np.argmin(np.hypot(beads.ravel() - 0.7, walls.ravel() - 0.95)))
    table = np.tensordot(
        tables.shares[place],
        library.covariance.reshape(-1, *library.covariance.shape[2:])[tables.corners[place]],
        1,
    )
    part = slice(14, 40)
    start = math.exp(tables.start[0])
    mean = start * np.exp(tables.mean[place, part])
    fluctuations = np.random.default_rng(3).multivariate_normal(
        np.zeros(mean.size), table[part, part], cycles
    )
    speeds = mean * np.exp(fluctuations)
    time = library.distances[part] / start
    decays = [
        decay_likelihood(tables, time, speed, 1e-3 * speed, (0.0, bias), highest_friction=0.0)
        for speed in speeds
    ]
    total = reduce(add, decays)
    of_bias = tables.slopes.shape[1] + 1
    error = math.sqrt(total.information[place, of_bias, of_bias])
    assert abs(total.gradient[place, of_bias]) < 3.0 * error


def many(likelihood, cycles):
    return reduce(add, [likelihood] * cycles)


def test_what_many_cycles_say_has_a_limit(tables):
    one = replace(
        decay_likelihood(tables, TIMES, SPEEDS, 0.02 * SPEEDS, (0.0, 0.0), highest_friction=0.0),
        start=np.zeros(tables.mean.shape[0]),
    )
    one = replace(one, gradient=0.0 * one.gradient, information=0.0 * one.information)
    alone = np.ptp(one.integrated())
    assert np.ptp(many(one, 2).integrated()) == pytest.approx(2.0 * alone, rel=1.0 / MOST_CYCLES)
    most = MOST_CYCLES * alone
    assert 0.95 * most < np.ptp(many(one, 1000).integrated()) < most
