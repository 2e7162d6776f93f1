"""Restitution against speed, and its bands of noise."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.instantaneous_restitution import instantaneous_cor, local_slopes
from nanorocks_ros.physics.confined_theory import confined_gas
from nanorocks_ros.physics.haff_law import haff_speed
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs

TRAY = load_trays()[1]
TIMES = 0.5 + 0.1 * np.arange(195)
WALLS = 0.99


@cache
def gas():
    return confined_gas(TRAY)


def cor(speed, error, **options):
    errors = np.full(TIMES.size, error)
    return instantaneous_cor(
        (TIMES, speed, errors), TRAY, gas(), wall_restitution=WALLS, **options
    )


def simulated(cycles, error, seed):
    settings = SimulationSettings(
        tray=1, restitution=0.89, wall_restitution=WALLS, seed=seed, speeds='maxwellian'
    )
    speeds = cooling_runs(settings, TRAY, TIMES, range(cycles)).mean_projected_speed
    noise = error * np.random.default_rng(seed).normal(size=TIMES.size)
    return speeds.mean(axis=0) + noise


def test_the_slope_of_a_decay_by_haffs_law_is_its_rate_everywhere():
    law = haff_speed(TIMES, 0.006, 7.0)
    places = np.minimum(np.arange(TIMES.size) // 40, 3)
    assert local_slopes(TIMES, law, law, places) == pytest.approx(1.0 / (0.006 * 7.0))


def test_the_slope_is_right_about_a_fit_that_is_a_little_off():
    law = haff_speed(TIMES, 0.006, 7.0)
    near = haff_speed(TIMES, 0.00605, 6.9)
    places = np.minimum(np.arange(TIMES.size) // 40, 3)
    assert local_slopes(TIMES, law, near, places) == pytest.approx(1.0 / (0.006 * 7.0), rel=0.01)


def test_without_noise_all_windows_give_the_restitution_of_the_decay():
    rate = gas().decay_rate(0.89, WALLS)
    result = cor(haff_speed(TIMES, 0.0055, 1.0 / (0.0055 * rate)), 1e-6, cycles=10_000)
    assert result.whole == pytest.approx(0.89, abs=0.002)
    assert result.local.restitution == pytest.approx(np.full(8, 0.89), abs=0.003)
    assert (result.local.lower < 0.89).all()
    assert (result.local.upper > 0.89).all()


def test_the_papers_estimate_of_a_simulated_gas_without_rotation_spreads_as_noise_does():
    # No bead rotates, one restitution holds at all speeds, and yet it spreads as in [B19] fig. 13.
    inside = spread = 0.0
    for seed in range(4):
        result = cor(simulated(18, 1e-4, seed), 1e-4, cycles=18)
        low, _, _, high = result.noise_and_gas
        inside += np.mean((result.paper > low) & (result.paper < high)) / 4.0
        fast, slow = result.paper[:40], result.paper[-40:]
        spread += slow.std() / fast.std() / 4.0
        assert np.nanmax(result.paper) > 1.0
    assert inside == pytest.approx(0.95, abs=0.03)
    assert spread > 3.0


def test_errors_of_the_local_slopes_are_their_scatter():
    deviations = []
    for seed in range(16):
        result = cor(simulated(18, 1e-4, seed), 1e-4, cycles=18).local
        truth = gas().decay_rate(0.89, WALLS)
        deviations.append((result.decay_rate - truth) / result.decay_rate_error)
    assert np.std(deviations) == pytest.approx(1.0, abs=0.2)
    assert np.mean(deviations) == pytest.approx(0.0, abs=0.35)


def test_the_band_widens_as_beads_become_slow_and_holds_the_narrower_one():
    result = cor(simulated(6, 1e-4, 1), 1e-4, cycles=6)
    width = result.noise[3] - result.noise[0]
    assert width[-20:].mean() > 4.0 * width[:20].mean()
    assert (result.noise_and_gas[3] >= result.noise[3] - 0.05).all()
    assert (np.diff(result.noise, axis=0) > 0.0).all()


def test_the_same_seed_draws_the_same_band():
    speed = simulated(2, 1e-4, 3)
    assert (cor(speed, 1e-4, seed=5).noise == cor(speed, 1e-4, seed=5).noise).all()


def test_a_window_faster_than_any_restitution_has_no_value_but_a_range():
    rate = 6.0 * gas().decay_rate(0.5, WALLS)
    result = cor(haff_speed(TIMES, 0.006, 1.0 / (0.006 * rate)), 1e-6).local
    assert np.isnan(result.restitution).all()
    assert (result.lower == 0.0).all()


def test_speeds_that_rise_are_an_error():
    with pytest.raises(FitError, match='do not fall'):
        cor(np.linspace(0.001, 0.002, TIMES.size), 1e-5)


def test_windows_and_intervals_too_many_or_long_are_named():
    speed = haff_speed(TIMES, 0.006, 7.0)
    with pytest.raises(ConfigurationError, match='three in each'):
        cor(speed, 1e-5, windows=100)
    with pytest.raises(ConfigurationError, match='interval'):
        cor(speed, 1e-5, interval=15.0)


def test_a_tray_of_other_beads_gives_another_restitution():
    speed = haff_speed(TIMES, 0.0055, 7.0)
    fewer = replace(TRAY, species=(replace(TRAY.species[0], count=12),))
    errors = np.full(TIMES.size, 1e-5)
    result = instantaneous_cor(
        (TIMES, speed, errors), fewer, confined_gas(fewer), wall_restitution=WALLS
    )
    # Fewer collisions must each take more for the same decay.
    assert result.whole < cor(speed, 1e-5).whole
