"""A fast contact releases the bead that is hit from its body."""

from __future__ import annotations

import numpy as np
import pytest
from gases import BREAKING, KERNELS, gas_of, mixture, near, smallest_gap

from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

pytestmark = pytest.mark.parametrize('kernel', KERNELS)


def chain(kernel, bullet, break_up_speed, **rules):
    """Three beads along x that stick one after the other; a bead hits the middle one from y."""
    return gas_of(
        [(6, 10, 10), (8.1, 10, 10), (10.2, 10, 10), (8.1, 15, 10)],
        [(0.1, 0, 0), (0, 0, 0), (-0.1, 0, 0), (0.0, bullet, 0)],
        masses=[1, 1, 1, 1],
        sticking_speed=0.2,
        break_up_speed=break_up_speed,
        box=(20, 20, 20),
        kernel=kernel,
        **rules,
    )


def test_a_fast_bead_knocks_the_middle_one_out_of_a_chain(kernel):
    """The chain is one body; its middle bead leaves it, and its ends are single again."""
    gas = chain(kernel, -1.0, 0.5)
    gas.run_until(2.0)
    assert gas.bodies.tolist() == [0, 0, 0, 3]
    momentum = gas.momentum
    gas.run_until(3.2)
    assert gas.counts.break_up == 1
    assert np.unique(gas.bodies).size == 4
    assert gas.momentum == near(momentum)
    # Equal masses, elastic: the middle bead takes the velocity along the line of centres.
    assert gas.beads().velocities[1, 1] == pytest.approx(-1.0, abs=0.01)
    assert abs(gas.beads().velocities[3, 1]) < 0.01


def test_a_slower_one_moves_the_whole_chain(kernel):
    gas = chain(kernel, -1.0, 1.5)
    gas.run_until(3.5)
    assert gas.counts.break_up == 0
    assert gas.bodies.tolist() == [0, 0, 0, 3]
    assert gas.beads().velocities[:3, 1] == pytest.approx(np.full(3, -0.5), abs=0.01)


def test_what_still_hangs_together_stays_a_body_that_turns_on(kernel):
    """A bullet at the end of the chain: the other two stay together, with their velocities."""
    gas = gas_of(
        [(6, 10, 10), (8.1, 10, 10), (10.2, 10, 10), (10.1, 15, 10)],
        [(0.1, 0, 0), (0, 0, 0), (-0.1, 0, 0), (0.0, -1.0, 0)],
        sticking_speed=0.2,
        break_up_speed=0.5,
        restitution=0.9,
        box=(20, 20, 20),
        kernel=kernel,
    )
    before = gas.energy
    gas.run_until(3.3)
    assert gas.counts.break_up == 1
    assert gas.bodies.tolist() == [0, 0, 2, 3]
    apart = np.subtract(*gas.beads().positions[:2])
    assert np.linalg.norm(apart) == near(2.0)
    assert gas.energy + gas.ledger[:3].sum() == near(before)


def test_a_gas_of_bodies_that_break_keeps_its_books(kernel):
    """Energy, momentum and angular momentum with what the ledger says; nothing overlaps."""
    rules = CollisionRules(box=(12, 11, 10), **BREAKING['turning and breaking'])
    beads = mixture(3, 25, rules)
    gas = HardSphereGas(beads, rules, kernel)
    scale = gas.energy
    energy, momentum, moment = gas.energy, gas.momentum, gas.angular_momentum
    record = gas.follow(40.0, np.linspace(0.0, 40.0, 801))
    assert gas.counts.break_up > 3
    assert gas.counts.merge > gas.counts.break_up
    assert gas.energy + gas.ledger[:3].sum() == pytest.approx(energy, abs=1e-11 * scale)
    assert gas.momentum + gas.ledger[9:12] == pytest.approx(momentum, abs=1e-10 * scale)
    total = gas.angular_momentum + gas.ledger[12:15] + gas.ledger[15:18]
    assert total == pytest.approx(moment, abs=1e-10 * scale)
    assert np.abs(gas.ledger[15:18]).max() > 1e-3
    assert smallest_gap(record.positions, beads.radii, rules) > -1e-10


def test_what_is_left_of_a_body_slows_at_rates_of_its_own(kernel):
    """The chain slowed at the mean rate of its beads; then two of them, and the third alone."""
    rates = np.array([0.01, 0.02, 0.06, 0.01])
    gas = gas_of(
        [(6, 10, 10), (8.1, 10, 10), (10.2, 10, 10), (10.1, 15, 10)],
        [(0.1, 0, 0), (0, 0, 0), (-0.1, 0, 0), (0.0, -1.2, 0)],
        sticking_speed=0.2,
        break_up_speed=0.5,
        box=(20, 20, 20),
        drag=rates,
        kernel=kernel,
    )
    gas.run_until(2.0)
    assert gas.bodies.tolist() == [0, 0, 0, 3]
    before, after = gas.follow(2.4, [2.0, 2.4]).velocities
    left = np.exp(-0.4 * 0.03)
    np.testing.assert_allclose(after[:3].sum(axis=0), left * before[:3].sum(axis=0), atol=1e-13)
    gas.run_until(3.4)
    assert gas.counts.break_up == 1
    assert gas.bodies.tolist() == [0, 0, 2, 3]
    first, later = gas.follow(3.6, [3.4, 3.6]).velocities
    pair = np.exp(-0.2 * 0.015)
    np.testing.assert_allclose(later[:2].sum(axis=0), pair * first[:2].sum(axis=0), atol=1e-13)
    alone = np.exp(-0.2 * rates[2:])[:, np.newaxis]
    np.testing.assert_allclose(later[2:], alone * first[2:], atol=1e-13)
