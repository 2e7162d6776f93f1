"""Properties of every gas, for all rules and all kinds of output."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from gases import BOX, KERNELS, energy, mixture, smallest_gap
from hypothesis import given, settings
from hypothesis import strategies as st

from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.kernel_choice import Kernel
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules
from nanorocks_ros.simulation.engine.rules.restitution_laws import (
    UniformRestitution,
    ViscoelasticRestitution,
)
from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion

END = 20.0

unit = st.floats(0.0, 1.0)
# Beads that stay in touch after a contact of restitution 0 meet others at one instant, in an
# order that is rounding alone; these bounce.
bouncing = st.floats(0.3, 1.0)


def laws(numbers):
    """All that do not depend on how the beads are numbered."""
    tables = st.tuples(numbers, numbers, numbers).map(lambda abc: [abc[:2], [abc[1], abc[2]]])
    at_speed = st.floats(0.1, 10.0)
    falling = st.builds(ViscoelasticRestitution, value=st.floats(0.3, 0.99), at_speed=at_speed)
    return st.one_of(numbers, tables, falling)


random_laws = unit.map(lambda mean: UniformRestitution(mean=mean, width=min(mean, 1.0 - mean)))
rough = st.none() | st.floats(-1.0, 1.0)
sliding = st.just(math.inf) | st.floats(0.0, 1.0)


@st.composite
def rules_at_rest(draw, numbers=unit):
    """Walls that are at rest; the contact duration keeps collapse from taking for ever."""
    sticky = draw(st.booleans())
    turning = sticky and draw(st.booleans())
    no_spin, no_periods = st.none(), st.just((False,) * 3)
    return CollisionRules(
        box=BOX,
        periodic=draw(no_periods if turning else st.tuples(*[st.booleans()] * 3)),
        aggregate_motion='rotating' if turning else 'translating',
        restitution=draw(laws(unit) | random_laws if numbers is unit else laws(numbers)),
        wall_restitution=draw(st.tuples(*[numbers] * 6)),
        contact_duration=draw(st.sampled_from([1e-4, 1e-2])),
        sticking_speed=draw(st.floats(0.0, 0.8)) if sticky else 0.0,
        wall_sticking_speed=draw(st.floats(0.0, 0.2)) if sticky else 0.0,
        sticking_measure=draw(st.sampled_from(['normal', 'total'])),
        tangential_restitution=draw(no_spin if turning else rough),
        wall_tangential_restitution=draw(no_spin if turning else rough),
        friction=draw(sliding),
        wall_friction=draw(sliding),
        seed=draw(st.integers(0, 1000)),
    )


@st.composite
def gases(draw, rules):
    """Rules, beads for them, and a kernel."""
    rules = draw(rules)
    beads = mixture(draw(st.integers(0, 10**6)), draw(st.integers(1, 14)), rules)
    if rules.tangential_restitution is None and rules.wall_tangential_restitution is not None:
        beads = replace(beads, spins=np.ones((len(beads.radii), 3)))
    return rules, beads, draw(st.sampled_from(KERNELS))


MOTIONS = [
    WallMotion.sinusoidal((0.3, 0.2, 0.0), 0.8, periods=4, start=0.5),
    WallMotion.impulsive((2.0, 0.0, 1.0), 0.8, damping=0.5, start=0.5),
]
shaken = st.builds(
    lambda rules, motion: replace(rules, motion=motion, wall_sticking_speed=0.0),
    rules_at_rest(),
    st.sampled_from(MOTIONS),
)
shaken_or_not = rules_at_rest() | shaken


@settings(deadline=None, max_examples=60)
@given(gases(rules_at_rest()))
def test_energy_never_rises_and_nothing_overlaps_while_the_walls_are_at_rest(case):
    rules, beads, kernel = case
    record = HardSphereGas(beads, rules, kernel).follow(END, np.linspace(0.0, END, 200))
    energies = energy(beads, record.velocities, record.spins)
    assert np.all(np.diff(energies) <= 1e-12 * energies[0])
    assert smallest_gap(record.positions, beads.radii, rules) > -1e-10


@settings(deadline=None, max_examples=40)
@given(
    gases(shaken_or_not),
    st.lists(st.floats(0.0, END), max_size=30),
    st.lists(st.floats(0.0, END), max_size=8),
)
def test_frames_observations_and_pauses_do_not_change_the_trajectories(case, looks, pauses):
    rules, beads, kernel = case
    straight = HardSphereGas(beads, rules, kernel)
    paused = HardSphereGas(beads, rules, kernel)
    expected = straight.follow(END, [END], log=True)
    events = []
    for end in [*sorted(pauses), END]:
        times = [end, *(look for look in looks if paused.now <= look <= end)]
        record = paused.follow(end, sorted(times), sorted(times), log=True)
        events.append(record.events)
    np.testing.assert_array_equal(np.concatenate(events), expected.events)
    np.testing.assert_array_equal(record.positions[-1], expected.positions[0])
    np.testing.assert_array_equal(record.velocities[-1], expected.velocities[0])
    assert paused.counts == straight.counts
    np.testing.assert_array_equal(paused.ledger, straight.ledger)


@settings(deadline=None, max_examples=40)
@given(gases(shaken_or_not), st.lists(st.floats(0.0, END), max_size=6, unique=True))
def test_a_frame_shows_the_same_whatever_other_frames_there_are(case, times):
    rules, beads, kernel = case
    times = sorted(times)
    together = HardSphereGas(beads, rules, kernel).follow(END, times)
    for k, time in enumerate(times):
        alone = HardSphereGas(beads, rules, kernel).follow(END, [time])
        np.testing.assert_array_equal(alone.positions[0], together.positions[k])
        np.testing.assert_array_equal(alone.velocities[0], together.velocities[k])


def renumbered(beads, order):
    return Beads(
        radii=beads.radii[order],
        masses=beads.masses[order],
        positions=beads.positions[order],
        velocities=beads.velocities[order],
        spins=None if beads.spins is None else beads.spins[order],
        species=None if beads.species is None else beads.species[order],
    )


smooth_and_loose = rules_at_rest(bouncing).map(
    lambda rules: replace(
        rules,
        tangential_restitution=None,
        wall_tangential_restitution=None,
        sticking_speed=0.0,
        wall_sticking_speed=0.0,
    )
)


@settings(deadline=None, max_examples=40)
@given(gases(smooth_and_loose), st.randoms(use_true_random=False))
def test_renumbered_smooth_beads_change_no_bit_of_the_scan(case, random):
    rules, beads, _ = case
    order = np.arange(len(beads.radii))
    random.shuffle(order)
    gas = HardSphereGas(beads, rules, Kernel.SCAN)
    second = HardSphereGas(renumbered(beads, order), rules, Kernel.SCAN)
    times = np.linspace(0.0, END, 5)
    record, reordered = gas.follow(END, times), second.follow(END, times)
    np.testing.assert_array_equal(reordered.positions, record.positions[:, order])
    np.testing.assert_array_equal(reordered.velocities, record.velocities[:, order])
    assert (gas.counts.pair, gas.counts.wall) == (second.counts.pair, second.counts.wall)


@settings(deadline=None, max_examples=40, derandomize=True)
@given(gases(rules_at_rest(bouncing)), st.randoms(use_true_random=False))
def test_renumbered_beads_change_only_rounding(case, random):
    rules, beads, kernel = case
    order = np.arange(len(beads.radii))
    random.shuffle(order)
    gas = HardSphereGas(beads, rules, kernel)
    second = HardSphereGas(renumbered(beads, order), rules, kernel)
    events = gas.follow(END, log=True).events[: 2 * len(beads.radii)]
    second_events = second.follow(END, log=True).events[: len(events)]
    np.testing.assert_array_equal(events['kind'], second_events['kind'])
    pairs = [
        sorted(order[[row['bead'], row['partner']]])
        for row in second_events[of_two(second_events)]
    ]
    expected = [sorted((row['bead'], row['partner'])) for row in events[of_two(events)]]
    np.testing.assert_array_equal(pairs, expected)
    for field in ('time', 'normal_speed', 'impulse'):
        np.testing.assert_allclose(second_events[field], events[field], rtol=0, atol=1e-6)


def of_two(events):
    return np.isin(events['kind'], ['pair', 'merge'])


@settings(deadline=None, max_examples=60, derandomize=True)
@given(gases(rules_at_rest(bouncing)), st.none() | st.sampled_from(MOTIONS))
def test_both_kernels_agree_until_chaos(case, motion):
    rules, beads, _ = case
    if motion is not None:
        rules = replace(rules, motion=motion, wall_sticking_speed=0.0)
    scan, lists = (HardSphereGas(beads, rules, kernel) for kernel in KERNELS)
    events = scan.follow(END, log=True).events[: 3 * len(beads.radii)]
    second_events = lists.follow(END, log=True).events[: len(events)]
    for field in ('kind', 'bead', 'partner'):
        np.testing.assert_array_equal(events[field], second_events[field])
    for field in ('time', 'normal_speed', 'impulse'):
        np.testing.assert_allclose(second_events[field], events[field], rtol=0, atol=1e-6)
