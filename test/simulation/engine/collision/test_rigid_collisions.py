"""Gases of bodies that turn: conservation, determinism, thresholds drawn at random, no hang."""

from __future__ import annotations

import numpy as np
import pytest
from gases import KERNELS, TURNING, gas_of, mixture, smallest_gap

from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

BOX = (12.0, 11.0, 10.0)


@pytest.mark.parametrize('kernel', KERNELS)
def test_free_bodies_keep_energy_momentum_and_angular_momentum(kernel):
    """Far from all walls, a swarm that flies together: everything is conserved exactly."""
    random = np.random.default_rng(2)
    rules = CollisionRules(box=(200.0, 200.0, 200.0), restitution=0.7, sticking_speed=0.5)
    beads = mixture(2, 16, CollisionRules(box=(6.0, 6.0, 6.0)))
    inwards = 0.5 * (beads.positions.mean(axis=0) - beads.positions)
    beads.velocities[:] = inwards + 0.3 * random.normal(size=(16, 3))
    beads.positions[:] += 100.0
    gas = HardSphereGas(beads, rules, kernel)
    before = gas.energy, gas.momentum, gas.angular_momentum
    gas.run_until(30.0)
    assert gas.counts.merge > 4
    assert gas.counts.pair > 10
    assert gas.counts.wall == 0
    assert gas.energy + gas.ledger[:3].sum() == pytest.approx(before[0], rel=1e-12)
    np.testing.assert_allclose(gas.momentum, before[1], atol=1e-11)
    np.testing.assert_allclose(gas.angular_momentum, before[2], atol=1e-9)
    assert not gas.ledger[3:].any()


@pytest.mark.parametrize('restitution', [0.0, 0.2, 1.0])
@pytest.mark.parametrize('kernel', KERNELS)
def test_crowded_bodies_that_touch_in_many_places_end_no_run(kernel, restitution):
    """A dense box in which all soon hangs together, against walls that take all."""
    rules = CollisionRules(
        box=(7.0, 6.5, 6.0),
        restitution=restitution,
        wall_restitution=restitution,
        sticking_speed=0.05,
    )
    beads = mixture(6, 24, rules, sizes=(0.6, 0.9))
    gas = HardSphereGas(beads, rules, kernel)
    # With restitution 0 all that merge have done so at 20, and meet walls 90 000 times by 50.
    record = gas.follow(60.0, np.linspace(0.0, 60.0, 601), most_events=3_000_000)
    assert gas.counts.merge >= (5 if restitution < 1.0 else 0)
    assert smallest_gap(record.positions, beads.radii, rules) > -1e-10


@pytest.mark.parametrize('name', TURNING)
def test_the_same_seed_gives_the_same_bits(name):
    rules = CollisionRules(box=BOX, **TURNING[name])
    first, second = (
        HardSphereGas(mixture(3, 20, rules), rules).follow(30.0, [30.0]) for _ in range(2)
    )
    np.testing.assert_array_equal(first.positions, second.positions)
    np.testing.assert_array_equal(first.velocities, second.velocities)
    np.testing.assert_array_equal(first.spins, second.spins)


@pytest.mark.parametrize('kernel', KERNELS)
def test_beads_that_never_stick_move_as_without_sticking(kernel):
    """Bit by bit: a threshold that no contact is below changes nothing."""
    free = CollisionRules(box=BOX, restitution=0.9, wall_restitution=0.9)
    sticky = CollisionRules(box=BOX, restitution=0.9, wall_restitution=0.9, sticking_speed=1e-12)
    records = [
        HardSphereGas(mixture(3, 20, rules), rules, kernel).follow(30.0, [30.0])
        for rules in (free, sticky)
    ]
    np.testing.assert_array_equal(records[0].positions, records[1].positions)
    np.testing.assert_array_equal(records[0].velocities, records[1].velocities)


def test_the_probability_to_stick_falls_linearly_over_its_width():
    """Pairs that meet at 0.6 to 1.4 of the threshold, width 0.8 of it; errors of a binomial."""
    trials = 400
    for speed, expected in ((0.55, 1.0), (0.8, 0.75), (1.0, 0.5), (1.3, 0.125), (1.45, 0.0)):
        merged = 0
        for seed in range(trials):
            gas = gas_of(
                [(3, 5, 5), (6, 5, 5)],
                [(speed, 0, 0), (0, 0, 0)],
                sticking_speed=1.0,
                sticking_speed_width=0.8,
                seed=seed,
            )
            gas.follow(1.01 / speed)
            merged += gas.counts.merge
        error = 3.5 * np.sqrt(trials * expected * (1.0 - expected))
        assert abs(merged - trials * expected) <= error
