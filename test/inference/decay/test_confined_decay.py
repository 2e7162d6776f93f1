"""The confined theory before its steady state."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy import optimize

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.confined_decay import (
    confined_restitution,
    windowed_decay_rate,
    windowed_restitution,
)
from nanorocks_ros.physics.confined_theory import confined_gas
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs

TRAYS = load_trays()
WINDOW = (2.0, 20.0)
START = {'initial_speed': 0.0055, 'window': WINDOW}


@cache
def gas(number):
    return confined_gas(TRAYS[number])


def test_a_late_window_sees_the_steady_decay():
    result = windowed_decay_rate(gas(1), 0.9, 0.95, initial_speed=0.0055, window=(60.0, 120.0))
    assert result == pytest.approx(gas(1).decay_rate(0.9, 0.95), rel=0.003)


def test_initial_vertical_energy_is_transferred_to_the_horizontal_motion():
    # What is kept along z is not lost to the beads, and comes back to the motion that is seen.
    rates = [
        windowed_decay_rate(gas(1), 0.89, 0.99, **START, vertical=vertical)
        for vertical in (0.04, 1.0, 4.0)
    ]
    assert rates[0] > rates[1] > rates[2]


@pytest.mark.parametrize(('number', 'restitution', 'walls'), [(1, 0.8, 1.0), (3, 0.7, 0.97)])
def test_the_restitution_undoes_the_decay_of_a_window(number, restitution, walls):
    rate = windowed_decay_rate(gas(number), restitution, walls, **START)
    result = windowed_restitution(gas(number), rate, walls, **START)
    assert result == pytest.approx(restitution, abs=1e-3)


def test_with_elastic_walls_the_approach_to_the_steady_state_matters():
    # Simulated, the steady state alone reads 0.77 for 0.80.
    settings = SimulationSettings(
        tray=1, restitution=0.8, wall_restitution=1.0, speeds='maxwellian'
    )
    window = (2.0, 30.0)
    times = np.concatenate(([0.0], np.linspace(*window, 57)))
    speed = cooling_runs(settings, TRAYS[1], times, range(600)).mean_projected_speed.mean(axis=0)
    (_, rate), _ = optimize.curve_fit(
        lambda t, v0, rate: np.log(v0 / (1.0 + v0 * rate * t)),
        times[1:],
        np.log(speed[1:]),
        p0=(speed[0], 30.0),
    )
    result = windowed_restitution(gas(1), rate, 1.0, initial_speed=speed[0], window=window)
    assert result == pytest.approx(0.8, abs=0.015)
    assert gas(1).restitution(rate, 1.0) < 0.78


def test_a_crowded_gas_that_does_not_stay_homogeneous_is_an_error():
    # Simulated tray 8 at 0.8 decays with 349 /m, from which an even gas would read 0.90.
    with pytest.raises(FitError, match='forms clusters'):
        confined_restitution(TRAYS[8], 349.0, 0.95)
    # At 0.98 it stays even: simulated 108 /m.
    assert confined_restitution(TRAYS[8], 108.0, 0.95).value == pytest.approx(0.98, abs=0.003)


def test_a_decay_that_no_restitution_makes_is_an_error():
    with pytest.raises(FitError, match='no restitution from'):
        windowed_restitution(gas(1), 1.0, 0.9, **START)


@pytest.mark.parametrize('window', [(5.0, 2.0), (-1.0, 2.0), (0.0, math.inf)])
def test_a_wrong_window_is_named(window):
    with pytest.raises(ConfigurationError, match='window'):
        windowed_decay_rate(gas(1), 0.9, 0.9, initial_speed=0.005, window=window)
