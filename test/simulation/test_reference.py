"""Pairs and bodies of the reference engine, against solutions by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference.cases import (
    Rules,
    Uniform,
    Viscoelastic,
    angular_momentum,
    energy,
    gas_of,
    momentum,
    near,
)


@pytest.mark.parametrize('restitution', [1.0, 0.5, 0.0])
def test_head_on_pair(restitution):
    gas = gas_of(
        [(2, 5, 5), (6, 5, 5)], [(1, 0, 0), (-1, 0, 0)], rules=Rules(restitution=restitution)
    )
    event = gas.step()
    assert (event.kind, event.i, event.partner) == ('pair', 0, 1)
    assert (event.time, event.speed, event.impulse) == near((1.0, 2.0, 1.0 + restitution))
    assert gas.velocities[:, 0] == near([-restitution, restitution])
    assert gas.ledger.energy_lost_in_pairs == near(1.0 - restitution**2)
    assert gas.counts.tolist() == [1, 1]


def test_oblique_pair_of_unequal_masses():
    """Contact at 3-4-5: bead 1 rests, the normal is (0.8, 0.6), the reach 2.

    Masses 1 and 3, speed 5: g = -4, mu = 3/4, restitution 1/2, so P = 4.5 n.
    """
    gas = gas_of(
        [(2, 5, 5), (6.6, 6.2, 5)],
        [(5, 0, 0), (0, 0, 0)],
        masses=(1, 3),
        rules=Rules(restitution=0.5),
    )
    event = gas.step()
    assert (event.time, event.speed, event.impulse) == near((0.6, 4.0, 4.5))
    assert gas.positions[0] == near([5.0, 5.0, 5.0])
    assert gas.velocities == near(np.array([(1.4, -2.7, 0), (1.2, 0.9, 0)]))
    assert gas.ledger.energy_lost_in_pairs == near(0.5 * 0.75 * 16 * 0.75)


def test_three_in_a_row_hand_the_speed_on():
    gas = gas_of([(1.5, 5, 5), (5, 5, 5), (7, 5, 5)], [(3, 0, 0), (0, 0, 0), (0, 0, 0)])
    first, second = gas.step(), gas.step()
    assert [(e.i, e.partner) for e in (first, second)] == [(0, 1), (1, 2)]
    assert (first.time, second.time) == near((0.5, 0.5))
    assert gas.velocities[:, 0] == near([0, 0, 3])
    assert gas.step().kind == 'wall'


def test_rough_pair_reverses_the_slip_and_keeps_the_angular_momentum():
    beta = 0.3
    gas = gas_of(
        [(3, 5, 5), (6, 6, 5.5)],
        [(1, 0.2, 0), (-1, 0.1, 0.3)],
        radii=(1, 0.7),
        masses=(1, 2.5),
        rules=Rules(restitution=0.6, tangential_restitution=beta, wall_tangential_restitution=0),
        spins=[(0.3, -1, 2), (1, 1, -3)],
    )

    def surface(normal):
        u = gas.velocities[1] - gas.velocities[0]
        turning = gas.beads.radii @ gas.spins
        return u - np.cross(turning, normal)

    angular_momentum_before, momentum_before, energy_before = (
        angular_momentum(gas),
        momentum(gas),
        energy(gas),
    )
    time = gas.step().time
    after = gas.positions[1] - gas.positions[0]
    normal = after / np.linalg.norm(after)
    left = surface(normal)

    second_gas = gas_of([(3, 5, 5), (6, 6, 5.5)], [(1, 0.2, 0), (-1, 0.1, 0.3)], radii=(1, 0.7))
    assert second_gas.step().time == time
    u, turning = np.array([-2, -0.1, 0.3]), np.array([1, -0.3, -0.1])
    came = u - np.cross(turning, normal)
    assert left @ normal == near(-0.6 * (came @ normal))
    assert np.cross(left, normal) == near(-beta * np.cross(came, normal))
    assert angular_momentum(gas) == near(angular_momentum_before)
    assert momentum(gas) == near(momentum_before)
    assert energy(gas) + gas.ledger.energy_lost_in_pairs == near(energy_before)


def test_restitution_of_species_uniform_and_viscoelastic():
    def rebound(restitution, speed=2.0, **state):
        gas = gas_of(
            [(2, 5, 5), (6, 5, 5)],
            [(speed / 2, 0, 0), (-speed / 2, 0, 0)],
            rules=Rules(restitution=restitution),
            **state,
        )
        gas.step()
        return (gas.velocities[1, 0] - gas.velocities[0, 0]) / speed

    assert rebound(((0.1, 0.4), (0.4, 0.9)), species=(0, 1)) == near(0.4)
    assert rebound(((0.1, 0.4), (0.4, 0.9)), species=(1, 1)) == near(0.9)
    assert abs(rebound(Uniform(0.5, 0.2)) - 0.5) <= 0.1
    assert rebound(Uniform(0.5, 0.2)) == rebound(Uniform(0.5, 0.2))
    assert rebound(Viscoelastic(0.8, 2.0)) == near(0.8)
    assert 0.8 < rebound(Viscoelastic(0.8, 2.0), speed=0.5) < 1.0
    assert rebound(Viscoelastic(1.0, 2.0)) == near(1.0)


@pytest.mark.parametrize(('contact_duration', 'speed'), [(7.9, 0.25), (8.1, 0.5)])
def test_a_pair_that_touched_lately_bounces_elastically(contact_duration, speed):
    """Bead 1 returns from an elastic wall to a heavy bead 8 s after it left it."""
    gas = gas_of(
        [(2, 5, 5), (5, 5, 5)],
        [(0, 0, 0), (-1, 0, 0)],
        masses=(1e18, 1),
        rules=Rules(box=(7, 10, 10), restitution=0.5, contact_duration=contact_duration),
    )
    speeds = [(gas.step().kind, gas.velocities[1, 0]) for _ in range(3)]
    assert [kind for kind, _ in speeds] == ['pair', 'wall', 'pair']
    assert [value for _, value in speeds] == near([0.5, -0.5, speed])
    assert gas.time == near(9.0)


@pytest.mark.parametrize(
    ('kind', 'rules'),
    [
        ('merge', {'sticking_speed': 1.9}),
        ('pair', {'sticking_speed': 1.9, 'sticking_measure': 'total'}),
        ('merge', {'sticking_speed': 2.1, 'sticking_measure': 'total', 'contact_duration': 1e3}),
    ],
)
def test_slow_pairs_merge_and_keep_their_momentum(kind, rules):
    """|u| = 2 and |u.n| = 2 cos 30° = 1.73."""
    gas = gas_of(
        [(2, 5, 5), (6, 6, 5)],
        [(2, 0, 0), (0, 0, 0)],
        masses=(1, 3),
        rules=Rules(**rules, tangential_restitution=0.0),
        spins=[(1, 0, 0), (0, 2, 0)],
    )
    energy_before, momentum_before = energy(gas), momentum(gas)
    event = gas.step()
    assert (event.kind, event.speed) == (kind, near(math.sqrt(3.0)))
    assert momentum(gas) == near(momentum_before)
    if kind == 'merge':
        assert gas.body.tolist() == [0, 0]
        assert gas.velocities == near(np.array([(0.5, 0, 0)] * 2))
        assert not gas.spins.any()
        assert event.impulse == near(1.5)
        assert gas.ledger.energy_lost_in_merges == near(energy_before - 0.5)


def test_a_merged_body_bounces_as_one_and_counts_for_all():
    gas = gas_of(
        [(2, 5, 5), (5, 5, 5), (9.5, 5, 5)],
        [(1, 0, 0), (0, 0, 0), (-2, 0, 0)],
        masses=(1, 1, 2),
        rules=Rules(box=(20, 10, 10), sticking_speed=1.5),
    )
    assert gas.step().kind == 'merge'
    event = gas.step()
    assert (event.kind, event.i, event.partner) == ('pair', 1, 2)
    assert gas.velocities[:, 0] == near([-2.0, -2.0, 0.5])
    assert gas.counts.tolist() == [2, 2, 1]
    event = gas.step()
    assert (event.kind, event.i, event.partner) == ('wall', 0, 0)
    assert (gas.velocities[:, 0], event.impulse) == (near([2.0, 2.0, 0.5]), near(8.0))
    assert gas.positions[0, 0] == 1.0


def test_a_slow_body_is_fixed_at_a_wall_reflects_and_holds():
    gas = gas_of(
        [(3, 5, 5), (7, 5, 5)],
        [(-0.5, 0, 0), (-0.75, 0, 0)],
        rules=Rules(restitution=0.5, wall_sticking_speed=0.6, sticking_speed=1.0),
    )
    event = gas.step()
    assert (event.kind, event.i, event.partner, event.impulse) == ('fix', 0, 0, near(0.5))
    assert gas.fixed.tolist() == [True, False]
    assert gas.ledger.energy_lost_at_walls == near(0.125)
    gas.beads.velocities[1, 0] = -2.0
    event = gas.step()
    assert (event.kind, event.impulse) == ('pair', near(3.0))
    assert gas.velocities[:, 0] == near([0, 1.0])
    assert gas.ledger.fixed_impulse[0] == near(-3.0)
    assert [gas.step().kind, gas.step().kind] == ['wall', 'pair']
    gas.beads.velocities[1, 0] = -0.9
    gas.beads.positions[1, 0] = 5.0
    assert gas.step().kind == 'merge'
    assert gas.fixed.all()
    assert not gas.velocities.any()
    assert gas.step() is None


def test_touching_beads_at_rest_relative_to_each_other_do_not_collide():
    gas = gas_of([(2, 5, 5), (6, 5, 5)], [(1, 0, 0), (-2, 0, 0)], rules=Rules(restitution=0.0))
    assert gas.step().kind == 'pair'
    assert gas.step().kind == 'wall'
