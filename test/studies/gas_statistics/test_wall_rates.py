"""Hits of the side walls, against those that the engine counts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gas_tracks import tracked_gas, with_beads_lost

from nanorocks_ros.physics.confined_theory import confined_gas
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.initial_state import resting_beads, rules_of
from nanorocks_ros.simulation.shaken_tray import after_shaking
from nanorocks_ros.studies.gas_statistics.collision_rates import theory_rates
from nanorocks_ros.studies.gas_statistics.displacement_windows import split_cycles
from nanorocks_ros.studies.gas_statistics.velocity_samples import sample_velocities
from nanorocks_ros.studies.gas_statistics.wall_rates import wall_rate

START, END = 1.75, 39.9
SIDE_WALLS = 4


def true_hits(tray, run, seed=5):
    """Hits of the side walls in the gas of `tracked_gas`, by species."""
    settings = SimulationSettings(
        restitution=0.89, wall_restitution=0.97, seed=seed, first_shake=0.0
    )
    rules = rules_of(settings, tray, run)
    beads = after_shaking(settings, rules, resting_beads(settings, tray, run), run, 0)
    events = HardSphereGas(beads, rules).follow(END, log=True).events
    hits = events[(events['kind'] == 'wall') & (events['partner'] < SIDE_WALLS)]
    hits = hits[hits['time'] >= START]
    return np.bincount(beads.species[hits['bead']], minlength=len(tray.species))


def measured_hits(gas, tracks):
    """Hits by the estimate, their error and those of theory, by species."""
    cycles = split_cycles(tracks, START)
    n_species = len(gas.tray.species)
    samples = sample_velocities(cycles, n_species)
    theory = theory_rates(confined_gas(gas.tray), 0.89, 0.97)
    rows = []
    for kind, species in enumerate(gas.tray.species):
        rate = wall_rate(cycles, samples, gas.tray, kind, theory[kind].wall_hits)
        speeds = [
            np.hypot(*record.velocities[record.species == kind].T).mean()
            for record in split_cycles(gas.tracks, START)[0].records
        ]
        path = species.count * np.sum(speeds) / 30.0
        rows.append((rate.per_path.value * path, rate.per_path.error * path,
                     rate.theory_per_path * path))  # fmt: skip
    return np.array(rows).T


@pytest.mark.parametrize('number', [1, 3])
def test_hits_are_those_that_the_engine_counts(number):
    deviations, measured, true, expected = [], 0.0, 0.0, 0.0
    for run in range(5):
        gas = tracked_gas(number, run)
        hits, error, theory = measured_hits(gas, gas.tracks)
        truth = true_hits(gas.tray, run)
        deviations += ((hits - truth) / error).tolist()
        measured, true = measured + hits.sum(), true + truth.sum()
        expected += theory.sum()
    assert measured / true == pytest.approx(1.0, abs=0.05)
    assert np.mean(np.abs(deviations) < 2.0) >= 0.8
    # Kinetic theory between walls is good to some per cent.
    assert expected / true == pytest.approx(1.0, abs=0.15)


def test_beads_that_are_hidden_now_and_then_change_little():
    gas = tracked_gas(1, 0)
    full, error, _ = measured_hits(gas, gas.tracks)
    some, _, _ = measured_hits(gas, with_beads_lost(gas.tracks, 0.02))
    assert some == pytest.approx(full, abs=float(3.0 * math.hypot(error[0], error[0])))


def test_too_few_hits_give_no_rate():
    gas = tracked_gas(1, 0)
    cycles = split_cycles(gas.tracks, 39.0)
    samples = sample_velocities(cycles, 1)
    assert wall_rate([], samples, gas.tray, 0, 1.0) is None
