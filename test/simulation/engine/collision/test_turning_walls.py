"""A rod that turns hits walls, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gases import KERNELS, near
from turning_bodies import MERGING, ROD, rod

from nanorocks_ros.simulation.engine.gas_state import MOMENTUM
from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion

pytestmark = pytest.mark.parametrize('kernel', KERNELS)

ACROSS = 1.4
OMEGA = ACROSS / ROD
HEIGHT = 0.25


@pytest.mark.parametrize('restitution', [1.0, 0.5])
def test_a_rod_that_turns_in_place_hits_a_wall_with_its_end(kernel, restitution):
    """Its centre is 1 + 1/4 above the floor y = 0: the end touches it at sin(angle) = 1/4."""
    gas = rod(
        (10.0, 1.0 + HEIGHT, 10.0),
        (0.0, 0.0, 0.0),
        (ACROSS, 0.0),
        wall_restitution=restitution,
        kernel=kernel,
    )
    angle = math.asin(HEIGHT)
    event = gas.follow(MERGING + 1.01 * angle / OMEGA, log=True).events[1]
    assert (event['kind'], event['bead'], event['partner']) == ('wall', 0, 2)
    assert event['time'] == near(MERGING + angle / OMEGA)
    speed = OMEGA * math.cos(angle)
    mass = 1.0 / (1.0 / 2.0 + math.cos(angle) ** 2 / ROD)
    impulse = (1.0 + restitution) * mass * speed
    assert event['normal_speed'] == near(speed)
    assert event['impulse'] == near(impulse)
    assert gas.momentum[1] == near(impulse)
    # Bead 0 is at -cos(angle) from the centre: an impulse along y slows the rotation.
    assert gas.spins[0, 2] == near(OMEGA - impulse * math.cos(angle) / ROD)
    loss = 0.5 * mass * speed**2 * (1.0 - restitution**2)
    assert gas.ledger[1] == pytest.approx(loss, rel=1e-12, abs=1e-12)


def test_a_wall_that_moves_meets_the_end_of_a_rod(kernel):
    """The far wall comes at once as fast as it ever moves; its contact is found by bisection."""
    motion = WallMotion(
        amplitude=(0.0, -0.6, 0.0), angular_frequency=0.5, start=0.0, end=20.0 * math.pi
    )
    gas = rod((10.0, 18.5, 10.0), (0.0, 0.0, 0.0), (ACROSS, 0.0), motion=motion, kernel=kernel)

    def gap(time):
        end = 18.5 + abs(math.sin(OMEGA * (time - MERGING)))
        return 20.0 - 0.6 * math.sin(0.5 * time) - 1.0 - end

    early, late = MERGING, 1.5
    assert gap(early) > 0.0 > gap(late)
    for _ in range(60):
        middle = 0.5 * (early + late)
        early, late = (middle, late) if gap(middle) > 0.0 else (early, middle)
    event = gas.follow(1.5, log=True).events[1]
    assert (event['kind'], event['bead'], event['partner']) == ('wall', 1, 3)
    assert event['time'] == pytest.approx(late, abs=1e-10)
    wall_speed = -0.3 * math.cos(0.5 * late)
    end_speed = OMEGA * math.cos(OMEGA * (late - MERGING))
    assert event['normal_speed'] == pytest.approx(end_speed - wall_speed, abs=1e-9)


def test_a_slow_end_stops_the_whole_body_at_the_wall(kernel):
    gas = rod(
        (10.0, 1.0 + HEIGHT, 10.0),
        (0.0, 0.0, 0.0),
        (ACROSS, 0.0),
        wall_sticking_speed=0.6,
        kernel=kernel,
    )
    before = gas.energy
    gas.run_until(10.0)
    assert gas.stuck.all()
    assert not gas.beads().velocities.any()
    assert not gas.spins.any()
    apart = np.subtract(*gas.beads().positions)
    assert np.linalg.norm(apart) == near(2.0)
    assert gas.ledger[:3].sum() == near(before)


@pytest.mark.parametrize('restitution', [0.0, 0.3, 0.9])
def test_a_rod_that_rocks_between_close_walls_ends_no_run(kernel, restitution):
    """Both ends hit floor and lid in turn, thousands of times, without an end of progress."""
    gas = rod(
        (10.0, 1.05, 10.0),
        (0.3, 0.02, 0.2),
        (0.15, 0.0),
        box=(20.0, 2.1, 20.0),
        wall_restitution=restitution,
        kernel=kernel,
    )
    times = np.linspace(MERGING, 300.0, 3001)
    record = gas.follow(300.0, times, most_events=200_000)
    assert gas.counts.wall > 10
    low, high = record.positions[..., 1].min(), record.positions[..., 1].max()
    assert low > 1.0 - 1e-10
    assert high < 1.1 + 1e-10
    energies = 0.5 * (record.velocities**2).sum(axis=(1, 2))
    energies += 0.5 * 0.4 * (record.spins**2).sum(axis=(1, 2))
    assert np.all(np.diff(energies) < 1e-12)


def test_a_wall_takes_what_the_gas_has_left_of_the_momentum_of_a_body_that_sticks(kernel):
    rate, velocity = 0.02, np.array([0.0, 0.4, 0.1])
    gas = rod(
        np.array([10.0, 9.0, 8.0]),
        velocity,
        (0.1, 0.0),
        kernel=kernel,
        wall_sticking_speed=1.0,
        drag=np.full(2, rate),
    )
    events = gas.follow(80.0, log=True).events
    assert list(events['kind']) == ['merge', 'fix']
    left = 2.0 * velocity * np.exp(-rate * events['time'][1])
    np.testing.assert_allclose(gas.ledger[MOMENTUM : MOMENTUM + 3], left, atol=1e-13)
    assert gas.energy == 0.0
