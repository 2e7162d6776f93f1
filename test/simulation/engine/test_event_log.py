"""The event log holds every change of every velocity, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from gases import BOX, KERNELS, RULES, mixture, to_nearest

from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules
from nanorocks_ros.simulation.engine.rules.restitution_laws import UniformRestitution

BEADS = 12
EVENTS = 400
PRECISION = 1e-10


def between_events(name, kernel):
    """A gas, its rules, its events, and a frame before each of them and after the last."""
    rules = CollisionRules(box=BOX, **RULES[name])
    beads = mixture(6, BEADS, rules)
    # Events closer together than this cannot be told from each other in frames.
    events = HardSphereGas(beads, rules, kernel).follow(60.0, log=True).events[:EVENTS]
    ends = np.append(events['time'], events['time'][-1] + 1e-3)
    times = 0.5 * (np.insert(ends[:-1], 0, 0.0) + ends)
    times[-1] = ends[-1]
    record = HardSphereGas(beads, rules, kernel).follow(times[-1], times, log=True)
    np.testing.assert_array_equal(record.events[: len(events)], events)
    return beads, rules, events, record


def bodies_of(record, k):
    return np.arange(BEADS) if record.bodies is None else record.bodies[k]


@pytest.mark.parametrize('kernel', KERNELS)
@pytest.mark.parametrize('name', RULES)
def test_between_two_frames_only_the_beads_of_the_event_change(name, kernel):
    _, _, events, record = between_events(name, kernel)
    assert np.all(np.diff(events['time']) >= 0.0)
    for k, event in enumerate(events):
        bodies = bodies_of(record, k)
        involved = bodies == bodies[event['bead']]
        if event['kind'] in ('pair', 'merge'):
            assert event['bead'] < event['partner']
            involved |= bodies == bodies[event['partner']]
        else:
            assert 0 <= event['partner'] < 6
        changed = np.any(record.velocities[k + 1] != record.velocities[k], axis=1)
        assert not np.any(changed & ~involved)
        assert changed[involved].any()
        flown = record.velocities[k] * (record.times[k + 1] - record.times[k])
        moved = record.positions[k + 1] - record.positions[k]
        np.testing.assert_allclose(moved[~involved], flown[~involved], atol=PRECISION)


SMOOTH = [name for name, rule in RULES.items() if 'tangential_restitution' not in rule]


@pytest.mark.parametrize('kernel', KERNELS)
@pytest.mark.parametrize('name', SMOOTH)
def test_replaying_the_impulses_gives_the_velocities(name, kernel):
    beads, rules, events, record = between_events(name, kernel)
    replayed = 0
    fixed = np.zeros(BEADS, dtype=bool)
    for k, event in enumerate(events):
        v, after = record.velocities[k].copy(), record.velocities[k + 1]
        i, j = event['bead'], event['partner']
        bodies = bodies_of(record, k)
        masses = np.array([beads.masses[bodies == body].sum() for body in bodies])
        per_mass = np.where(fixed, 0.0, 1.0 / masses)
        places = record.positions[k] + v * (event['time'] - record.times[k])
        if event['kind'] in ('pair', 'merge'):
            apart = to_nearest(places[j] - places[i], rules.box, rules.periodic)
            reach = beads.radii[i] + beads.radii[j]
            assert abs(np.linalg.norm(apart) / reach - 1.0) < PRECISION
            u = v[j] - v[i]
            normal = apart / np.linalg.norm(apart)
            assert abs(event['normal_speed'] + u @ normal) < PRECISION
            push = normal if event['kind'] == 'pair' else -u / np.linalg.norm(u)
            v[bodies == bodies[i]] -= event['impulse'] * per_mass[i] * push
            v[bodies == bodies[j]] += event['impulse'] * per_mass[j] * push
            if event['kind'] == 'merge' and (fixed[i] or fixed[j]):
                fixed |= np.isin(bodies, [bodies[i], bodies[j]])
        else:
            axis, outward = j // 2, 2 * (j % 2) - 1
            if event['kind'] == 'fix':
                assert event['impulse'] == pytest.approx(masses[i] * np.linalg.norm(v[i]))
                assert event['normal_speed'] == pytest.approx(abs(v[i, axis]))
                fixed |= bodies == bodies[i]
                v[bodies == bodies[i]] = 0.0
            else:
                v[bodies == bodies[i], axis] -= outward * event['impulse'] / masses[i]
        np.testing.assert_allclose(after, v, atol=PRECISION)
        replayed += 1
    assert replayed >= 20


@pytest.mark.parametrize('kernel', KERNELS)
def test_a_bead_at_a_wall_is_where_that_wall_is(kernel):
    _, rules, events, record = between_events('inelastic', kernel)
    beads = mixture(6, BEADS, rules)
    walls = 0
    for k, event in enumerate(events):
        if event['kind'] == 'wall':
            axis, far = divmod(int(event['partner']), 2)
            i = event['bead']
            since = event['time'] - record.times[k]
            place = record.positions[k, i, axis] + since * record.velocities[k, i, axis]
            radius = beads.radii[i]
            wall = rules.box[axis] - radius if far else radius
            assert abs(place - wall) < PRECISION
            walls += 1
    assert walls > 100


@pytest.mark.parametrize('kernel', KERNELS)
def test_a_long_log_holds_every_event_once(kernel):
    """More events than the log has room for at first, more than once."""
    rules = CollisionRules(box=BOX, restitution=UniformRestitution(mean=0.999, width=0.002))
    gas = HardSphereGas(mixture(7, BEADS, rules), rules, kernel)
    events = gas.follow(1500.0, log=True).events
    assert len(events) > 9000
    assert len(events) == gas.counts.pair + gas.counts.wall
    assert np.sum(events['kind'] == 'pair') == gas.counts.pair
    assert np.all(np.diff(events['time']) >= 0.0)
    assert len(np.unique(events)) == len(events)


@pytest.mark.parametrize('kernel', KERNELS)
def test_the_event_log_does_not_change_the_trajectories(kernel):
    rules = CollisionRules(box=BOX, restitution=0.99)
    beads = mixture(7, BEADS, rules)
    logged, silent = (HardSphereGas(beads, rules, kernel) for _ in range(2))
    record = logged.follow(600.0, [600.0], log=True)
    assert len(record.events) > 4096
    np.testing.assert_array_equal(record.positions, silent.follow(600.0, [600.0]).positions)
