"""Beads that stick to each other and to walls, against solutions by hand, and in gases."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gases import KERNELS, energy, gas_of, mixture, momentum, near, to_nearest

from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

pytestmark = pytest.mark.parametrize('kernel', KERNELS)


def event_list(record):
    return [(row['kind'].item(), row['bead'], row['partner']) for row in record.events]


@pytest.mark.parametrize(
    ('kind', 'rules'),
    [
        ('merge', {'sticking_speed': 1.74}),
        ('pair', {'sticking_speed': 1.73}),
        ('pair', {'sticking_speed': 1.74, 'sticking_measure': 'total'}),
        ('pair', {'sticking_speed': 1.99, 'sticking_measure': 'total'}),
        ('merge', {'sticking_speed': 2.01, 'sticking_measure': 'total'}),
    ],
)
def test_slow_pairs_merge_by_the_chosen_speed_measure(kernel, kind, rules):
    """The relative speed is 2, along the normal 2 cos 30° = 1.732; masses 1 and 3."""
    gas = gas_of(
        [(2, 5, 5), (6, 6, 5)],
        [(2, 0, 0), (0, 0, 0)],
        masses=[1, 3],
        spins=[(1, 0, 0), (0, 2, 0)],
        tangential_restitution=0.0,
        aggregate_motion='translating',
        kernel=kernel,
        **rules,
    )
    energy_before, momentum_before = energy(gas.beads()), momentum(gas.beads())
    record = gas.follow(2.0, [0.5, 2.0], log=True)
    assert record.events[0]['kind'] == kind
    assert record.events[0]['normal_speed'] == near(math.sqrt(3.0))
    assert momentum(gas.beads()) == near(momentum_before)
    if kind == 'merge':
        assert record.bodies.tolist() == [[0, 1], [0, 0]]
        assert record.velocities[1] == near(np.array([(0.5, 0, 0)] * 2))
        assert not record.spins[1].any()
        assert record.events[0]['impulse'] == near(0.75 * 2)
        assert gas.ledger[:3] == near([0, 0, energy_before - 0.5])


def test_beads_meet_once_for_all_and_sticking_goes_before_the_contact_duration(kernel):
    """After 1 s they bounce at 1; the wall sends bead 1 back for a contact within t_c, at 0.5."""
    gas = gas_of(
        [(3, 5, 5), (6, 5, 5)],
        [(0, 0, 0), (-1, 0, 0)],
        masses=[1e18, 1],
        box=(8, 10, 10),
        restitution=0.5,
        sticking_speed=0.6,
        contact_duration=100.0,
        kernel=kernel,
    )
    record = gas.follow(50.0, [50.0], log=True)
    assert event_list(record) == [('pair', 0, 1), ('wall', 1, 1), ('merge', 0, 1)]
    assert record.bodies.tolist() == [[0, 0]]


def test_a_merged_body_bounces_as_one(kernel):
    """Beads of 1 + 1 at 0.5 meet one of 2 at -2 elastically: they exchange velocities."""
    gas = gas_of(
        [(2, 5, 5), (5, 5, 5), (9.5, 5, 5)],
        [(1, 0, 0), (0, 0, 0), (-2, 0, 0)],
        masses=[1, 1, 2],
        box=(20, 10, 10),
        sticking_speed=1.5,
        kernel=kernel,
    )
    record = gas.follow(2.6, [1.5, 2.6], log=True)
    assert event_list(record) == [('merge', 0, 1), ('pair', 1, 2), ('wall', 0, 0)]
    assert record.velocities[0, :, 0] == near([-2, -2, 0.5])
    assert record.velocities[1, :, 0] == near([2, 2, 0.5])
    assert record.events['impulse'] == near([0.5, 5.0, 8.0])
    assert record.positions[1, 1, 0] - record.positions[1, 0, 0] == near(2.0)
    assert gas.bodies.tolist() == [0, 0, 2]
    assert gas.counts.merge == 1


def test_a_body_has_the_smallest_number_of_its_beads(kernel):
    gas = gas_of(
        [(8, 5, 5), (2, 5, 5), (5, 5, 5)],
        [(-0.5, 0, 0), (1, 0, 0), (0, 0, 0)],
        sticking_speed=3.0,
        kernel=kernel,
    )
    record = gas.follow(3.0, [0.9, 1.05, 3.0], log=True)
    assert event_list(record) == [('merge', 1, 2), ('merge', 0, 2)]
    assert record.bodies.tolist() == [[0, 1, 2], [0, 1, 1], [0, 0, 0]]
    assert record.velocities[2, :, 0] == near([1 / 6] * 3)
    assert not gas.stuck.any()


def test_a_slow_bead_stays_at_a_wall_and_reflects_as_one_of_infinite_mass(kernel):
    """Bead 0 stops after 4 s; bead 1 comes at -2, bounces with 1/2, and does not move it."""
    gas = gas_of(
        [(3, 5, 5), (15, 5, 5)],
        [(-0.5, 0, 0), (-2, 0, 0)],
        masses=[1, 3],
        box=(20, 10, 10),
        restitution=0.5,
        wall_sticking_speed=0.6,
        kernel=kernel,
    )
    record = gas.follow(8.0, [8.0], log=True)
    assert event_list(record) == [('fix', 0, 0), ('pair', 0, 1)]
    assert record.events['time'] == near([4.0, 6.0])
    assert record.events['impulse'] == near([0.5, 3 * 1.5 * 2])
    assert gas.stuck.tolist() == [True, False]
    assert record.positions[0, 0].tolist() == [1, 5, 5]
    assert record.velocities[0, :, 0] == near([0, 1])
    assert gas.ledger[:3] == near([0.5 * 3 * 4 * 0.75, 0.125, 0])
    assert gas.ledger[3:9] == near([0.5, 0, 0, 0, 0, 0])
    assert gas.ledger[9:12] == near([-0.5 - 9.0, 0, 0])


@pytest.mark.parametrize(
    ('kind', 'rules'),
    [
        ('fix', {'wall_sticking_speed': 0.51}),
        ('wall', {'wall_sticking_speed': 0.49}),
        ('wall', {'wall_sticking_speed': 0.51, 'sticking_measure': 'total'}),
        ('wall', {'wall_sticking_speed': 1.29, 'sticking_measure': 'total'}),
        ('fix', {'wall_sticking_speed': 1.31, 'sticking_measure': 'total'}),
    ],
)
def test_slow_beads_stick_to_a_wall_by_the_chosen_speed_measure(kernel, kind, rules):
    """The speed is 1.3, along the normal 0.5."""
    gas = gas_of([(3, 2, 5)], [(-0.5, 1.2, 0)], kernel=kernel, **rules)
    record = gas.follow(5.0, [5.0], log=True)
    assert event_list(record) == [(kind, 0, 0)]
    assert record.events['normal_speed'] == near([0.5])
    assert record.events['impulse'] == near([1.3 if kind == 'fix' else 1.0])
    expected = (0, 0, 0) if kind == 'fix' else (0.5, 1.2, 0)
    assert record.velocities[0, 0] == near(expected)


def test_a_bead_that_sticks_to_a_stuck_bead_is_stuck(kernel):
    gas = gas_of(
        [(3, 5, 5), (8, 5, 5), (13, 5, 5)],
        [(-0.5, 0, 0), (-0.5, 0, 0), (-0.5, 0, 0)],
        box=(20, 10, 10),
        sticking_speed=0.6,
        wall_sticking_speed=0.6,
        kernel=kernel,
    )
    record = gas.follow(60.0, [5.0, 15.0, 60.0], log=True)
    assert event_list(record) == [('fix', 0, 0), ('merge', 0, 1), ('merge', 1, 2)]
    assert gas.stuck.all()
    assert gas.bodies.tolist() == [0, 0, 0]
    assert record.positions[2, :, 0] == near([1, 3, 5])
    assert not record.velocities[2].any()
    assert gas.counts.merge == 2
    assert gas.ledger[9:12] == near([-1.5, 0, 0])


def test_a_body_stops_as_a_whole_at_a_wall_that_one_of_its_beads_reaches(kernel):
    gas = gas_of(
        [(3, 5, 5), (6, 5, 5)],
        [(0, 0, 0), (-1, 0, 0)],
        sticking_speed=2.0,
        wall_sticking_speed=0.6,
        kernel=kernel,
    )
    record = gas.follow(10.0, [10.0], log=True)
    assert event_list(record) == [('merge', 0, 1), ('fix', 0, 0)]
    assert record.positions[0, :, 0] == near([1, 3])
    assert gas.stuck.all()
    assert gas.ledger[3] == near(2 * 0.5)


@pytest.mark.parametrize('walls', [False, True])
def test_bodies_that_do_not_turn_keep_their_shape_velocity_and_members(kernel, walls):
    rules = CollisionRules(
        box=(12, 11, 10),
        periodic=(not walls,) * 3,
        restitution=0.8,
        sticking_speed=0.4,
        wall_sticking_speed=0.2 if walls else 0.0,
        aggregate_motion='translating',
    )
    gas = HardSphereGas(mixture(4, 40, rules), rules, kernel)
    record = gas.follow(60.0, np.linspace(0.0, 60.0, 61))
    assert gas.counts.merge > 10
    assert gas.counts.merge == 40 - np.unique(gas.bodies).size
    largest = np.bincount(record.bodies[-1]).max()
    assert largest >= 3
    for k in range(1, 61):
        bodies = record.bodies[k]
        assert np.all(bodies == bodies[bodies])
        assert np.all(bodies <= np.arange(40))
        np.testing.assert_array_equal(record.velocities[k], record.velocities[k][bodies])
        # Who was together stays together, at the same distances.
        before = record.bodies[k - 1]
        assert np.all(bodies == bodies[before])
        moved = record.positions[k] - record.positions[k - 1]
        np.testing.assert_allclose(moved, moved[before], atol=1e-11)


def test_members_touch_one_another_in_chains(kernel):
    rules = CollisionRules(box=(12, 11, 10), restitution=0.8, sticking_speed=1.0)
    gas = HardSphereGas(mixture(5, 40, rules), rules, kernel)
    gas.run_until(200.0)
    beads = gas.beads()
    i, j = np.triu_indices(40, 1)
    apart = to_nearest(beads.positions[j] - beads.positions[i], rules.box, rules.periodic)
    gaps = np.linalg.norm(apart, axis=1) - beads.radii[i] - beads.radii[j]
    touching = (np.abs(gaps) < 1e-9) & (gas.bodies[i] == gas.bodies[j])
    # Each merge was a contact, so that bodies hang together: a tree of contacts at least.
    assert touching.sum() >= gas.counts.merge > 20
    assert gaps.min() > -1e-10
