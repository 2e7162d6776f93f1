"""Fit of Haff's law: the parameters, and the coverage of the interval."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from scipy import special

from nanorocks_ros.errors import FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.haff_fit import fit_haff
from nanorocks_ros.physics.haff_law import haff_speed
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs

TIME = np.arange(0.5, 20.0, 0.1)
BEADS = 30


def fluctuating_decay(rng, strength, white, v0=6e-3, tau=6.0):
    """A decay of a gas of few beads: the process that the fit assumes, drawn step by step."""
    s = np.log1p(TIME / tau)
    state, states = 0.0, []
    for gap in np.diff(s, prepend=0.0):
        # Exact update of an Ornstein-Uhlenbeck process of unit rate.
        keep = math.exp(-gap)
        state = keep * state + rng.normal(0.0, math.sqrt(0.5 * strength * (1 - keep**2)))
        states.append(state)
    log_v = np.log(haff_speed(TIME, v0, tau)) + states + rng.normal(0.0, white, TIME.size)
    return np.exp(log_v)


@settings(max_examples=25)
@given(some.floats(1e-4, 2e-2), some.floats(1.0, 30.0))
def test_an_exact_decay_gives_back_its_parameters(v0, tau):
    speed = haff_speed(TIME, v0, tau)
    fit = fit_haff(TIME, speed, 0.01 * speed, BEADS)
    # Inside the error, which is that of a gas, not of this smooth line.
    assert fit.initial_speed == pytest.approx(v0, rel=1e-2)
    assert abs(math.log(fit.decay_rate * v0 * tau)) < fit.log_decay_rate_error


def test_the_result_does_not_depend_on_the_unit_of_speed():
    speed = fluctuating_decay(np.random.default_rng(3), 0.01, 0.02)
    fit = fit_haff(TIME, speed, 0.02 * speed, BEADS)
    scaled = fit_haff(TIME, 1e3 * speed, 20.0 * speed, BEADS)
    assert scaled.haff_time == pytest.approx(fit.haff_time, rel=1e-4)
    assert scaled.initial_speed == pytest.approx(1e3 * fit.initial_speed, rel=1e-4)


def coverage(fits, rate):
    pulls = np.array(
        [abs(math.log(fit.decay_rate / rate)) / fit.log_decay_rate_error for fit in fits]
    )
    freedom = np.array([fit.degrees_of_freedom for fit in fits])
    return [
        (pulls < special.stdtrit(freedom, 0.5 + 0.5 * probability)).mean()
        for probability in (0.68, 0.95)
    ]


def test_the_interval_covers_the_truth_of_the_process_it_assumes():
    rng = np.random.default_rng(11)
    fits = []
    for _ in range(150):
        speed = fluctuating_decay(rng, 0.4 / BEADS, 0.03)
        fits.append(fit_haff(TIME, speed, 0.02 * speed, BEADS))
    inside_68, inside_95 = coverage(fits, 1.0 / (6e-3 * 6.0))
    assert 0.58 < inside_68 < 0.85
    assert inside_95 > 0.91


@pytest.mark.parametrize('restitution', [0.7, 0.89])
def test_the_interval_of_one_simulated_cycle_covers_the_decay_of_the_ensemble(restitution):
    tray = load_trays()[1]
    settings = SimulationSettings(restitution=restitution, seed=3)
    runs = cooling_runs(settings, tray, TIME, range(100)).mean_projected_speed
    mean = runs.mean(axis=0)
    ensemble = fit_haff(TIME, mean, 0.01 * mean, tray.count * len(runs))
    fits = [fit_haff(TIME, run, 0.04 * run, tray.count) for run in runs]
    inside_68, inside_95 = coverage(fits, ensemble.decay_rate)
    assert 0.58 < inside_68 < 0.92
    assert inside_95 > 0.91
    # And it is no wider than twice the scatter of the runs.
    scatter = np.std([math.log(fit.decay_rate) for fit in fits])
    assert np.median([fit.log_decay_rate_error for fit in fits]) < 2.0 * scatter


def test_independent_residuals_would_give_a_far_too_small_error():
    rng = np.random.default_rng(7)
    honest, naive = [], []
    for _ in range(20):
        speed = fluctuating_decay(rng, 0.012, 0.01)
        honest.append(fit_haff(TIME, speed, 0.01 * speed, BEADS).log_decay_rate_error)
        s = np.log1p(TIME / 6.0)
        design = np.column_stack((np.ones_like(s), TIME / (TIME + 6.0)))
        rest = np.log(speed) + s
        rest = rest - design @ np.linalg.lstsq(design, rest, rcond=None)[0]
        covariance = np.linalg.inv(design.T @ design) * rest.var()
        naive.append(math.sqrt(covariance.sum()))
    assert np.median(honest) > 3.0 * np.median(naive)


@pytest.mark.parametrize(
    ('decay', 'haff_time'),
    [
        (lambda time: 1.0 / (1.0 + time / 100.0), 100.0),
        (lambda time: np.maximum(1.0 / (1.0 + time / 2.0), 0.3), 30.0),
    ],
    ids=['errors far too small', 'a decay that stops'],
)
def test_decays_unlike_haffs_law_reach_the_lowest_cost(decay, haff_time):
    time = np.arange(1.75, 20.0, 0.2)
    rng = np.random.default_rng(5)
    speed = 0.01 * decay(time) * np.exp(0.05 * rng.normal(size=time.size))
    # From one start the fit ended at 1 ms in each of them.
    fit = fit_haff(time, speed, 0.002 * speed, 1000)
    assert fit.haff_time == pytest.approx(haff_time, rel=0.5)


def test_speeds_that_do_not_fall_are_no_decay():
    speed = np.full_like(TIME, 5e-3)
    with pytest.raises(FitError, match='do not fall'):
        fit_haff(TIME, speed * (1.0 + 0.05 * TIME), 0.01 * speed, BEADS)


@pytest.mark.parametrize('bad', [math.nan, 0.0, -1e-3, math.inf])
def test_a_speed_that_is_not_positive_and_finite_is_refused(bad):
    speed = haff_speed(TIME, 6e-3, 5.0)
    speed[7] = bad
    with pytest.raises(FitError, match='a speed is not positive and finite'):
        fit_haff(TIME, speed, np.full_like(speed, 1e-4), BEADS)


def test_three_speeds_are_too_few():
    few = TIME[:3]
    with pytest.raises(FitError, match='give at least 4'):
        fit_haff(few, haff_speed(few, 6e-3, 5.0), np.full(3, 1e-4), BEADS)
