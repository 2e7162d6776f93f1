"""Collisions with known results, conservation, and the reference engine."""

from __future__ import annotations

import math

import numpy as np
import pytest
import reference_engine
from hypothesis import given, settings
from hypothesis import strategies as st
from small_gases import (
    BOX,
    acrylic,
    beads_of,
    energy,
    shaken,
    smallest_gap,
    tray_of,
)

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine.gas import Beads, CollisionRules, HardSphereGas

WIDE = (0.1, 0.1, 0.1)


def gas_of(beads, **rules):
    return HardSphereGas(beads, CollisionRules(**{'box': WIDE, **rules}))


@pytest.mark.parametrize('restitution', [0.0, 0.5, 0.89, 1.0])
def test_two_beads_meet_head_on_when_and_as_momentum_and_restitution_say(restitution):
    beads = beads_of(
        [(0.04, 0.05, 0.05), (0.05, 0.05, 0.05)],
        [(0.01, 0, 0), (-0.006, 0, 0)],
        masses=[1e-6, 3e-6],
    )
    gas = gas_of(beads, restitution=restitution)
    meeting = (0.01 - 0.002) / 0.016
    _, velocities = gas.run_until(0.6, [meeting - 1e-9, meeting + 1e-9])
    assert velocities[0] == pytest.approx(beads.velocities)
    centre = (0.01 - 3 * 0.006) / 4
    expected = [centre - restitution * 0.012, centre + restitution * 0.004]
    assert velocities[1, :, 0] == pytest.approx(expected, abs=1e-16)
    assert gas.counts.pair == 1


def test_an_oblique_collision_changes_the_normal_velocity_alone():
    angle = math.radians(30.0)
    reach = 0.002
    offset = reach * math.sin(angle)
    beads = beads_of([(0.04, 0.05, 0.05), (0.06, 0.05 + offset, 0.05)], [(0.01, 0, 0), (0, 0, 0)])
    gas = gas_of(beads, restitution=0.7)
    meeting = (0.02 - reach * math.cos(angle)) / 0.01
    positions, velocities = gas.run_until(2.0, [meeting, 2.0])
    normal = np.array([math.cos(angle), math.sin(angle), 0.0])
    transferred = 0.5 * 1.7 * 0.01 * math.cos(angle)
    assert positions[0, 1] - positions[0, 0] == pytest.approx(reach * normal)
    assert velocities[1, 1] == pytest.approx(transferred * normal)
    assert velocities[1, 0] == pytest.approx(np.array([0.01, 0, 0]) - transferred * normal)


def test_beads_that_pass_at_more_than_their_reach_do_not_collide():
    beads = beads_of([(0.04, 0.05, 0.05), (0.06, 0.0520001, 0.05)], [(0.01, 0, 0), (-0.01, 0, 0)])
    gas = gas_of(beads)
    gas.run_until(1.0)
    assert gas.counts.pair == 0


@pytest.mark.parametrize('axis', [0, 1, 2])
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_bead_leaves_each_wall_with_the_wall_restitution(axis, sign):
    velocity = np.full(3, 0.001)
    velocity[axis] = 0.01 * sign
    gas = gas_of(beads_of([(0.05, 0.05, 0.05)], [velocity]), wall_restitution=0.8)
    positions, velocities = gas.run_until(6.0, [4.9, 6.0])
    assert positions[0, 0, axis] == pytest.approx(0.099 if sign > 0 else 0.001)
    assert velocities[1, 0, axis] == pytest.approx(-0.008 * sign)
    assert np.delete(velocities[1, 0], axis) == pytest.approx([0.001, 0.001])
    assert gas.counts.wall == 1


def test_a_bead_in_a_corner_meets_three_walls_one_after_the_other():
    gas = gas_of(beads_of([(0.05, 0.05, 0.05)], [(0.01, 0.01, 0.01)]), wall_restitution=0.5)
    _, velocities = gas.run_until(5.0, [5.0])
    assert velocities[0, 0] == pytest.approx([-0.005, -0.005, -0.005])
    assert gas.counts.wall == 3


def test_energy_is_conserved_over_thousands_of_elastic_events():
    gas = shaken(tray_of(acrylic()))
    before = energy(gas)
    gas.run_until(30.0)
    assert gas.counts.pair + gas.counts.wall > 3000
    assert abs(energy(gas) / before - 1.0) <= 1e-12


def test_a_mixture_of_sizes_conserves_energy_too():
    gas = shaken(tray_of(acrylic(8), acrylic(30, 0.0005, 0.001)))
    before = energy(gas)
    gas.run_until(20.0)
    assert gas.counts.pair > 1000
    assert abs(energy(gas) / before - 1.0) <= 1e-12


@settings(deadline=None, max_examples=25)
@given(
    restitution=st.floats(0.0, 1.0),
    wall_restitution=st.floats(0.0, 1.0),
    seed=st.integers(0, 2**31 - 1),
)
def test_energy_never_rises_and_beads_never_overlap(restitution, wall_restitution, seed):
    gas = shaken(
        tray_of(acrylic(8), acrylic(10, 0.0005, 0.001)),
        seed=seed,
        restitution=restitution,
        wall_restitution=wall_restitution,
    )
    start = gas.beads()
    positions, velocities = gas.run_until(10.0, np.linspace(0.0, 10.0, 200))
    energies = np.array([energy(start, v) for v in velocities])
    assert np.all(np.diff(energies) <= 1e-12 * energies[:-1])
    assert smallest_gap(positions, gas.radii) > -1e-12


def test_contacts_within_the_contact_duration_are_elastic():
    # A light bead between a heavy one and a wall meets them again and again.
    beads = beads_of(
        [(0.0011, 0.05, 0.05), (0.0032, 0.05, 0.05)],
        [(0, 0, 0), (-0.1, 0, 0)],
        masses=[1e-9, 1e-3],
    )
    gas = gas_of(beads, restitution=0.9, wall_restitution=0.9, contact_duration=1e-3)
    gas.run_until(0.1)
    assert gas.counts.elastic_pair > 0
    assert gas.counts.elastic_wall > 0
    without = gas_of(beads, restitution=0.9, wall_restitution=0.9, contact_duration=0.0)
    without.run_until(5e-4)
    assert without.counts.elastic_pair == 0
    assert without.counts.elastic_wall == 0


@pytest.mark.parametrize('restitution', [0.0, 0.3])
def test_a_gas_that_would_collapse_comes_to_its_end(restitution):
    tray = tray_of(acrylic(15), acrylic(40, 0.00087, 0.00118), dimensions=(0.032, 0.01, 0.003))
    gas = shaken(tray, restitution=restitution, wall_restitution=0.5)
    before = energy(gas)
    gas.run_until(60.0)
    assert energy(gas) < 1e-2 * before


def test_too_many_events_end_in_an_error_and_not_in_a_hang():
    gas = shaken(tray_of(acrylic()))
    with pytest.raises(SimulationError, match='100 events taken and only'):
        gas.run_until(30.0, most_events=100)
    assert 0.0 < gas.now < 30.0
    gas.run_until(30.0)
    assert gas.now == 30.0


def test_pauses_and_frames_do_not_change_the_course_of_the_gas():
    straight = shaken(tray_of(acrylic()), restitution=0.89, wall_restitution=0.99)
    paused = shaken(tray_of(acrylic()), restitution=0.89, wall_restitution=0.99)
    expected, _ = straight.run_until(10.0, [10.0])
    for k in range(1, 301):
        positions, _ = paused.run_until(k / 30, [k / 30])
    np.testing.assert_array_equal(positions, expected)


def test_a_frame_at_the_instant_of_a_collision_shows_what_is_after_it():
    beads = beads_of([(0.5, 0.5, 0.5)], [(0.25, 0, 0)], radii=0.25)
    gas = gas_of(beads, box=(1.0, 1.0, 1.0))
    positions, velocities = gas.run_until(2.0, [1.0])
    assert positions[0, 0, 0] == 0.75
    assert velocities[0, 0, 0] == -0.25


def test_a_kick_keeps_places_and_starts_time_again():
    gas = shaken(tray_of(acrylic()), restitution=0.5)
    gas.run_until(3.0)
    before = gas.beads()
    collisions = gas.counts.pair
    gas.kick(np.zeros((15, 3)))
    assert gas.now == 0.0
    positions, velocities = gas.run_until(100.0, [100.0])
    np.testing.assert_array_equal(positions[0], before.positions)
    assert not velocities.any()
    assert gas.counts.pair == collisions


def test_the_kernel_agrees_with_the_reference_event_by_event():
    gas = shaken(
        tray_of(acrylic(6), acrylic(10, 0.0005, 0.0015)),
        seed=3,
        restitution=0.8,
        wall_restitution=0.95,
        contact_duration=0.0,
    )
    start = gas.beads()
    slow = [
        reference_engine.Bead(list(x), list(v), float(r), float(m))
        for x, v, r, m in zip(
            start.positions, start.velocities, start.radii, start.masses, strict=True
        )
    ]
    counts = {'pair': 0, 'wall': 0}
    for time, kind in reference_engine.follow(slow, BOX, 0.8, 0.95, events=250):
        counts[kind] += 1
        wait = reference_engine.next_event(slow, BOX)[0]
        between = 0.5 * wait
        positions, velocities = gas.run_until(time + between, [time + between])
        places = [
            [x + v * between for x, v in zip(bead.position, bead.velocity, strict=True)]
            for bead in slow
        ]
        assert (gas.counts.pair, gas.counts.wall) == (counts['pair'], counts['wall'])
        np.testing.assert_allclose(positions[0], places, rtol=0, atol=1e-9)
        np.testing.assert_allclose(
            velocities[0], [bead.velocity for bead in slow], rtol=0, atol=1e-8
        )
    assert counts['pair'] > 40
    assert counts['wall'] > 40


GOOD = {
    'radii': [0.001, 0.001],
    'masses': [1e-6, 1e-6],
    'positions': [(0.05, 0.05, 0.05), (0.06, 0.05, 0.05)],
    'velocities': [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)],
}
NAN = float('nan')


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'radii': [0.001, NAN]}, r'radii: nan at \[1\]'),
        ({'radii': [0.001, -0.001]}, 'radii: bead 1 has -0.001'),
        ({'radii': [0.001, 0.0]}, 'radii: bead 1 has 0.0'),
        ({'radii': [0.001, 0.06]}, 'diameter 0.12 m in a box 0.1 m wide'),
        ({'radii': [0.001]}, r'masses: shape \(2,\), expected \(1,\)'),
        ({'radii': []}, 'beads: 0 of them'),
        ({'radii': [[0.001, 0.001]]}, 'radii: shape'),
        ({'radii': ['a', 'b']}, 'radii: not an array of numbers'),
        ({'masses': [1e-6, -1e-6]}, 'masses: bead 1 has -1e-06'),
        ({'masses': [1e-6, math.inf]}, 'masses: inf'),
        ({'positions': [(0.05, 0.05, 0.05), (0.05, NAN, 0.05)]}, r'nan at \[1, 1\]'),
        ({'positions': [(0.05, 0.05, 0.05), (0.051, 0.05, 0.05)]}, 'beads 0 and 1 overlap'),
        ({'positions': [(0.05, 0.05, 0.05), (0.0995, 0.05, 0.05)]}, 'bead 1 reaches 0.0005 m'),
        ({'positions': [(0.05, 0.05), (0.06, 0.05)]}, 'positions: shape'),
        ({'velocities': [(0.0, 0.0, 0.0), (0.0, -math.inf, 0.0)]}, 'velocities: -inf'),
    ],
)
def test_beads_that_cannot_be_are_refused(change, message):
    with pytest.raises(SimulationError, match=message):
        gas_of(Beads(**{**GOOD, **change}))


def test_more_beads_than_the_box_holds_are_refused():
    beads = beads_of(np.full((200, 3), 0.05), np.zeros((200, 3)), radii=0.01)
    with pytest.raises(SimulationError, match=r'fill 0\.838 of the box|overlap'):
        gas_of(beads)
    packed = beads_of(np.full((300, 3), 0.05), np.zeros((300, 3)), radii=0.01)
    with pytest.raises(SimulationError, match=r'fill 1\.26 of the box'):
        gas_of(packed)


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'restitution': 1.01}, r'restitution: 1\.01 is outside'),
        ({'restitution': -0.1}, 'restitution: -0.1 is outside'),
        ({'restitution': NAN}, 'restitution: nan is outside'),
        ({'wall_restitution': 2.0}, 'wall_restitution: 2.0 is outside'),
        ({'contact_duration': -1.0}, 'contact_duration: -1.0'),
        ({'box': (0.1, 0.0, 0.1)}, 'side_y is 0.0'),
        ({'box': (0.1, 0.1, math.inf)}, 'side_z is inf'),
        ({'box': (0.1, 0.1)}, 'box: 2 sides'),
    ],
)
def test_rules_that_cannot_be_are_refused(change, message):
    with pytest.raises(SimulationError, match=message):
        CollisionRules(**{'box': WIDE, **change})


def test_time_that_goes_backwards_is_refused():
    gas = gas_of(Beads(**GOOD))
    gas.run_until(1.0)
    for end, frames in [
        (0.5, []),
        (NAN, []),
        (math.inf, []),
        (2.0, [0.5]),
        (2.0, [1.5, 1.2]),
        (2.0, [2.5]),
        (2.0, [NAN]),
    ]:
        with pytest.raises(SimulationError):
            gas.run_until(end, frames)
    with pytest.raises(SimulationError, match='velocities'):
        gas.kick([(NAN, 0, 0), (0, 0, 0)])
