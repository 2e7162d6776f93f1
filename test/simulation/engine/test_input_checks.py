"""Invalid beads and times are refused; the error names the value and the reason."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from gases import ALWAYS, KERNELS, beads_of, gas_of

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules

NAN, INF = math.nan, math.inf
BOX = (10.0, 10.0, 10.0)

GOOD = {
    'radii': [1.0, 1.0],
    'masses': [1.0, 1.0],
    'positions': [(5, 5, 5), (8, 5, 5)],
    'velocities': [(0, 0, 0), (0, 0, 0)],
}


def gas_with(change, **rules):
    return HardSphereGas(Beads(**{**GOOD, **change}), CollisionRules(box=BOX, **rules))


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'radii': [1.0, NAN]}, r'radii: nan at \[1\]; give finite values'),
        ({'radii': [INF, 1.0]}, r'radii: inf at \[0\]'),
        ({'radii': [1.0, -1.0]}, 'radii: bead 1 has -1.0; give positive values'),
        ({'radii': [0.0, 1.0]}, 'radii: bead 0 has 0.0'),
        ({'radii': [1.0]}, r'masses: shape \(2,\), expected \(1,\)'),
        ({'radii': []}, 'beads: 0 of them'),
        ({'radii': [[1.0, 1.0]]}, r'radii: shape \(1, 2\)'),
        ({'radii': 1.0}, r'radii: shape \(\)'),
        ({'radii': ['a', 'b']}, 'radii: not an array of numbers'),
        ({'radii': [1.0, None]}, 'radii: '),
        ({'radii': [1.0, 1j]}, 'radii: not an array of numbers'),
        ({'masses': [1.0, -1e-6]}, 'masses: bead 1 has -1e-06'),
        ({'masses': [0.0, 1.0]}, 'masses: bead 0 has 0.0'),
        ({'masses': [1.0, INF]}, r'masses: inf at \[1\]'),
        ({'masses': [NAN, 1.0]}, r'masses: nan at \[0\]'),
        ({'masses': [1.0, 1.0, 1.0]}, r'masses: shape \(3,\), expected \(2,\)'),
        ({'positions': [(5, 5, 5), (8, NAN, 5)]}, r'positions: nan at \[1, 1\]'),
        ({'positions': [(-INF, 5, 5), (8, 5, 5)]}, r'positions: -inf at \[0, 0\]'),
        ({'positions': [(5, 5), (8, 5)]}, r'positions: shape \(2, 2\), expected \(2, 3\)'),
        ({'positions': [(5, 5, 5)]}, r'positions: shape \(1, 3\), expected \(2, 3\)'),
        ({'velocities': [(0, 0, 0), (0, -INF, 0)]}, r'velocities: -inf at \[1, 1\]'),
        ({'velocities': [(0, 0, NAN), (0, 0, 0)]}, r'velocities: nan at \[0, 2\]'),
        ({'velocities': [0, 0, 0]}, 'velocities: shape'),
        ({'spins': [(0, 0, 0), (0, NAN, 0)]}, r'spins: nan at \[1, 1\]'),
        ({'spins': [(0, 0, 0), (0, INF, 0)]}, r'spins: inf at \[1, 1\]'),
        ({'spins': [0, 0]}, 'spins: shape'),
    ],
)
def test_arrays_of_another_shape_or_not_finite_are_refused(change, message):
    with pytest.raises(SimulationError, match=message):
        gas_with(change, tangential_restitution=0.5)


@pytest.mark.parametrize('kernel', KERNELS)
@pytest.mark.parametrize(
    ('places', 'message'),
    [
        ([(5, 5, 5), (6, 5, 5)], 'positions: beads 0 and 1 overlap'),
        ([(5, 5, 5), (5, 5, 5)], 'positions: beads 0 and 1 overlap'),
        ([(5, 5, 5), (6.999999, 5, 5)], 'positions: beads 0 and 1 overlap'),
        ([(5, 5, 5), (9.5, 5, 5)], 'positions: bead 1 reaches 0.5 m into a wall'),
        ([(0.5, 5, 5), (5, 5, 5)], 'positions: bead 0 reaches 0.5 m into a wall'),
        ([(5, 5, -3), (5, 5, 5)], 'positions: bead 0 reaches 4 m into a wall'),
    ],
)
def test_overlapping_beads_and_beads_in_a_wall_are_refused(kernel, places, message):
    with pytest.raises(SimulationError, match=message):
        gas_of(places, np.zeros((2, 3)), kernel=kernel)


@pytest.mark.parametrize('kernel', KERNELS)
def test_beads_that_overlap_across_a_periodic_side_are_refused(kernel):
    places = [(0.5, 5, 5), (9.9, 5, 5)]
    with pytest.raises(SimulationError, match='positions: beads 0 and 1 overlap'):
        gas_of(places, np.zeros((2, 3)), periodic=ALWAYS, kernel=kernel)


@pytest.mark.parametrize('kernel', KERNELS)
def test_the_overlapping_pair_of_many_beads_is_named(kernel):
    places = 3.0 * np.array(list(np.ndindex(6, 6, 6))) + 1.5
    places[137] = places[52] + (1.0, 0.5, 0.0)
    with pytest.raises(SimulationError, match='beads 52 and 137 overlap'):
        gas_of(places, np.zeros((216, 3)), box=(18, 18, 18), kernel=kernel)


@pytest.mark.parametrize('kernel', KERNELS)
def test_beads_that_touch_one_another_and_the_walls_are_accepted(kernel):
    gas = gas_of([(1, 1, 1), (3, 1, 1)], np.zeros((2, 3)), box=(4, 2.5, 2.5), kernel=kernel)
    gas.run_until(10.0)
    assert gas.counts.pair == gas.counts.wall == 0


def test_beads_larger_than_the_box_are_refused():
    with pytest.raises(SimulationError, match='beads: diameter 12 m in a box 10 m wide'):
        gas_with({'radii': [1.0, 6.0]})
    # Between periodic sides a bead could meet two images of another at once.
    with pytest.raises(SimulationError, match=r'beads: diameter 5\.2 m in a box 10 m wide'):
        gas_with({'radii': [1.0, 2.6]}, periodic=(False, True, False))


def test_more_beads_than_the_box_has_volume_are_refused():
    # 300 times 4/3 pi in 1000.
    with pytest.raises(SimulationError, match=r'beads: fill 1\.26 of the box'):
        gas_of(np.full((300, 3), 5.0), np.zeros((300, 3)))


@pytest.mark.parametrize(
    ('species', 'message'),
    [
        ([0, 2], 'species: bead 1 is of the unknown species 2; give numbers from 0 to 1'),
        ([-1, 0], 'species: bead 0 is of the unknown species -1'),
        ([0], r'species: shape \(1,\)'),
        ([0.0, 1.0], 'species: shape .* give one whole number for each bead'),
        (['a', 'b'], 'species: '),
    ],
)
def test_species_without_a_restitution_are_refused(species, message):
    with pytest.raises(SimulationError, match=message):
        gas_with({'species': species}, restitution=[[0.9, 0.8], [0.8, 0.7]])


def test_spins_for_smooth_beads_are_refused():
    with pytest.raises(SimulationError, match='spins: given for smooth beads'):
        gas_with({'spins': np.zeros((2, 3))})
    gas_with({'spins': np.zeros((2, 3))}, wall_tangential_restitution=0.0)


def test_input_arrays_are_copied():
    beads = beads_of([(3, 5, 5), (7, 5, 5)], [(1, 0, 0), (-1, 0, 0)])
    before = replace(beads, positions=beads.positions.copy(), velocities=beads.velocities.copy())
    gas = HardSphereGas(beads, CollisionRules(box=BOX))
    gas.run_until(3.0)
    np.testing.assert_array_equal(beads.positions, before.positions)
    np.testing.assert_array_equal(beads.velocities, before.velocities)
    beads.positions[:] = 0.0
    assert gas.beads().positions[0, 0] == pytest.approx(2.0)


@pytest.fixture
def gas():
    gas = gas_of([(3, 5, 5), (7, 5, 5)], [(1, 0, 0), (-1, 0, 0)])
    gas.run_until(1.5)
    return gas


@pytest.mark.parametrize('end', [1.4999, 0.0, -1.0, NAN, INF, -INF])
def test_an_end_in_the_past_or_not_finite_is_refused(gas, end):
    with pytest.raises(SimulationError, match=r'end: .* s, already at 1\.5 s; give a later time'):
        gas.run_until(end)
    assert gas.now == 1.5


@pytest.mark.parametrize('kind', ['frame_times', 'observation_times'])
@pytest.mark.parametrize(
    ('times', 'message'),
    [
        ([1.4], 'not rising from 1.5 s to 3.0 s'),
        ([3.1], 'not rising from 1.5 s to 3.0 s'),
        ([2.5, 2.4], 'not rising from 1.5 s to 3.0 s'),
        ([2.0, NAN], r'nan at \[1\]'),
        ([INF], r'inf at \[0\]'),
        ([[2.0, 2.5]], 'shape'),
        (['soon'], 'not an array of numbers'),
    ],
)
def test_times_outside_the_run_are_refused(gas, kind, times, message):
    with pytest.raises(SimulationError, match=f'{kind}: .*{message}|{kind}: {message}'):
        gas.follow(3.0, **{kind: times})
    assert gas.now == 1.5
    record = gas.follow(3.0, [1.5, 3.0])
    assert record.positions[1, :, 0] == pytest.approx([2, 8])


def test_an_invalid_kick_is_refused_without_a_change(gas):
    for velocities, message in (
        ([(NAN, 0, 0), (0, 0, 0)], r'velocities: nan at \[0, 0\]'),
        ([(1, 0, 0)], r'velocities: shape \(1, 3\), expected \(2, 3\)'),
    ):
        with pytest.raises(SimulationError, match=message):
            gas.kick(velocities)
    assert gas.now == 1.5
    assert gas.beads().positions[:, 0] == pytest.approx([3.5, 6.5])
