"""Collisions of rough beads and with moving walls, against solutions by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gases import KERNELS, angular_momentum, energy, gas_of, momentum, near

from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion

pytestmark = pytest.mark.parametrize('kernel', KERNELS)


@pytest.mark.parametrize('tangential', [-1.0, -0.3, 0.0, 0.5, 1.0])
def test_a_spinning_bead_that_hits_another_head_on_turns_it_the_other_way(kernel, tangential):
    """Slip 1; 1/mu_t = 2 + 2 5/2 = 7; the tangential impulse is (1 + beta) / 7."""
    gas = gas_of(
        [(3, 5, 5), (7, 5, 5)],
        [(1, 0, 0), (-1, 0, 0)],
        spins=[(0, 0, 1), (0, 0, 0)],
        tangential_restitution=tangential,
        kernel=kernel,
    )
    before = gas.beads()
    record = gas.follow(1.5, [1.5], log=True)
    rub = (1 + tangential) / 7
    assert record.velocities[0] == near(np.array([(-1, -rub, 0), (1, rub, 0)]))
    assert record.spins[0, :, 2] == near([1 - 2.5 * rub, -2.5 * rub])
    assert record.events['time'] == near([1.0])
    assert record.events['impulse'] == near([math.hypot(2.0, rub)])
    assert gas.ledger[0] == near(0.5 / 7 * (1 - tangential**2))
    after = gas.beads()
    assert energy(after) + gas.ledger[0] == near(energy(before))
    assert angular_momentum(after) == near(angular_momentum(before))


def test_an_oblique_rough_collision_reverses_the_slip_in_part(kernel):
    """Whatever the masses and radii: slip times -beta, closing speed times -epsilon."""
    gas = gas_of(
        [(3, 5, 5), (6, 6, 5.5)],
        [(1, 0.2, 0), (-1, 0.1, 0.3)],
        radii=[1.0, 0.7],
        masses=[1.0, 2.5],
        spins=[(0.3, -1, 2), (1, 1, -3)],
        restitution=0.6,
        tangential_restitution=0.3,
        kernel=kernel,
    )
    before = gas.beads()
    event = gas.follow(2.0, log=True).events[0]
    after = gas.beads()
    places = before.positions + event['time'] * before.velocities
    normal = (places[1] - places[0]) / 1.7

    def surface(beads):
        turning = beads.radii @ beads.spins
        return beads.velocities[1] - beads.velocities[0] - np.cross(turning, normal)

    came, left = surface(before), surface(after)
    assert event['normal_speed'] == near(-came @ normal)
    assert left @ normal == near(-0.6 * came @ normal)
    assert np.cross(left, normal) == near(-0.3 * np.cross(came, normal))
    assert momentum(after) == near(momentum(before))
    assert angular_momentum(after) == near(angular_momentum(before))
    assert energy(after) + gas.ledger[0] == near(energy(before))


@pytest.mark.parametrize('side', [0, 1])
def test_a_rough_wall_sets_a_bead_spinning(kernel, side):
    """Velocity (2, 0, ∓1), no spin: P_t = 2/7 (1 + 3/4) 2 = 1, which spins it by 5/2 P_t / r."""
    inward = 1 - 2 * side
    gas = gas_of(
        [(3, 5, 5 - 2 * inward)],
        [(2, 0, -inward)],
        radii=0.5,
        wall_restitution=(1, 1, 1, 1, 0.5, 0.5),
        wall_tangential_restitution=0.75,
        kernel=kernel,
    )
    record = gas.follow(3.0, [3.0], log=True)
    assert record.events['time'] == near([2.5])
    assert record.velocities[0, 0] == near([1.0, 0.0, 0.5 * inward])
    assert record.spins[0, 0] == near([0.0, 5.0 * inward, 0.0])
    assert record.events['impulse'] == near([math.hypot(1.5, 1.0)])
    assert gas.ledger[1] == near(2.5 - 0.625 - 0.5 * 0.1 * 25)
    assert gas.ledger[3 + 4 + side] == near(1.5)
    assert gas.ledger[9:12] == near([1, 0, -1.5 * inward])


@pytest.mark.parametrize('friction', [0.0, 0.05, 0.06])
def test_surfaces_that_slide_push_by_friction_times_the_normal_impulse(kernel, friction):
    """As head on above: normal impulse 2, slip 1, 1/mu_t = 7; 0.75/7 grips, 0.12 never comes."""
    gas = gas_of(
        [(3, 5, 5), (7, 5, 5)],
        [(1, 0, 0), (-1, 0, 0)],
        spins=[(0, 0, 1), (0, 0, 0)],
        tangential_restitution=-0.25,
        friction=friction,
        kernel=kernel,
    )
    before = gas.beads()
    record = gas.follow(1.5, [1.5], log=True)
    rub = min(2 * friction, 0.75 / 7)
    assert record.velocities[0] == near(np.array([(-1, -rub, 0), (1, rub, 0)]))
    assert record.spins[0, :, 2] == near([1 - 2.5 * rub, -2.5 * rub])
    assert record.events['impulse'] == near([math.hypot(2.0, rub)])
    after = gas.beads()
    assert energy(after) + gas.ledger[0] == near(energy(before))
    assert angular_momentum(after) == near(angular_momentum(before))


@pytest.mark.parametrize('side', [0, 1])
def test_a_bead_slides_along_a_wall_that_it_presses_too_little(kernel, side):
    """As at the rough wall above: normal impulse 1.5, of which 0.4 along the wall and not 1."""
    inward = 1 - 2 * side
    gas = gas_of(
        [(3, 5, 5 - 2 * inward)],
        [(2, 0, -inward)],
        radii=0.5,
        wall_restitution=(1, 1, 1, 1, 0.5, 0.5),
        wall_tangential_restitution=0.75,
        wall_friction=0.4,
        kernel=kernel,
    )
    before = gas.beads()
    record = gas.follow(3.0, [3.0], log=True)
    assert record.velocities[0, 0] == near([1.4, 0.0, 0.5 * inward])
    assert record.spins[0, 0] == near([0.0, 3.0 * inward, 0.0])
    assert energy(gas.beads()) + gas.ledger[1] == near(energy(before))


def test_beads_without_friction_keep_their_spins(kernel):
    spins = [(1, 2, 3), (-1, 0, 2)]
    gas = gas_of(
        [(3, 5, 5), (7, 5.5, 5)],
        [(1, 0, 0), (-1, 0, 0)],
        spins=spins,
        tangential_restitution=-1.0,
        kernel=kernel,
    )
    record = gas.follow(20.0, [20.0])
    assert gas.counts.pair > 0
    assert gas.counts.wall > 0
    assert record.spins[0].tolist() == np.array(spins, dtype=float).tolist()


@pytest.mark.parametrize('axis', [0, 1, 2])
@pytest.mark.parametrize('side', [0, 1])
def test_a_shaken_wall_meets_a_resting_bead_and_throws_it(kernel, axis, side):
    """The wall comes 0.3 sin 7t and is met where the sine is 1/2, at 0.3 7 cos(pi/6)."""
    inward = 1 - 2 * side
    amplitude = np.zeros(3)
    amplitude[axis] = 0.3 * inward
    place = np.full(3, 5.0)
    place[axis] = 5.0 - inward * (4.0 - 0.15)
    motion = WallMotion(amplitude=tuple(amplitude), angular_frequency=7.0)
    gas = gas_of(
        [place], [(0, 0, 0)], masses=3.0, wall_restitution=0.5, motion=motion, kernel=kernel
    )
    record = gas.follow(0.2, [0.2], log=True)
    wall_speed = 2.1 * math.cos(math.pi / 6)
    assert record.events['time'] == near([math.pi / 6 / 7])
    assert record.events['normal_speed'] == near([wall_speed])
    assert (record.events['bead'], record.events['partner']) == ([0], [2 * axis + side])
    assert record.velocities[0, 0, axis] == near(1.5 * wall_speed * inward)
    assert gas.ledger[1] == near(-0.5 * 3 * (1.5 * wall_speed) ** 2)
    assert gas.ledger[9 + axis] == near(-3 * 1.5 * wall_speed * inward)


def test_a_swing_that_dies_away_is_met_where_it_really_is(kernel):
    """Found first by a fine scan of 0.3 exp(-0.2 t) sin 7t, then to rounding."""
    motion = WallMotion(amplitude=(0, 0, 0.3), angular_frequency=7.0, damping=0.2, start=0.5)
    gas = gas_of([(5, 5, 2)], [(0, 0, -0.4)], motion=motion, kernel=kernel)

    def wall(t):
        return 0.3 * np.exp(-0.2 * (t - 0.5)) * np.sin(7 * (t - 0.5)) * (t >= 0.5)

    times = np.arange(0.0, 5.0, 1e-5)
    first = times[np.argmax(1.0 - 0.4 * times <= wall(times))]
    event = gas.follow(3.0, log=True).events[0]
    assert event['time'] == pytest.approx(first, abs=1e-5)
    assert 1.0 - 0.4 * event['time'] == near(wall(event['time']))
    h = 1e-6
    speed = (wall(event['time'] + h) - wall(event['time'] - h)) / (2 * h)
    assert event['normal_speed'] == pytest.approx(speed + 0.4, abs=1e-8)


def test_a_rough_wall_that_slides_takes_a_bead_along(kernel):
    """The tray moves along x while the bead lands on the low z wall after 2 s: P_t = 4/7 slip."""
    motion = WallMotion(amplitude=(0.5, 0, 0), angular_frequency=3.0)
    gas = gas_of(
        [(5, 5, 3)],
        [(0, 0, -1)],
        tangential_restitution=1.0,
        wall_tangential_restitution=1.0,
        motion=motion,
        kernel=kernel,
    )
    record = gas.follow(2.5, [2.5], log=True)
    wall_speed = 1.5 * math.cos(6.0)
    rub = 4 / 7 * wall_speed
    assert record.events['time'] == near([2.0])
    assert record.velocities[0, 0] == near([rub, 0, 1])
    assert record.spins[0, 0] == near([0, -2.5 * rub, 0])
    assert gas.ledger[9:12] == near([-rub, 0, -2])
    assert energy(gas.beads()) + gas.ledger[1] == near(0.5)


def test_a_bead_pressed_by_a_wall_leaves_it_again_and_again_at_its_least_speed(kernel):
    """It lands at 7t = 1.96, is pressed until 7t = pi and thrown; no flight is below t_c.

    Without restitution it leaves by A w² t_c / 2 each time.
    """
    motion = WallMotion(amplitude=(0, 0, -0.3), angular_frequency=7.0, end=3.0)
    gas = gas_of(
        [(5, 5, 1)],
        [(0, 0, -1)],
        wall_restitution=0.0,
        contact_duration=1e-3,
        motion=motion,
        kernel=kernel,
    )
    events = gas.follow(1.0, log=True).events
    first = events['time'][0]
    assert math.sin(7 * first) == near(first / 0.3)
    assert 1.9 < 7 * first < 2.0
    assert len(events) > 20
    assert set(events['partner']) == {4}
    assert np.diff(events['time']).min() >= 1e-3
    assert gas.beads().velocities[0, 2] == pytest.approx(2.1, rel=1e-2)


def test_the_walls_of_a_tray_are_at_rest_before_and_after_its_motion(kernel):
    motion = WallMotion(amplitude=(0, 0, 0.1), angular_frequency=2 * math.pi, start=1.0, end=3.0)
    gas = gas_of(
        [(5, 5, 1.5), (5, 5, 8)], [(0, 0, -1), (0, 0, 0.25)], motion=motion, kernel=kernel
    )
    events = gas.follow(4.5, log=True).events
    assert events['time'] == near([0.5, 4.0])
    assert events['normal_speed'] == near([1.0, 0.25])


def test_a_wall_that_will_move_gives_back_no_more_than_its_restitution_until_then(kernel):
    """The least speed off a shaken wall, here A w² t_c / 2 = 0.37, is for a wall in motion."""
    motion = WallMotion(amplitude=(0.3, 0, 0), angular_frequency=7.0, start=50.0)
    gas = gas_of(
        [(2, 5, 5)],
        [(-0.1, 0, 0)],
        wall_restitution=0.5,
        contact_duration=0.05,
        motion=motion,
        kernel=kernel,
    )
    record = gas.follow(20.0, [20.0], log=True)
    assert record.events['time'] == near([10.0])
    assert record.velocities[0, 0, 0] == near(0.05)
    assert gas.ledger[1] > 0.0


def test_a_bead_at_rest_far_from_a_wall_that_shakes_for_ever_stays_at_rest(kernel):
    motion = WallMotion(amplitude=(0.5, 0, 0), angular_frequency=100.0)
    gas = gas_of([(5, 5, 5)], [(0, 0, 0)], motion=motion, kernel=kernel)
    record = gas.follow(2000.0, [2000.0], log=True)
    assert record.positions[0, 0].tolist() == [5, 5, 5]
    assert len(record.events) == 0
