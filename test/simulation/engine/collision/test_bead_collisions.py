"""Collisions of smooth beads with each other and with walls, against solutions by hand."""

from __future__ import annotations

import numpy as np
import pytest
from gases import ALWAYS, KERNELS, gas_of, near

pytestmark = pytest.mark.parametrize('kernel', KERNELS)


def event_list(record):
    return [(row['kind'].item(), row['bead'], row['partner']) for row in record.events]


@pytest.mark.parametrize('restitution', [0.0, 0.5, 0.89, 1.0])
def test_two_beads_collide_head_on(kernel, restitution):
    """Gap 2, closing speed 1.6: after 1.25 s. Their centre of mass moves at -0.2."""
    gas = gas_of(
        [(3, 5, 5), (7, 5, 5)],
        [(1, 0, 0), (-0.6, 0, 0)],
        masses=[1, 3],
        restitution=restitution,
        kernel=kernel,
    )
    record = gas.follow(1.5, [1.2499999, 1.2500001, 1.5], log=True)
    after = -0.2 - 1.2 * restitution, -0.2 + 0.4 * restitution
    assert record.velocities[0, :, 0] == near([1, -0.6])
    assert record.velocities[1, :, 0] == near(after)
    assert not record.velocities[..., 1:].any()
    assert record.positions[2, :, 0] == near([4.25 + 0.25 * after[0], 6.25 + 0.25 * after[1]])
    assert event_list(record) == [('pair', 0, 1)]
    reduced = 0.75
    event = record.events[0]
    assert event['time'] == near(1.25)
    assert event['normal_speed'] == near(1.6)
    assert event['impulse'] == near(reduced * (1 + restitution) * 1.6)
    lost = 0.5 * reduced * (1 - restitution**2) * 1.6**2
    assert gas.ledger[:3] == near([lost, 0, 0])


def test_an_oblique_collision_changes_the_normal_velocity_alone(kernel):
    """Contact at 3-4-5: the reach is 2, the normal (0.8, 0.6), the impulse 3/4 3/2 4 = 4.5."""
    gas = gas_of(
        [(2, 5, 5), (6.6, 6.2, 5)],
        [(5, 0, 0), (0, 0, 0)],
        masses=[1, 3],
        restitution=0.5,
        kernel=kernel,
    )
    record = gas.follow(0.7, [0.6, 0.7], log=True)
    assert record.events['time'] == near([0.6])
    assert record.events['normal_speed'] == near([4.0])
    assert record.events['impulse'] == near([4.5])
    assert record.positions[0] == near(np.array([(5, 5, 5), (6.6, 6.2, 5)]))
    assert record.velocities[1] == near(np.array([(1.4, -2.7, 0), (1.2, 0.9, 0)]))


def test_beads_that_pass_at_a_distance_do_not_collide(kernel):
    gas = gas_of([(2, 5, 5), (8, 7.0000001, 5)], [(1, 0, 0), (-1, 0, 0)], kernel=kernel)
    gas.run_until(6.0)
    assert gas.counts.pair == 0


def test_a_graze_just_within_reach_turns_beads_by_next_to_nothing(kernel):
    """Offset (1 - 1e-8) of the reach: normal speed 2 sqrt(2e-8) = 2.83e-4."""
    gas = gas_of([(2, 5, 5), (8, 7 - 2e-8, 5)], [(1, 0, 0), (-1, 0, 0)], kernel=kernel)
    record = gas.follow(4.0, [4.0], log=True)
    assert event_list(record) == [('pair', 0, 1)]
    closing = 2.0 * np.sqrt(1.0 - (1.0 - 1e-8) ** 2)
    assert record.events['normal_speed'] == pytest.approx([closing], rel=1e-6)
    assert record.velocities[0, 0, 1] == pytest.approx(-closing, rel=1e-6)


def test_touching_beads_that_separate_do_not_collide(kernel):
    gas = gas_of([(4, 5, 5), (6, 5, 5)], [(-1, 0, 0), (1, 0, 0)], kernel=kernel)
    gas.run_until(2.5)
    assert gas.counts.pair == 0


def test_three_in_a_row_with_restitution_one_half(kernel):
    """0 hits 1 after 3/8 s, 1 hits 2 after 2/3 s more; the gap 4/3 then closes at 1/4."""
    gas = gas_of(
        [(1.5, 5, 5), (5, 5, 5), (9, 5, 5)],
        [(4, 0, 0), (0, 0, 0), (0, 0, 0)],
        box=(40, 10, 10),
        restitution=0.5,
        kernel=kernel,
    )
    record = gas.follow(7.0, [7.0], log=True)
    assert event_list(record) == [('pair', 0, 1), ('pair', 1, 2), ('pair', 0, 1)]
    assert record.events['time'] == near([3 / 8, 3 / 8 + 2 / 3, 3 / 8 + 2 / 3 + 16 / 3])
    assert record.events['normal_speed'] == near([4.0, 3.0, 0.25])
    assert record.velocities[0, :, 0] == near([0.8125, 0.9375, 2.25])


def test_a_row_of_touching_beads_hands_the_speed_on_at_one_instant(kernel):
    gas = gas_of(
        [(1.5, 5, 5), (5, 5, 5), (7, 5, 5)], [(3, 0, 0), (0, 0, 0), (0, 0, 0)], kernel=kernel
    )
    record = gas.follow(0.6, [0.6], log=True)
    assert event_list(record) == [('pair', 0, 1), ('pair', 1, 2)]
    assert record.events['time'] == near([0.5, 0.5])
    assert record.velocities[0, :, 0] == near([0, 0, 3])


def test_of_two_beads_that_are_hit_at_once_the_lower_number_is_hit_first(kernel):
    """Normals (0.8, ±0.6) at speed 5: closing 4, then 2.88."""
    gas = gas_of(
        [(2, 5, 5), (6.6, 6.2, 5), (6.6, 3.8, 5)],
        [(5, 0, 0), (0, 0, 0), (0, 0, 0)],
        kernel=kernel,
    )
    record = gas.follow(0.7, [0.7], log=True)
    assert event_list(record) == [('pair', 0, 1), ('pair', 0, 2)]
    assert record.events['time'] == near([0.6, 0.6])
    expected = np.array([(-0.504, -0.672, 0), (3.2, 2.4, 0), (2.304, -1.728, 0)])
    assert record.velocities[0] == near(expected)


@pytest.mark.parametrize('axis', [0, 1, 2])
@pytest.mark.parametrize('side', [0, 1])
def test_a_bead_leaves_each_wall_with_the_restitution_of_that_wall(kernel, axis, side):
    """Four from the wall at speed 1; 2 after 4 s it is 2 epsilon away from it again."""
    of_walls = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4)
    wall = 2 * axis + side
    outward = 2 * side - 1
    velocity = np.full(3, 0.125)
    velocity[axis] = outward
    gas = gas_of([(5, 5, 5)], [velocity], wall_restitution=of_walls, masses=2.0, kernel=kernel)
    record = gas.follow(6.0, [6.0], log=True)
    assert event_list(record) == [('wall', 0, wall)]
    expected = np.full(3, 5 + 6 * 0.125)
    expected[axis] = 5 + outward * (4 - 2 * of_walls[wall])
    assert record.positions[0, 0] == near(expected)
    velocity[axis] *= -of_walls[wall]
    assert record.velocities[0, 0] == near(velocity)
    assert gas.ledger[1] == near(1 - of_walls[wall] ** 2)
    given = np.zeros(6)
    given[wall] = 2 * (1 + of_walls[wall])
    assert gas.ledger[3:9] == near(given)
    assert gas.ledger[9 + axis] == near(outward * given[wall])


def test_a_bead_in_a_corner_meets_three_walls_one_after_the_other(kernel):
    gas = gas_of([(5, 5, 5)], [(1, 1, 1)], wall_restitution=0.5, kernel=kernel)
    record = gas.follow(5.0, [4.0, 5.0], log=True)
    assert event_list(record) == [('wall', 0, 1), ('wall', 0, 3), ('wall', 0, 5)]
    assert record.positions[0, 0].tolist() == [9.0, 9.0, 9.0]
    assert record.velocities[1, 0].tolist() == [-0.5, -0.5, -0.5]


def test_a_bead_meets_a_wall_before_a_bead_that_it_meets_at_the_same_instant(kernel):
    """It moves along x and y by 1; both contacts come after exactly 1 s."""
    gas = gas_of([(8, 2, 5), (9, 5, 5)], [(1, 1, 0), (0, 0, 0)], kernel=kernel)
    record = gas.follow(1.0, [1.0], log=True)
    assert event_list(record) == [('wall', 0, 1), ('pair', 0, 1)]
    assert record.velocities[0].tolist() == [[-1, 0, 0], [0, 1, 0]]


def test_a_frame_at_the_instant_of_a_collision_shows_what_is_after_it(kernel):
    gas = gas_of([(0.5, 0.5, 0.5)], [(0.25, 0, 0)], radii=0.25, box=(1, 1, 1), kernel=kernel)
    record = gas.follow(2.0, [1.0], [1.0])
    assert record.positions[0, 0, 0] == 0.75
    assert record.velocities[0, 0, 0] == -0.25
    assert record.observations.wall_collisions.tolist() == [1]


@pytest.mark.parametrize('apart', [4.0, 7.0, 9.0, 9.9])
@pytest.mark.parametrize('axis', [0, 1, 2])
def test_beads_that_part_in_a_periodic_box_meet_on_its_other_side(kernel, apart, axis):
    side = 20.0
    places = np.full((2, 3), 5.0)
    places[1, axis] += apart
    velocities = np.zeros((2, 3))
    velocities[:, axis] = -1.0, 1.0
    gas = gas_of(places, velocities, box=(side,) * 3, periodic=ALWAYS, kernel=kernel)
    meeting = (side - apart - 2.0) / 2.0
    record = gas.follow(meeting + 0.5, [meeting + 0.5], log=True)
    assert event_list(record) == [('pair', 0, 1)]
    assert record.events['time'] == near([meeting])
    assert record.velocities[0, :, axis] == near([1, -1])
    assert record.positions[0, :, axis] == near([5.5 - meeting, 4.5 + apart + meeting])


@pytest.mark.parametrize('apart', [2.5, 3.9, 4.1, 4.5, 5.0, 5.5])
@pytest.mark.parametrize('axis', [0, 1, 2])
def test_beads_that_approach_across_half_a_periodic_box_meet_in_its_middle(kernel, apart, axis):
    """Whichever image was the nearest when they set out."""
    places = np.full((2, 3), 4.0)
    places[:, axis] = 4.0 - 0.5 * apart, 4.0 + 0.5 * apart
    velocities = np.zeros((2, 3))
    velocities[:, axis] = 1.0, -1.0
    gas = gas_of(places, velocities, box=(8, 8, 8), periodic=ALWAYS, kernel=kernel)
    meeting = 0.5 * (apart - 2.0)
    record = gas.follow(meeting + 0.5, [meeting + 0.5], log=True)
    assert event_list(record) == [('pair', 0, 1)]
    assert record.events['time'] == near([meeting])
    assert record.positions[0, :, axis] == near([2.5, 5.5])


def test_a_long_flight_passes_many_images(kernel):
    """Bead 1 climbs 1/8 a box on each round, and is four below the row of bead 0's images."""
    gas = gas_of(
        [(5, 1, 5), (3, 6, 5)],
        [(0, 0, 0), (4, 0.05, 0)],
        box=(10, 10, 10),
        periodic=ALWAYS,
        kernel=kernel,
    )
    scan = np.arange(0.0, 100.0, 1e-4)
    x = (3 + 4 * scan - 5 + 5) % 10 - 5
    y = (6 + 0.05 * scan - 1 + 5) % 10 - 5
    record = gas.follow(100.0, log=True)
    assert record.events['time'][0] == pytest.approx(scan[np.argmax(x**2 + y**2 <= 4)], abs=2e-4)
    assert record.events['time'][0] > 50.0
