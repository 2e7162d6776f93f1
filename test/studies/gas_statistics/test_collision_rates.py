"""Collision rates from lost velocities, against the collisions that the engine counts."""

from __future__ import annotations

import numpy as np
import pytest
from gas_tracks import tracked_gas

from nanorocks_ros.physics.confined_theory import confined_gas
from nanorocks_ros.studies.gas_statistics.collision_rates import collision_rate, theory_rates
from nanorocks_ros.studies.gas_statistics.displacement_windows import split_cycles
from nanorocks_ros.studies.gas_statistics.velocity_samples import sample_velocities

START = 1.75


def measured_and_true(number, run):
    """Collisions of pairs by the estimate, its error, and those of the engine."""
    gas = tracked_gas(number, run)
    cycles = split_cycles(gas.tracks, START)
    n_species = len(gas.tray.species)
    samples = sample_velocities(cycles, n_species)
    theory = theory_rates(confined_gas(gas.tray), 0.89, 0.97)
    total, variance = 0.0, 0.0
    for kind in range(n_species):
        rate = collision_rate(cycles, samples, gas.tray, kind, theory[kind])
        speeds = [
            np.hypot(*record.velocities[record.species == kind].T).mean()
            for record in cycles[0].records
        ]
        # A collision is one of both beads.
        beads_path = 0.5 * gas.tray.species[kind].count * np.sum(speeds) / 30.0
        total += rate.per_path.value * beads_path
        variance += (rate.per_path.error * beads_path) ** 2
    start = len(gas.tracks) - len(cycles[0].records)
    return total, np.sqrt(variance), gas.pairs[-1] - gas.pairs[start]


@pytest.mark.parametrize('number', [1, 3])
def test_rates_are_those_that_the_engine_counts(number):
    rows = np.array([measured_and_true(number, run) for run in range(6)])
    measured, error, true = rows.T
    assert (np.abs(measured - true) < 2.0 * error).sum() >= 5
    assert measured.sum() / true.sum() == pytest.approx(1.0, abs=0.08)


def test_the_mean_free_path_is_the_speed_in_space_over_the_rate():
    gas = tracked_gas(1, 0)
    cycles = split_cycles(gas.tracks, START)
    theory = theory_rates(confined_gas(gas.tray), 0.89, 0.97)[0]
    rate = collision_rate(cycles, sample_velocities(cycles, 1), gas.tray, 0, theory)
    # The vertical motion is weaker than the others: less than 4 / pi.
    assert 1.0 < theory.speed_ratio < 4.0 / np.pi
    ratio = rate.mean_free_path.value * rate.per_path.value
    assert ratio == pytest.approx(theory.speed_ratio)
    assert rate.theory_mean_free_path == pytest.approx(theory.speed_ratio / theory.collisions)


def test_the_expected_rate_only_chooses_windows():
    """A theory that expects half as many collisions changes the loss of velocity by little."""
    gas = tracked_gas(1, 1)
    cycles = split_cycles(gas.tracks, START)
    samples = sample_velocities(cycles, 1)
    theory = theory_rates(confined_gas(gas.tray), 0.89, 0.97)[0]
    half = theory._replace(collisions=0.5 * theory.collisions)
    rates = [collision_rate(cycles, samples, gas.tray, 0, expected) for expected in (theory, half)]
    assert rates[1].relaxation.value == pytest.approx(rates[0].relaxation.value, rel=0.15)


def test_no_frames_give_no_rate():
    gas = tracked_gas(1, 0)
    cycles = split_cycles(gas.tracks, START)
    samples = sample_velocities(cycles, 1)
    theory = theory_rates(confined_gas(gas.tray), 0.89, 0.97)[0]
    assert collision_rate([], samples, gas.tray, 0, theory) is None
