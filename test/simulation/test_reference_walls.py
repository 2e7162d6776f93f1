"""Walls and periodic images of the reference engine, against solutions by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference.cases import ALWAYS, Motion, Rules, energy, gas_of, near


def test_rough_bead_on_a_wall():
    """No spin, v = (2, 0, -1): P_t = 2/7 (1 + 0.75) 2 = 1, which spins it by 5/2 P_t / r."""
    rules = Rules(
        wall_restitution=(1, 1, 1, 1, 0.5, 1),
        tangential_restitution=0.0,
        wall_tangential_restitution=0.75,
    )
    gas = gas_of([(3, 5, 3)], [(2, 0, -1)], radii=0.5, rules=rules)
    event = gas.step()
    assert (event.kind, event.partner, event.time) == ('wall', 4, near(2.5))
    assert gas.velocities[0] == near([1.0, 0.0, 0.5])
    assert gas.spins[0] == near([0.0, 5.0, 0.0])
    slip = gas.velocities[0, 0] - 0.5 * gas.spins[0, 1]
    assert slip == near(-0.75 * 2.0)
    assert event.impulse == near(math.hypot(1.5, 1.0))
    assert gas.ledger.wall_momentum == near([0, 0, 0, 0, -1.5, 0])
    assert gas.ledger.energy_lost_at_walls == near(2.5 - 0.625 - 0.5 * 0.1 * 25)


def test_a_bead_back_at_the_same_wall_soon_bounces_elastically():
    """Restitution 1/2, side 4: the contacts come at 1, 5, 13 and 21 s, t_c is 13 s."""
    rules = Rules(box=(4, 10, 10), wall_restitution=0.5, contact_duration=13.0)
    gas = gas_of([(2, 5, 5)], [(1, 0, 0)], rules=rules)
    events = [(gas.step().time, gas.velocities[0, 0]) for _ in range(4)]
    expected = [(1, -0.5), (5, 0.25), (13, -0.25), (21, 0.125)]
    assert np.array(events) == near(np.array(expected, dtype=float))


@pytest.mark.parametrize('inward', [1, -1])
def test_a_shaken_wall_hits_when_it_gets_there_and_adds_energy(inward):
    """The wall is met where a fine scan first finds it past the surface of the bead."""
    motion = Motion((0, 0, inward * 0.3), angular_frequency=7.0, damping=0.2, start=0.5, end=20.0)
    place = 5.0 - inward * 3.0
    gas = gas_of([(5, 5, place)], [(0, 0, -0.4 * inward)], rules=Rules(motion=motion))

    def wall(t):
        return 0.3 * np.exp(-0.2 * (t - 0.5)) * np.sin(7 * (t - 0.5)) * (t >= 0.5)

    times = np.arange(0.0, 5.0, 1e-6)
    first = times[np.argmax(2.0 - 0.4 * times - 1.0 <= wall(times))]
    event = gas.step()
    assert event.time == pytest.approx(first, abs=1e-6)
    assert 1.0 - 0.4 * event.time == near(wall(event.time))
    h = 1e-6
    speed = (wall(event.time + h) - wall(event.time - h)) / (2 * h)
    assert event.speed == pytest.approx(speed + 0.4, abs=1e-8)
    assert gas.velocities[0, 2] * inward == pytest.approx(2 * speed + 0.4, abs=1e-7)
    assert gas.ledger.energy_lost_at_walls == near(0.5 * 0.4**2 - energy(gas))
    assert gas.ledger.energy_lost_at_walls < 0.0


def test_a_pressed_bead_leaves_the_wall_again_and_again_at_its_least_speed():
    """It catches up with the wall at 7 t = 1.96, is pressed until 7 t = pi and then thrown.

    Without restitution it leaves by A w² t_c / 2 each time, so no flight is shorter than t_c.
    """
    motion = Motion((0, 0, -0.3), angular_frequency=7.0, end=3.0)
    rules = Rules(wall_restitution=0.0, motion=motion, contact_duration=1e-3)
    gas = gas_of([(5, 5, 1)], [(0, 0, -1)], rules=rules)
    times = [gas.step().time]
    assert math.sin(7 * times[0]) == near(times[0] / 0.3)
    assert 1.9 < 7 * times[0] < 2.0
    least = 0.3 * 49 * 1e-3 / 2
    assert gas.velocities[0, 2] == near(-2.1 * math.cos(7 * times[0]) + least)
    events = gas.run_until(1.0)
    times += [event.time for event in events]
    assert len(events) > 20
    assert {event.partner for event in events} == {4}
    assert np.diff(times).min() >= 1e-3
    assert gas.velocities[0, 2] == pytest.approx(2.1, rel=1e-2)


def test_every_wall_of_a_stopped_tray_is_at_rest():
    motion = Motion((0, 0, 0.1), angular_frequency=2 * math.pi, end=2.0)
    gas = gas_of([(5, 5, 5)], [(0, 0, -1)], rules=Rules(motion=motion))
    event = gas.step()
    assert (event.time, gas.velocities[0, 2]) == near((4.0, 1.0))


def test_a_periodic_pair_meets_through_the_nearest_image():
    rules = Rules(periodic=ALWAYS)
    gas = gas_of([(1, 5, 5), (8, 5, 5)], [(-0.25, 0, 0), (0.25, 0, 0)], rules=rules)
    event = gas.step()
    assert (event.kind, event.time) == ('pair', near(2.0))
    assert gas.velocities[:, 0] == near([0.25, -0.25])
    assert gas.positions[:, 0] == near([0.5, 8.5])


def test_a_long_flight_passes_many_images():
    """Bead 1 climbs 1/8 a period per period and starts 4 from the row of bead 0."""
    rules = Rules(periodic=ALWAYS)
    gas = gas_of([(5, 1, 5), (3, 6, 5)], [(0, 0, 0), (4, 0.05, 0)], rules=rules)
    event = gas.step()
    scan = np.arange(0.0, 100.0, 1e-5)
    x = (3 + 4 * scan - 5 + 5) % 10 - 5
    y = (6 + 0.05 * scan - 1 + 5) % 10 - 5
    assert event.time == pytest.approx(scan[np.argmax(x**2 + y**2 <= 4)], abs=1e-5)
    assert event.time > 50.0


def test_beads_without_contact_do_not_change():
    gas = gas_of([(2, 2, 2), (6, 6, 6)], [(1, 0, 0), (1, 0, 0)], rules=Rules(periodic=ALWAYS))
    assert gas.step(1000.0) is None
    assert gas.time == 0.0
    assert gas.run_until(1000.0) == []
    assert gas.positions[:, 0] == near([1002.0, 1006.0])
    assert gas.at(1001.0)[:, 0] == near([1003.0, 1007.0])
