"""Inelastic collapse: avoided with a contact duration, a clear error without one."""

from __future__ import annotations

import numpy as np
import pytest
from gases import (
    BOX,
    KERNELS,
    beads_of,
    energy,
    gas_of,
    mixture,
    near,
    placed,
    smallest_gap,
)

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

pytestmark = pytest.mark.parametrize('kernel', KERNELS)

# Two hundred beads of about 1 mm that fill a fifth of a tray, in SI.
TRAY = (0.012, 0.008, 0.0054)


def crowd(seed=1):
    random = np.random.default_rng(seed)
    radii = random.uniform(0.0004, 0.0006, 200)
    places = placed(random, radii, TRAY)
    speeds = 0.01 * random.normal(size=(200, 3))
    return beads_of(places, speeds, radii=radii, masses=4e3 * radii**3)


@pytest.mark.parametrize(
    ('restitution', 'of_walls'), [(0.3, 0.5), (0.0, 0.5), (0.5, 0.0), (0.0, 0.0)]
)
def test_the_contact_duration_prevents_collapse(kernel, restitution, of_walls):
    beads = crowd()
    rules = CollisionRules(box=TRAY, restitution=restitution, wall_restitution=of_walls)
    gas = HardSphereGas(beads, rules, kernel)
    record = gas.follow(30.0, np.linspace(0.0, 30.0, 61))
    assert gas.now == 30.0
    assert gas.counts.elastic_pair > 100
    assert energy(gas.beads()) < 1e-3 * energy(beads)
    assert smallest_gap(record.positions, beads.radii, rules) > -1e-10 * beads.radii.min()


def test_beads_of_restitution_0_come_to_rest_in_contact(kernel):
    """Restitution 0: all of the normal velocity goes, at once and once."""
    gas = gas_of(
        [(3, 5, 5), (7, 5, 5)],
        [(1, 0.5, 0), (-1, 0.5, 0)],
        restitution=0.0,
        kernel=kernel,
    )
    record = gas.follow(3.0, [1.5, 3.0], log=True)
    assert record.events['time'] == near([1.0])
    assert record.velocities[1] == near(np.array([(0, 0.5, 0)] * 2))
    assert record.positions[1] == near(np.array([(4, 6.5, 5), (6, 6.5, 5)]))


def test_a_bead_of_restitution_0_slides_along_the_wall(kernel):
    gas = gas_of([(3, 5, 5)], [(-1, 0.25, 0)], wall_restitution=0.0, kernel=kernel)
    record = gas.follow(10.0, [10.0], log=True)
    assert len(record.events) == 1
    assert record.positions[0, 0] == near([1, 7.5, 5])
    assert record.velocities[0, 0].tolist() == [0, 0.25, 0]


def trapped(kernel, **rules):
    """A light bead between a wall and a heavy bead that comes slowly nearer."""
    return gas_of(
        [(1.1, 5, 5), (3.2, 5, 5)],
        [(0, 0, 0), (-0.1, 0, 0)],
        masses=[1e-6, 1.0],
        kernel=kernel,
        **rules,
    )


@pytest.mark.parametrize('restitution', [0.0, 0.3, 0.9])
def test_a_bead_trapped_between_a_wall_and_a_heavy_one_gets_away(kernel, restitution):
    gas = trapped(
        kernel, restitution=restitution, wall_restitution=restitution, contact_duration=1e-3
    )
    gas.run_until(100.0)
    assert gas.counts.elastic_pair > 0
    assert gas.counts.elastic_wall > 0
    assert gas.beads().positions[1, 0] > 3.0 - 1e-10


def test_a_bead_trapped_among_neighbours_that_close_in_gets_away(kernel):
    """Six heavy beads come from all sides; the light one in their middle bounces ever faster."""
    directions = np.concatenate((np.eye(3), -np.eye(3)))
    gas = gas_of(
        [(10, 10, 10), *(10 + 2.2 * directions)],
        [(0.3, 0.2, 0.1), *(-0.1 * directions)],
        masses=[1e-6] + [1.0] * 6,
        box=(20, 20, 20),
        restitution=0.5,
        contact_duration=1e-3,
        kernel=kernel,
    )
    record = gas.follow(100.0, np.linspace(0.0, 100.0, 201))
    assert gas.counts.elastic_pair > 10
    assert smallest_gap(record.positions, gas.radii, CollisionRules(box=(20, 20, 20))) > -1e-10


def test_contacts_within_the_contact_duration_are_elastic(kernel):
    """A bead between an elastic wall and a heavy bead: touched at 1, 5 and 13 s at the bead."""
    halved = {'box': (7, 10, 10), 'restitution': 0.5, 'kernel': kernel}
    for duration, speed in ((7.9, 0.25), (8.1, 0.5)):
        gas = gas_of(
            [(2, 5, 5), (5, 5, 5)],
            [(0, 0, 0), (-1, 0, 0)],
            masses=[1e18, 1],
            contact_duration=duration,
            **halved,
        )
        record = gas.follow(10.0, [2.0, 10.0], log=True)
        assert record.events['time'] == near([1.0, 5.0, 9.0])
        assert record.velocities[:, 1, 0] == near([0.5, speed])
        assert gas.counts.elastic_pair == (duration > 8.0)


def test_a_bead_back_at_the_same_wall_soon_bounces_elastically(kernel):
    """Restitution 1/2, room 2: contacts at 1, 5, 13 and 21 s; t_c is 13 s, of each wall alone."""
    gas = gas_of(
        [(2, 5, 5)],
        [(1, 0, 0)],
        box=(4, 10, 10),
        wall_restitution=0.5,
        contact_duration=13.0,
        kernel=kernel,
    )
    record = gas.follow(22.0, [2.0, 6.0, 14.0, 22.0], log=True)
    assert record.events['time'] == near([1, 5, 13, 21])
    assert record.events['partner'].tolist() == [1, 0, 1, 0]
    assert record.velocities[:, 0, 0] == near([-0.5, 0.25, -0.25, 0.125])
    assert gas.counts.elastic_wall == 1


def contacts_within(events, duration):
    """Collisions of pairs, and at walls, so soon after the last contact of the same two."""
    last, pairs, walls = {}, 0, 0
    for kind, time, *two in events[['kind', 'time', 'bead', 'partner']].tolist():
        key = kind in ('wall', 'fix'), *two
        lately = time - last.get(key, -np.inf) < duration
        pairs += lately and kind == 'pair'
        walls += lately and kind == 'wall'
        last[key] = time
    return pairs, walls


@pytest.mark.parametrize(('n', 'duration'), [(12, 0.3), (12, 3.0), (60, 0.3), (150, 0.3)])
def test_contacts_are_elastic_exactly_when_the_log_says_they_came_so_soon(kernel, n, duration):
    box = tuple(np.cbrt(n / 12) * np.array(BOX))
    rules = CollisionRules(
        box=box, restitution=0.95, wall_restitution=0.95, contact_duration=duration
    )
    gas = HardSphereGas(mixture(1, n, rules), rules, kernel)
    events = gas.follow(30.0, log=True).events
    expected = contacts_within(events, duration)
    assert (gas.counts.elastic_pair, gas.counts.elastic_wall) == expected
    assert min(expected) > 0


def test_in_a_crowd_at_rest_no_contact_is_forgotten_either(kernel):
    rules = CollisionRules(box=TRAY, restitution=0.0, wall_restitution=0.0)
    gas = HardSphereGas(crowd(), rules, kernel)
    events = gas.follow(30.0, log=True).events
    expected = contacts_within(events, rules.contact_duration)
    assert (gas.counts.elastic_pair, gas.counts.elastic_wall) == expected
    assert min(expected) > 1000


def test_without_a_contact_duration_no_contact_is_made_elastic(kernel):
    gas = trapped(kernel, restitution=0.9, wall_restitution=0.9, contact_duration=0.0)
    gas.run_until(1.99)
    assert gas.counts.pair > 3
    assert gas.counts.elastic_pair == gas.counts.elastic_wall == 0


COLLAPSING = {'restitution': 0.3, 'wall_restitution': 0.5, 'contact_duration': 0.0}


class TestWithoutAContactDuration:
    def collapsed(self, kernel):
        gas = trapped(kernel, **COLLAPSING)
        with pytest.raises(SimulationError) as error:
            gas.run_until(30.0)
        return gas, str(error.value)

    def test_collapse_ends_in_an_error_with_the_remedy(self, kernel):
        gas, message = self.collapsed(kernel)
        assert 'events taken and only 2 s of 30 s reached' in message
        assert 'raise most_events, the contact duration or the restitution' in message
        assert gas.now == near(2.0, 1e-5)

    def test_a_collapsed_gas_can_still_be_read(self, kernel):
        gas, _ = self.collapsed(kernel)
        beads = gas.beads()
        assert beads.positions[:, 0] == near([1, 3])

    def test_collapse_ends_when_events_are_logged_as_well(self, kernel):
        gas = trapped(kernel, **COLLAPSING)
        with pytest.raises(SimulationError, match='events taken'):
            gas.follow(30.0, log=True)

    def test_one_trapped_bead_stops_a_whole_gas(self, kernel):
        random = np.random.default_rng(1)
        packed = placed(random, np.full(100, 0.5), (10, 20, 10)) + np.array([6.0, 0.0, 0.0])
        gas = gas_of(
            [(1.1, 5, 5), (3.2, 5, 5), *packed],
            [(0, 0, 0), (-0.1, 0, 0), *np.abs(0.1 * random.normal(size=(100, 3)))],
            radii=[1.0, 1.0] + [0.5] * 100,
            masses=[1e-6, 1.0] + [0.1] * 100,
            box=(40, 20, 10),
            kernel=kernel,
            **COLLAPSING,
        )
        with pytest.raises(SimulationError, match='events taken and only 2 s'):
            gas.run_until(30.0)
        assert gas.counts.pair > 1000


def all_taken(counts):
    """In a box with walls; the scan of a periodic one also takes changes of image."""
    return counts.pair + counts.wall + counts.stale + counts.missed + counts.renewed


def test_too_many_events_end_in_an_error_after_which_the_gas_goes_on(kernel):
    rules = CollisionRules(box=(8, 7, 6.5), restitution=0.95)
    beads = mixture(1, 10, rules)
    straight, stopped = (HardSphereGas(beads, rules, kernel) for _ in range(2))
    expected = straight.follow(30.0, [30.0])
    with pytest.raises(SimulationError, match='100 events taken and only'):
        stopped.run_until(30.0, most_events=100)
    assert all_taken(stopped.counts) == 100
    assert 0.0 < stopped.now < 30.0
    record = stopped.follow(30.0, [30.0])
    assert stopped.now == 30.0
    np.testing.assert_array_equal(record.positions, expected.positions)


def test_the_log_does_not_lengthen_what_most_events_allow(kernel):
    rules = CollisionRules(box=(8, 7, 6.5))
    gas = HardSphereGas(mixture(1, 10, rules), rules, kernel)
    with pytest.raises(SimulationError, match='5000 events taken'):
        gas.follow(1e6, log=True, most_events=5000)
    assert all_taken(gas.counts) == 5000


def test_progress_is_reported_during_a_run(kernel):
    rules = CollisionRules(box=(8, 7, 6.5))
    gas = HardSphereGas(mixture(1, 10, rules), rules, kernel)
    reported = []
    gas.follow(1e5, progress=reported.append)
    assert len(reported) >= 3
    assert reported == sorted(reported)
    assert 0.0 < reported[0] < reported[-1] <= 1e5
