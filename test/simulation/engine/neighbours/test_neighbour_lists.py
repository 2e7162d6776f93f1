"""Neighbour lists: they grow when they overflow, and hold for mixtures, slits and small boxes."""

from __future__ import annotations

import numpy as np
import pytest
from gases import ALWAYS, NEVER, beads_of, energy, gas_of, placed, smallest_gap

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.kernel_choice import MOST_FOR_SCAN, Kernel
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules


def first_events(beads, rules, kernel, n):
    """The gas a little before its event n, and its events until then."""
    gas = HardSphereGas(beads, rules, kernel)
    events = []
    while sum(map(len, events)) <= n:
        events.append(gas.follow(gas.now + 0.05, log=True).events)
    events = np.concatenate(events)
    end = 0.5 * (events['time'][n - 1] + events['time'][n])
    gas = HardSphereGas(beads, rules, kernel)
    return gas, gas.follow(end, [end], log=True)


def lists_that_agree(beads, rules, events_per_bead=1):
    """Follow with both kernels until short of chaos; the gas in lists."""
    scan, expected = first_events(
        beads, rules, Kernel.SCAN, int(events_per_bead * len(beads.radii))
    )
    lists = HardSphereGas(beads, rules, Kernel.LISTS)
    record = lists.follow(scan.now, [scan.now], log=True)
    for field in ('kind', 'bead', 'partner'):
        np.testing.assert_array_equal(record.events[field], expected.events[field])
    for field in ('time', 'normal_speed', 'impulse'):
        np.testing.assert_allclose(record.events[field], expected.events[field], atol=1e-6)
    np.testing.assert_allclose(record.positions, expected.positions, atol=1e-6)
    return lists


def on_a_grid(shape, spacing, radii, seed=1):
    """Beads at the nodes of a grid from the origin, each with a random velocity."""
    cells = np.array(list(np.ndindex(*shape)), dtype=float)
    radii = np.broadcast_to(radii, len(cells))
    velocities = np.random.default_rng(seed).normal(size=cells.shape)
    return beads_of((cells + 0.5) * spacing, velocities, radii=radii, masses=radii**3)


def most_in_a_list(gas):
    return gas._state.neighbours.shape[1] - 1


def most_in_a_cell(gas):
    return gas._state.cells.shape[1] - 1


@pytest.mark.parametrize('periodic', [NEVER, ALWAYS, (True, False, True)])
@pytest.mark.parametrize(('spacing', 'events_per_bead'), [(2.05, 4), (3.0, 2), (7.0, 0.7)])
def test_lists_agree_with_the_scan(periodic, spacing, events_per_bead):
    """From half full to one part in a hundred, where chaos comes sooner; sizes from 0.5 to 1."""
    radii = np.random.default_rng(2).uniform(0.5, 1.0, 6 * 5 * 5)
    rules = CollisionRules(
        box=(6 * spacing, 5 * spacing, 5 * spacing),
        periodic=periodic,
        restitution=0.9,
        wall_restitution=0.8,
    )
    gas = lists_that_agree(on_a_grid((6, 5, 5), spacing, radii), rules, events_per_bead)
    assert gas.counts.renewed > 100
    assert gas._state.neighbours[:, 0].mean() < 40


def test_lists_of_a_dense_cluster_in_a_wide_box_have_more_room_from_the_start():
    """Lists reach as far as suits the mean density; here one is far above it."""
    cluster = on_a_grid((5, 5, 5), 2.01, 1.0)
    rules = CollisionRules(box=(60, 60, 60), restitution=0.9)
    gas = lists_that_agree(cluster, rules, events_per_bead=3)
    assert most_in_a_list(gas) > 40
    assert most_in_a_cell(gas) > 5


@pytest.mark.parametrize('sticking_speed', [0.0, 1.0])
@pytest.mark.parametrize('periodic', [NEVER, ALWAYS])
def test_lists_that_overflow_on_the_way_grow(periodic, sticking_speed):
    """Beads far from one another fly to one place."""
    grid = on_a_grid((6, 6, 6), 8.0, 0.5)
    centre = np.full(3, 24.0)
    inwards = 0.3 * (centre - grid.positions) + 0.01 * grid.velocities
    beads = beads_of(grid.positions, inwards, radii=0.5)
    rules = CollisionRules(
        box=(48, 48, 48),
        periodic=periodic,
        restitution=0.5,
        sticking_speed=sticking_speed,
        aggregate_motion='translating',
    )
    room = most_in_a_list(HardSphereGas(beads, rules, Kernel.LISTS))
    gas = lists_that_agree(beads, rules, events_per_bead=2)
    assert most_in_a_list(gas) > room
    record = gas.follow(gas.now + 20.0, np.linspace(gas.now, gas.now + 20.0, 21))
    assert smallest_gap(record.positions, gas.radii, rules) > -1e-10
    assert energy(gas.beads()) + gas.ledger[:3].sum() == pytest.approx(energy(beads), rel=1e-12)


@pytest.mark.parametrize('periodic', [NEVER, ALWAYS])
def test_many_small_beads_surround_one_five_times_their_size(periodic):
    random = np.random.default_rng(4)
    radii = np.append(5.0, np.ones(300))
    box = (30.0, 29.0, 28.0)
    places = placed(random, radii, box, periodic)
    beads = beads_of(places, random.normal(size=places.shape), radii=radii, masses=radii**3)
    rules = CollisionRules(box=box, periodic=periodic, restitution=0.95)
    gas = lists_that_agree(beads, rules)
    assert gas._state.neighbours[:, 0].max() > 8


@pytest.mark.parametrize(
    ('box', 'periodic'),
    [
        ((60, 50, 2.01), NEVER),
        ((60, 50, 2.01), (True, True, False)),
        ((600, 2.5, 2.2), NEVER),
        ((600, 2.5, 2.2), (True, False, False)),
    ],
)
def test_slits_and_tubes_hardly_wider_than_a_bead(box, periodic):
    random = np.random.default_rng(5)
    places = placed(random, np.ones(100), box, periodic)
    beads = beads_of(places, random.normal(size=places.shape))
    rules = CollisionRules(box=box, periodic=periodic, restitution=0.95, wall_restitution=0.97)
    gas = lists_that_agree(beads, rules, events_per_bead=4)
    assert gas.counts.wall > 200


def test_a_bead_much_faster_than_all_others_is_never_missed():
    beads = on_a_grid((5, 5, 5), 5.0, 1.0)
    velocities = 1e-3 * beads.velocities
    velocities[62] = 100.0, 63.0, 37.0
    beads = beads_of(beads.positions, velocities, masses=np.where(np.arange(125) == 62, 1e3, 1.0))
    rules = CollisionRules(box=(25, 25, 25), periodic=ALWAYS)
    gas = lists_that_agree(beads, rules, events_per_bead=0.2)
    assert gas.counts.renewed > gas.counts.pair


@pytest.mark.parametrize('size', [1e3, 1e6])
def test_beads_far_from_the_origin_meet_all_the_same(size):
    """References are kept in single precision: a number of a million has steps of 1/16."""
    random = np.random.default_rng(6)
    missed = 0
    for _ in range(100):
        place = random.uniform(0.4, 0.9, 3) * size
        direction = random.normal(size=3)
        direction /= np.linalg.norm(direction)
        aside = np.cross(direction, random.normal(size=3))
        aside *= 1.999 / np.linalg.norm(aside)
        places = [place, place + 6.0 * direction + aside]
        gas = gas_of(
            places, [1.7 * direction, 0 * direction], box=(size,) * 3, kernel=Kernel.LISTS
        )
        gas.run_until(5.0)
        missed += gas.counts.pair == 0
    assert missed == 0


@pytest.mark.parametrize('n', [1, 2, 3])
def test_lists_may_be_asked_for_with_hardly_any_beads(n):
    grid = on_a_grid((n, 1, 1), 2.5, 1.0)
    rules = CollisionRules(box=(2.5 * n, 2.5, 2.5), restitution=0.9)
    gas = lists_that_agree(grid, rules, events_per_bead=8)
    assert gas.kernel == Kernel.LISTS


@pytest.mark.parametrize(
    ('n', 'kernel'), [(MOST_FOR_SCAN, Kernel.SCAN), (MOST_FOR_SCAN + 1, Kernel.LISTS)]
)
def test_the_kernel_is_chosen_by_the_number_of_beads(n, kernel):
    gas = gas_of(
        3.0 * np.eye(n, 3) + 3.0 * np.arange(n)[:, np.newaxis] + 2,
        np.zeros((n, 3)),
        box=(3 * n + 10,) * 3,
    )
    assert gas.kernel == kernel


def test_a_periodic_box_too_small_for_lists_is_scanned_and_lists_are_refused():
    beads = on_a_grid((10, 10, 1), 4.05, 1.0)
    rules = CollisionRules(box=(40.5, 40.5, 4.05), periodic=ALWAYS)
    gas = HardSphereGas(beads, rules)
    assert gas.kernel == Kernel.SCAN
    record = gas.follow(30.0, np.linspace(0.0, 30.0, 31))
    assert gas.counts.pair > 100
    assert smallest_gap(record.positions, beads.radii, rules) > -1e-10
    with pytest.raises(SimulationError, match='periodic box is too small for lists; use the scan'):
        HardSphereGas(beads, rules, Kernel.LISTS)


def test_lists_need_some_hundreds_of_bytes_a_bead():
    rules = CollisionRules(box=(30, 30, 30))
    gas = HardSphereGas(on_a_grid((10, 10, 10), 3.0, 1.0), rules)
    gas.run_until(1.0)
    assert gas.bytes_per_bead < 500
