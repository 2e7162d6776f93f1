"""Symmetries of the engine: translation, axes, mirror, units, Galilei, time reversal."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from gases import ALL_RULES, ALWAYS, BOX, KERNELS, RULES, mixture, placed
from hypothesis import given, settings
from hypothesis import strategies as st

from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules
from nanorocks_ros.simulation.engine.rules.restitution_laws import ViscoelasticRestitution

pytestmark = pytest.mark.parametrize('kernel', KERNELS)

BEADS = 10
# As many events as leave rounding below this part, in a gas that multiplies it at each.
EVENTS = 20
CHAOS = 1e-6

seeds = st.integers(0, 10**6)
names = st.sampled_from(sorted(ALL_RULES))
few = settings(deadline=None, max_examples=25, derandomize=True)


def gas_and_record(beads, rules, kernel, end=None):
    """Follow for as many events as are compared, or to a time; frames on the way."""
    if end is None:
        events = HardSphereGas(beads, rules, kernel).follow(40.0, log=True).events
        end = events['time'][:EVENTS][-1]
    times = np.linspace(0.0, end, 5)
    # Not at the last event itself: rounding would put it before or after the frame.
    record = HardSphereGas(beads, rules, kernel).follow(end, 0.999 * times, log=True)
    return end, record


def assert_alike(record, second, matrix=None, shift=0.0, spin_matrix=None):
    """Assert that a run record is another one, rotated and shifted."""
    matrix = np.eye(3) if matrix is None else matrix
    np.testing.assert_allclose(second.positions, record.positions @ matrix.T + shift, atol=CHAOS)
    np.testing.assert_allclose(second.velocities, record.velocities @ matrix.T, atol=CHAOS)
    if record.spins is not None:
        matrix = matrix if spin_matrix is None else spin_matrix
        np.testing.assert_allclose(second.spins, record.spins @ matrix.T, atol=CHAOS)
    assert abs(len(second.events) - len(record.events)) <= 1
    for field in ('time', 'normal_speed', 'impulse'):
        n = min(len(second.events), len(record.events))
        assert n >= EVENTS // 2
        np.testing.assert_allclose(second.events[field][:n], record.events[field][:n], atol=CHAOS)


def turned(beads, rules, matrix, shift):
    """Beads and rules seen in axes that are renamed, or reversed."""
    axes = np.abs(matrix).argmax(axis=1)
    signs = matrix.sum(axis=1)
    walls = np.broadcast_to(rules.wall_restitution, 6).reshape(3, 2)[axes]
    walls = np.where(signs[:, np.newaxis] < 0, walls[:, ::-1], walls)
    motion = rules.motion
    if motion is not None:
        motion = replace(motion, amplitude=tuple(matrix @ motion.amplitude))
    rules = replace(
        rules,
        box=tuple(np.array(rules.box)[axes]),
        periodic=tuple(np.array(rules.periodic)[axes].tolist()),
        wall_restitution=tuple(walls.ravel()),
        motion=motion,
    )
    beads = replace(
        beads,
        positions=beads.positions @ matrix.T + shift,
        velocities=beads.velocities @ matrix.T,
        # Spins are turned with space but not reversed with it.
        spins=None if beads.spins is None else beads.spins @ matrix.T * np.linalg.det(matrix),
    )
    return beads, rules


@few
@given(name=names, seed=seeds, order=st.permutations(range(3)))
def test_permuted_axes_permute_the_trajectories(kernel, name, seed, order):
    rules = CollisionRules(box=BOX, **ALL_RULES[name])
    beads = mixture(seed, BEADS, rules)
    matrix = np.eye(3)[list(order)]
    end, record = gas_and_record(beads, rules, kernel)
    _, second = gas_and_record(*turned(beads, rules, matrix, 0.0), kernel, end)
    assert_alike(record, second, matrix, spin_matrix=matrix * np.linalg.det(matrix))


@few
@given(name=names, seed=seeds, signs=st.tuples(*[st.sampled_from([1.0, -1.0])] * 3))
def test_a_mirrored_gas_has_mirrored_trajectories(kernel, name, seed, signs):
    rules = CollisionRules(box=BOX, **ALL_RULES[name])
    beads = mixture(seed, BEADS, rules)
    matrix = np.diag(signs)
    shift = np.where(np.array(signs) < 0, BOX, 0.0)
    end, record = gas_and_record(beads, rules, kernel)
    _, second = gas_and_record(*turned(beads, rules, matrix, shift), kernel, end)
    assert_alike(record, second, matrix, shift, matrix * np.linalg.det(matrix))


PERIODIC = [name for name, rule in RULES.items() if 'motion' not in rule]


@few
@given(
    name=st.sampled_from(PERIODIC),
    seed=seeds,
    shift=st.tuples(*[st.floats(-20.0, 20.0)] * 3),
    boost=st.tuples(*[st.floats(-2.0, 2.0)] * 3),
)
def test_a_periodic_box_may_be_anywhere_and_in_motion(kernel, name, seed, shift, boost):
    walls = {'wall_sticking_speed': 0.0, 'wall_tangential_restitution': None}
    rules = CollisionRules(**{'box': BOX, **RULES[name], **walls, 'periodic': ALWAYS})
    beads = mixture(seed, BEADS, rules)
    moved = replace(
        beads, positions=beads.positions + shift, velocities=beads.velocities + np.array(boost)
    )
    end, record = gas_and_record(beads, rules, kernel)
    _, second = gas_and_record(moved, rules, kernel, end)
    drift = np.array(shift) + np.multiply.outer(second.times, boost)
    second = replace(
        second,
        positions=second.positions - drift[:, np.newaxis],
        velocities=second.velocities - np.array(boost),
    )
    assert_alike(record, second)


@few
@given(seed=seeds, boxes=st.lists(st.tuples(*[st.integers(-3, 3)] * 3), min_size=10, max_size=10))
def test_beads_may_start_in_any_image_of_a_periodic_box(kernel, seed, boxes):
    rules = CollisionRules(box=BOX, periodic=ALWAYS, restitution=0.9)
    beads = mixture(seed, BEADS, rules)
    away = np.array(boxes) * np.array(BOX)
    end, record = gas_and_record(beads, rules, kernel)
    far = replace(beads, positions=beads.positions + away)
    _, second = gas_and_record(far, rules, kernel, end)
    assert_alike(record, second, shift=away)


def scaled(beads, rules, length, time, mass):
    """Beads and rules in other units."""
    speed = length / time
    law, motion = rules.restitution, rules.motion
    if isinstance(law, ViscoelasticRestitution):
        law = replace(law, at_speed=law.at_speed * speed)
    if motion is not None:
        motion = replace(
            motion,
            amplitude=tuple(np.array(motion.amplitude) * length),
            angular_frequency=motion.angular_frequency / time,
            damping=motion.damping / time,
            start=motion.start * time,
            end=motion.end * time,
        )
    rules = replace(
        rules,
        box=tuple(np.array(rules.box) * length),
        restitution=law,
        contact_duration=rules.contact_duration * time,
        sticking_speed=rules.sticking_speed * speed,
        sticking_speed_width=rules.sticking_speed_width * speed,
        wall_sticking_speed=rules.wall_sticking_speed * speed,
        break_up_speed=rules.break_up_speed * speed,
        motion=motion,
    )
    beads = replace(
        beads,
        radii=beads.radii * length,
        masses=beads.masses * mass,
        positions=beads.positions * length,
        velocities=beads.velocities * speed,
        spins=None if beads.spins is None else beads.spins / time,
    )
    return beads, rules


@pytest.mark.parametrize('name', ALL_RULES)
def test_units_that_are_powers_of_two_change_no_bit(kernel, name):
    """Millimetres, hours or tons: nothing in the engine is of any size by itself."""
    rules = CollisionRules(box=BOX, **ALL_RULES[name])
    beads = mixture(1, BEADS, rules)
    times = np.linspace(0.0, 20.0, 11)
    record = HardSphereGas(beads, rules, kernel).follow(20.0, times, log=True)
    for length, time, mass in itertools.product(
        (2.0**-10, 2.0**7), (2.0**-3, 2.0**8), (2.0**-20,)
    ):
        gas = HardSphereGas(*scaled(beads, rules, length, time, mass), kernel)
        second = gas.follow(20.0 * time, times * time, log=True)
        np.testing.assert_array_equal(second.positions, record.positions * length)
        np.testing.assert_array_equal(second.velocities, record.velocities * (length / time))
        np.testing.assert_array_equal(second.events['time'], record.events['time'] * time)
        np.testing.assert_array_equal(second.events['kind'], record.events['kind'])


@few
@given(seed=seeds, periodic=st.tuples(*[st.booleans()] * 3))
def test_an_elastic_gas_is_time_reversible(kernel, seed, periodic):
    rules = CollisionRules(box=BOX, periodic=periodic)
    random = np.random.default_rng(seed)
    beads = mixture(seed, BEADS, rules)
    beads = replace(beads, positions=placed(random, beads.radii, BOX, periodic))
    end = HardSphereGas(beads, rules, kernel).follow(40.0, log=True).events['time'][EVENTS // 2]
    gas = HardSphereGas(beads, rules, kernel)
    gas.run_until(end)
    gas.kick(-gas.beads().velocities)
    assert gas.now == 0.0
    gas.run_until(end)
    back = gas.beads()
    np.testing.assert_allclose(back.positions, beads.positions, atol=CHAOS)
    np.testing.assert_allclose(back.velocities, -beads.velocities, atol=CHAOS)
    assert gas.counts.pair + gas.counts.wall >= EVENTS
