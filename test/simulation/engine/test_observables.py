"""Observables agree with the frames of the same instants and with the event log."""

from __future__ import annotations

import numpy as np
import pytest
from gases import BOX, KERNELS, RULES, TURNING, energy, gas_of, mixture, near

from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

CASES = RULES | TURNING
END = 12.0
TIMES = np.array([0.0, 0.4, 1.0, 1.0, 2.5, 5.5, 8.0, 11.9, END])


def followed(name, kernel, n=14):
    rules = CollisionRules(box=BOX, **CASES[name])
    beads = mixture(3, n, rules)
    gas = HardSphereGas(beads, rules, kernel)
    return beads, gas, gas.follow(END, TIMES, TIMES, log=True)


cases = pytest.mark.parametrize('kernel', KERNELS)


@cases
@pytest.mark.parametrize('name', CASES)
def test_means_agree_with_the_frames(name, kernel):
    beads, _, record = followed(name, kernel)
    seen = record.observations
    v = record.velocities
    np.testing.assert_array_equal(seen.times, TIMES)
    np.testing.assert_allclose(seen.mean_speed, np.linalg.norm(v, axis=2).mean(axis=1), 1e-14)
    projected = np.hypot(v[..., 0], v[..., 1]).mean(axis=1)
    np.testing.assert_allclose(seen.mean_projected_speed, projected, 1e-14)
    species = np.zeros(14, dtype=int) if beads.species is None else beads.species
    assert seen.granular_temperature.shape == (TIMES.size, species.max() + 1, 3)
    for kind in range(species.max() + 1):
        squares = (v[:, species == kind] ** 2).mean(axis=1)
        np.testing.assert_allclose(seen.granular_temperature[:, kind], squares, 1e-13)


@cases
@pytest.mark.parametrize('name', CASES)
def test_counts_agree_with_the_event_log(name, kernel):
    _, gas, record = followed(name, kernel)
    seen, events = record.observations, record.events
    for kind, counts in (
        ('pair', seen.pair_collisions),
        ('wall', seen.wall_collisions),
        ('merge', seen.merges),
        ('fix', seen.fixings),
    ):
        times = events['time'][events['kind'] == kind]
        np.testing.assert_array_equal(counts, np.searchsorted(times, TIMES, side='right'))
    assert seen.pair_collisions[-1] == gas.counts.pair > 0
    assert seen.wall_collisions[-1] == gas.counts.wall
    bodies = [14] * TIMES.size
    if record.bodies is not None:
        bodies = [np.unique(frame).size for frame in record.bodies]
    np.testing.assert_array_equal(seen.bodies, bodies)
    assert seen.bodies[-1] == 14 - seen.merges[-1]


@cases
@pytest.mark.parametrize('name', CASES)
def test_the_ledger_agrees_with_frames_and_events(name, kernel):
    beads, gas, record = followed(name, kernel)
    seen = record.observations
    left = energy(beads, record.velocities, record.spins)
    np.testing.assert_allclose(left + seen.energy_lost.sum(axis=1), left[0], 1e-12)
    np.testing.assert_array_equal(seen.energy_lost[-1], gas.ledger[:3])
    np.testing.assert_array_equal(seen.wall_impulse[-1], gas.ledger[3:9])
    if 'tangential_restitution' in CASES[name]:
        return  # the impulse of an event then has a tangential part
    events = record.events
    for wall in range(6):
        hits = events[(events['kind'] == 'wall') & (events['partner'] == wall)]
        if 'fix' not in events['kind']:
            pushes = [hits['impulse'][hits['time'] <= time].sum() for time in TIMES]
            np.testing.assert_allclose(seen.wall_impulse[:, wall], pushes, 1e-12, 1e-12)


@cases
def test_observations_continue_over_several_runs(kernel):
    rules = CollisionRules(box=BOX, restitution=0.9)
    beads = mixture(3, 14, rules)
    straight = HardSphereGas(beads, rules, kernel).follow(END, (), TIMES).observations
    gas = HardSphereGas(beads, rules, kernel)
    parts = [gas.follow(end, (), [end]).observations for end in (1.0, 5.5, END)]
    for field in ('mean_speed', 'pair_collisions', 'energy_lost', 'wall_impulse'):
        joined = np.concatenate([getattr(part, field) for part in parts])
        np.testing.assert_array_equal(joined, getattr(straight, field)[[3, 5, 8]])


@cases
def test_temperatures_of_species_without_beads_are_nan(kernel):
    gas = gas_of(
        [(2, 5, 5), (8, 5, 5)],
        [(1, 2, 3), (0.5, 0, 0)],
        species=np.array([0, 2]),
        restitution=np.full((4, 4), 0.5),
        kernel=kernel,
    )
    temperature = gas.follow(0.1, (), [0.0]).observations.granular_temperature
    assert temperature.shape == (1, 4, 3)
    assert temperature[0, 0] == near([1, 4, 9])
    assert temperature[0, 2] == near([0.25, 0, 0])
    assert np.isnan(temperature[0, [1, 3]]).all()


@cases
def test_species_may_have_equal_restitutions(kernel):
    gas = gas_of(
        [(3, 5, 5), (7, 5, 5)],
        [(1, 0, 0), (-1, 0, 0)],
        species=np.array([2, 0]),
        restitution=0.5,
        kernel=kernel,
    )
    record = gas.follow(1.5, [1.5], [1.5])
    assert record.velocities[0, :, 0] == near([-0.5, 0.5])
    assert record.observations.granular_temperature.shape == (1, 3, 3)
    assert gas.beads().species.tolist() == [2, 0]


@cases
def test_a_run_without_output_has_an_empty_record(kernel):
    rules = CollisionRules(box=BOX)
    record = HardSphereGas(mixture(3, 5, rules), rules, kernel).follow(1.0)
    assert record.positions.shape == record.velocities.shape == (0, 5, 3)
    assert record.spins is None
    assert record.bodies is None
    assert record.observations.mean_speed.shape == (0,)
    assert record.observations.wall_impulse.shape == (0, 6)
    assert len(record.events) == 0
