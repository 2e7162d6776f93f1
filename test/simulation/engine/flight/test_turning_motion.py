"""Bodies turn freely: their shape, constants of the motion, and paths against Runge-Kutta."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gases import KERNELS, mixture
from stepped_bodies import SteppedBodies
from turning_bodies import MERGING, ROD, rod, spin_of_rod

from nanorocks_ros.simulation.engine import vectors
from nanorocks_ros.simulation.engine.flight.turning_motion import FROM, UNTIL, rotated
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.kernel_choice import Kernel
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

BOX = (40.0, 40.0, 40.0)


def cluster(kernel=Kernel.SCAN, seed=1):
    """Five beads of different sizes that fly together in a large box and stick at once."""
    random = np.random.default_rng(seed)
    beads = mixture(seed, 5, CollisionRules(box=(5.0, 5.0, 5.0)))
    middle = beads.positions.mean(axis=0)
    beads.positions[:] += 0.5 * np.array(BOX) - middle
    beads.velocities[:] = middle + 0.5 * np.array(BOX) - beads.positions - middle
    beads.velocities[:] += 0.5 * random.normal(size=(5, 3))
    rules = CollisionRules(box=BOX, sticking_speed=50.0)
    gas = HardSphereGas(beads, rules, kernel)
    gas.run_until(2.5)
    assert np.unique(gas.bodies).size == 1
    return gas


def test_vectors_are_those_of_numpy():
    a, b = (1.0, -2.0, 0.5), (0.25, 3.0, -1.0)
    assert vectors.cross(a, b) == pytest.approx(np.cross(a, b))
    assert vectors.product(a, b) == pytest.approx(np.dot(a, b))
    assert vectors.length(a) == pytest.approx(np.linalg.norm(a))
    assert vectors.difference(a, b) == pytest.approx(np.subtract(a, b))
    assert vectors.sum_of(a, b) == pytest.approx(np.add(a, b))
    assert vectors.scaled(a, 2.0) == pytest.approx(np.multiply(a, 2.0))


def test_a_quaternion_of_any_length_turns_a_vector():
    angle = 0.7
    q = 3.0 * math.cos(angle / 2), 0.0, 0.0, 3.0 * math.sin(angle / 2)
    expected = math.cos(angle), math.sin(angle), 2.0
    assert rotated(q, (1.0, 0.0, 2.0)) == pytest.approx(expected)


@pytest.mark.parametrize('kernel', KERNELS)
@pytest.mark.parametrize('across', [(0.3, 0.0), (0.1, -0.4)])
def test_a_rod_turns_about_its_centre(kernel, across):
    """About a fixed axis with a constant angular velocity: places by sine and cosine."""
    centre, velocity = np.array([10.0, 9.0, 8.0]), np.array([0.02, 0.05, -0.03])
    gas = rod(centre, velocity, across, kernel=kernel)
    times = MERGING + np.linspace(0.0, 60.0, 31)
    record = gas.follow(times[-1], times)
    assert gas.counts.merge == 1
    assert gas.counts.wall == 0
    spin = spin_of_rod(across)
    since = (times - MERGING)[:, np.newaxis]
    angle = np.linalg.norm(spin) * since
    towards = np.cross(spin, [1.0, 0.0, 0.0]) / np.linalg.norm(spin)
    arm = np.cos(angle) * np.array([1.0, 0.0, 0.0]) + np.sin(angle) * towards
    for bead, sign in ((0, -1.0), (1, 1.0)):
        places = centre + velocity * since + sign * arm
        np.testing.assert_allclose(record.positions[:, bead], places, atol=1e-12)
        speeds = velocity + sign * np.cross(spin, arm)
        np.testing.assert_allclose(record.velocities[:, bead], speeds, atol=1e-12)
        np.testing.assert_allclose(record.spins[:, bead], np.tile(spin, (31, 1)), atol=1e-12)


@pytest.mark.parametrize('kernel', KERNELS)
def test_a_gas_slows_a_rod_and_its_turning_until_it_rests(kernel):
    """By the forces on both beads at their arms of length 1, and by the torques on their spins.

    A bead that turns about its own centre slows 10/3 times as fast as one that moves, with the
    moment of inertia 2/5.
    """
    rate, across = 0.2, (0.3, -0.1)
    centre, velocity = np.array([10.0, 9.0, 8.0]), np.array([0.02, 0.05, -0.03])
    gas = rod(centre, velocity, across, kernel=kernel, drag=np.full(2, rate))
    start = gas.follow(1.0, [1.0])
    assert gas.counts.merge == 1
    turning = rate * (2.0 * 1.0 + 2.0 * 10.0 / 3.0 * 0.4) / ROD
    times = 1.0 + np.linspace(0.0, 30.0, 16)
    record = gas.follow(times[-1], times)
    since = (times - 1.0)[:, np.newaxis]
    spun = np.exp(-turning * since) * start.spins[0, 0]
    np.testing.assert_allclose(record.spins[:, 0], spun, atol=1e-13)
    moved = record.velocities.mean(axis=1)
    expected = np.exp(-rate * since) * moved[0]
    np.testing.assert_allclose(moved, expected, atol=1e-14)
    assert moved[0] == pytest.approx(velocity * math.exp(-rate * times[0]), rel=1e-12)
    events = gas.follow(1e5, [1e5], log=True)
    assert events.events.size == 0
    assert not events.spins.any()
    gone = record.positions[0].mean(axis=0) + moved[0] / rate
    np.testing.assert_allclose(events.positions[0].mean(axis=0), gone, atol=1e-12)


def test_a_body_of_any_shape_keeps_shape_energy_and_angular_momentum():
    gas = cluster()
    before = gas.beads()
    constants = gas.energy, gas.momentum, gas.angular_momentum
    apart = np.linalg.norm(before.positions[:, np.newaxis] - before.positions, axis=2)
    spins = gas.spins
    times = gas.now + np.linspace(0.0, 4.0, 9)
    record = gas.follow(times[-1], times)
    assert gas.counts.wall == 0
    for places in record.positions:
        now_apart = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
        np.testing.assert_allclose(now_apart, apart, atol=1e-13)
    after = gas.energy, gas.momentum, gas.angular_momentum
    for old, new in zip(constants, after, strict=True):
        np.testing.assert_allclose(new, old, rtol=1e-12, atol=1e-12)
    # The body is no symmetric top: its angular velocity changes.
    assert np.abs(record.spins[-1] - spins).max() > 0.01 * np.abs(spins).max()


def test_a_body_of_any_shape_turns_as_in_small_steps():
    gas = cluster()
    start = gas.beads()
    stepped = SteppedBodies(start, BOX, restitution=1.0, walls=1.0, sticking=0.0)
    body = stepped._body(
        list(range(5)), start.positions, gas.momentum / gas.masses.sum(), np.zeros(3)
    )
    about_origin = np.cross(body.centre, gas.momentum)
    body.moment = gas.angular_momentum - about_origin
    stepped.bodies = [body]
    for _ in range(4):
        stepped.follow(stepped.time + 1.0, 2e-3)
        gas.run_until(gas.now + 1.0)
        places, velocities = stepped.places_and_velocities()
        beads = gas.beads()
        np.testing.assert_allclose(beads.positions, places, atol=1e-9)
        np.testing.assert_allclose(beads.velocities, velocities, atol=1e-9)


def test_the_series_is_exact_at_both_ends_of_a_stretch():
    """The last instant of a stretch and the first of the next show the same place."""
    gas = cluster()
    body = gas.bodies[0]
    compared = 0
    for _ in range(20):
        end = gas._state.motions[body, UNTIL]
        before = np.nextafter(end, 0.0)
        record = gas.follow(end, [before, end])
        if gas.counts.wall:
            break
        assert gas._state.motions[body, FROM] == end
        np.testing.assert_allclose(record.positions[1], record.positions[0], atol=1e-13)
        np.testing.assert_allclose(record.spins[1], record.spins[0], atol=1e-13)
        compared += 1
    assert compared > 3
