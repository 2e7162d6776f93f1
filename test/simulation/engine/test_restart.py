"""A gas is restarted with other velocities or positions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gases import ALWAYS, BOX, KERNELS, RULES, energy, gas_of, mixture, near

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

pytestmark = pytest.mark.parametrize('kernel', KERNELS)


def running(name, kernel, n=14):
    rules = CollisionRules(box=BOX, **RULES[name])
    gas = HardSphereGas(mixture(11, n, rules), rules, kernel)
    gas.run_until(30.0)
    return gas, rules


@pytest.mark.parametrize('name', ['inelastic', 'periodic', 'species'])
def test_a_kick_keeps_positions_and_restarts_time(kernel, name):
    gas, _ = running(name, kernel)
    before, counts, ledger = gas.beads(), gas.counts, gas.ledger
    velocities = np.random.default_rng(1).normal(size=(14, 3))
    gas.kick(velocities)
    assert gas.now == 0.0
    assert gas.counts == counts
    assert gas.kernel == kernel
    np.testing.assert_array_equal(gas.ledger, ledger)
    after = gas.beads()
    # Places in a periodic box are wrapped, and unwrapped again.
    np.testing.assert_allclose(after.positions, before.positions, atol=1e-13)
    np.testing.assert_array_equal(after.velocities, velocities)
    for field in ('radii', 'masses', 'species'):
        np.testing.assert_array_equal(getattr(after, field), getattr(before, field))


def test_a_kick_separates_bodies_and_stops_spins(kernel):
    gas, _ = running('rough and sticking', kernel)
    assert gas.counts.merge > 0
    assert gas.stuck.any()
    assert gas.beads().spins.any()
    collisions = gas.counts.pair
    gas.kick(np.zeros((14, 3)))
    assert gas.bodies.tolist() == list(range(14))
    assert not gas.stuck.any()
    assert not gas.beads().spins.any()
    gas.kick(np.random.default_rng(1).normal(size=(14, 3)))
    gas.run_until(10.0)
    assert gas.counts.pair > collisions + 10


def test_a_kick_of_zero_velocities_stops_a_gas(kernel):
    gas, _ = running('inelastic', kernel)
    places = gas.beads().positions
    collisions = gas.counts.pair
    gas.kick(np.zeros((14, 3)))
    record = gas.follow(1e6, [1e6])
    np.testing.assert_array_equal(record.positions[0], places)
    assert not record.velocities.any()
    assert gas.counts.pair == collisions


def test_beads_that_touch_when_they_are_kicked_into_each_other_collide_at_once(kernel):
    gas = gas_of([(4, 5, 5), (6, 5, 5)], [(0, 0, 0), (0, 0, 0)], kernel=kernel)
    gas.run_until(5.0)
    gas.kick([(1, 0, 0), (-1, 0, 0)])
    record = gas.follow(1.0, [1.0], log=True)
    assert record.events['time'].tolist() == [0.0]
    assert record.velocities[0, :, 0].tolist() == [-1, 1]


def test_many_kicks_add_no_energy_but_their_own(kernel):
    rules = CollisionRules(box=BOX, periodic=ALWAYS, restitution=0.9)
    gas = HardSphereGas(mixture(11, 14, rules), rules, kernel)
    given = energy(gas.beads())
    random = np.random.default_rng(1)
    for _ in range(20):
        gas.run_until(3.0)
        before = gas.beads()
        gas.kick(random.normal(size=(14, 3)))
        given += energy(gas.beads()) - energy(before)
    gas.run_until(3.0)
    assert energy(gas.beads()) + gas.ledger[0] == near(given)


def test_a_gas_restarts_with_its_beads_at_other_positions(kernel):
    gas, rules = running('rough', kernel)
    counts = gas.counts
    beads = mixture(12, 14, rules)
    gas.restart(beads)
    record = gas.follow(5.0, [0.0, 5.0])
    expected = HardSphereGas(beads, rules, kernel).follow(5.0, [0.0, 5.0])
    np.testing.assert_array_equal(record.positions, expected.positions)
    np.testing.assert_array_equal(record.spins, expected.spins)
    assert gas.counts.pair > counts.pair


def test_a_restart_with_another_number_of_beads_is_refused(kernel):
    gas, rules = running('inelastic', kernel)
    before = gas.beads()
    with pytest.raises(SimulationError, match='beads: 13 of them; give 14'):
        gas.restart(mixture(12, 13, rules))
    moved = replace(before, positions=before.positions + 5.0)
    with pytest.raises(SimulationError, match='into a wall'):
        gas.restart(moved)
    together = before.positions.copy()
    together[1] = together[0]
    with pytest.raises(SimulationError, match='overlap'):
        gas.restart(replace(before, positions=together))
    # And is what it was.
    assert gas.now == 30.0
    np.testing.assert_array_equal(gas.beads().positions, before.positions)
