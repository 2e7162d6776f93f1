"""Random positions from dilute to dense: no overlap, and the same for the same key."""

from __future__ import annotations

import hashlib
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.numerics.counter_rng import Purpose, key_for, uniform
from nanorocks_ros.numerics.stable_sort import stable_argsort
from nanorocks_ros.simulation.packing.random_placement import (
    MOST_TRIES,
    pack_beads,
    random_positions,
)

WALLS = (False, False, False)
NONE_AROUND = np.array(WALLS)
AROUND = (True, True, True)
KEY = np.uint64(20190101)
SEED = 1


def one_after_the_other(radii, sides, periodic, key):
    """Random sequential insertion in plain words: the definition that `pack_beads` has to meet."""
    positions = np.zeros((radii.size, 3))
    inside = []
    counter = 0
    for i in np.argsort(radii, kind='stable')[::-1]:
        while True:
            for axis in range(3):
                if periodic[axis]:
                    positions[i, axis] = sides[axis] * uniform(key, counter)
                else:
                    free = sides[axis] - 2.0 * radii[i]
                    positions[i, axis] = radii[i] + free * uniform(key, counter)
                counter += 1
            d = positions[inside] - positions[i]
            for axis in np.flatnonzero(periodic):
                d[:, axis] -= sides[axis] * np.rint(d[:, axis] / sides[axis])
            reach = radii[i] + radii[inside]
            squares = d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1] + d[:, 2] * d[:, 2]
            if not np.any(squares < reach * reach):
                break
        inside.append(i)
    return positions


def beads_of(tray, run):
    """Radii of the beads of a tray as a simulation draws them, and the key of their places."""
    sizes_key = key_for(SEED, run, Purpose.DIAMETERS)
    kinds = [item for item in tray.species for _ in range(item.count)]
    radii = [
        0.5
        * (kind.diameter_low + (kind.diameter_high - kind.diameter_low) * uniform(sizes_key, i))
        for i, kind in enumerate(kinds)
    ]
    return np.array(radii), key_for(SEED, run, Purpose.POSITIONS)


def cube_filled_to(filling, radii):
    side = (4.0 / 3.0 * math.pi * np.sum(radii**3) / filling) ** (1.0 / 3.0)
    return np.full(3, side)


def smallest_gap(positions, radii, sides, periodic):
    """Smallest distance between the surfaces of two beads, or of one and a wall."""
    images = itertools.product(*((-1, 0, 1) if item else (0,) for item in periodic))
    i, j = np.triu_indices(radii.size, 1)
    gaps = [math.inf]
    for image in images:
        d = positions[j] + np.array(image) * sides - positions[i]
        gaps.extend(np.sqrt((d * d).sum(axis=1)) - radii[i] - radii[j])
    for axis in range(3):
        x = positions[:, axis]
        if periodic[axis]:
            assert np.all((x >= 0.0) & (x < sides[axis]))
        else:
            gaps.extend(x - radii)
            gaps.extend(sides[axis] - radii - x)
    return min(gaps)


@pytest.mark.parametrize('number', range(1, 9))
def test_a_flown_tray_is_filled_one_bead_after_the_other(number):
    tray = load_trays()[number]
    radii, key = beads_of(tray, run=0)
    sides = np.array(tray.dimensions)
    positions, placed = pack_beads(radii, sides, NONE_AROUND, key, MOST_TRIES)
    assert placed == tray.count
    np.testing.assert_array_equal(positions, one_after_the_other(radii, sides, WALLS, key))


@pytest.mark.parametrize('periodic', [AROUND, (True, False, False), (False, True, True)])
def test_random_sequential_insertion_of_many_sizes_in_a_periodic_box(periodic):
    radii = np.linspace(0.02, 1.0, 60) ** 2
    sides = cube_filled_to(0.25, radii) * [1.3, 1.0, 1.0 / 1.3]
    positions, placed = pack_beads(radii, sides, np.array(periodic), KEY, MOST_TRIES)
    assert placed == 60
    expected = one_after_the_other(radii, sides, periodic, KEY)
    np.testing.assert_array_equal(positions, expected)
    assert smallest_gap(positions, radii, sides, periodic) > 0.0


@pytest.mark.parametrize('periodic', [WALLS, AROUND])
@pytest.mark.parametrize('filling', [0.10, 0.20, 0.30, 0.35, 0.40, 0.45])
@pytest.mark.parametrize('count', [40, 300])
def test_equal_beads_fill_a_cube_up_to_0_45(count, filling, periodic):
    radii = np.full(count, 0.001)
    sides = cube_filled_to(filling, radii)
    positions = random_positions(radii, sides, periodic=periodic, key=KEY)
    assert smallest_gap(positions, radii, sides, periodic) > 0.0


@pytest.mark.parametrize('count', range(2, 9))
def test_very_few_beads_fill_a_periodic_box_up_to_0_45(count):
    radii = np.full(count, 0.5)
    sides = cube_filled_to(0.45, radii)
    for key in range(20):
        positions = random_positions(radii, sides, periodic=True, key=np.uint64(key))
        assert smallest_gap(positions, radii, sides, AROUND) > 0.0


def test_eight_beads_that_need_the_eight_corners_find_them():
    radii = np.full(8, 0.5)
    sides = cube_filled_to(0.45, radii)
    for key in range(10):
        positions = random_positions(radii, sides, key=np.uint64(key))
        assert smallest_gap(positions, radii, sides, WALLS) > 0.0
        assert np.unique(positions > 0.5 * sides, axis=0).shape == (8, 3)


@pytest.mark.parametrize('ratio', [0.5, 0.2, 0.1])
@pytest.mark.parametrize('periodic', [WALLS, AROUND])
def test_beads_of_many_sizes_fill_a_cube_to_0_45(ratio, periodic):
    radii = np.random.default_rng(3).uniform(ratio, 1.0, 300)
    sides = cube_filled_to(0.45, radii)
    positions = random_positions(radii, sides, periodic=periodic, key=KEY)
    assert smallest_gap(positions, radii, sides, periodic) > 0.0


def test_a_few_marbles_among_grains_a_fifth_of_their_size_fill_a_cube_to_0_45():
    radii = np.concatenate([np.full(10, 1.0), np.full(1250, 0.2)])
    sides = cube_filled_to(0.45, radii)
    positions = random_positions(radii, sides, key=KEY)
    assert smallest_gap(positions, radii, sides, WALLS) > 0.0


def test_a_thousandfold_in_size_is_no_difficulty():
    radii = np.concatenate([np.full(3, 1.0), np.full(500, 0.001)])
    sides = np.array([2.5, 2.5, 6.0])
    positions = random_positions(radii, sides, key=KEY)
    assert smallest_gap(positions, radii, sides, WALLS) > 0.0


@pytest.mark.parametrize('count', [15, 50, 60, 64])
def test_a_tray_half_as_high_again_as_its_beads_takes_up_to_64(count):
    radii = np.full(count, 0.001)
    sides = np.array([0.015, 0.015, 0.003])
    positions = random_positions(radii, sides, key=KEY)
    assert smallest_gap(positions, radii, sides, WALLS) > 0.0


@pytest.mark.parametrize('periodic', [WALLS, (True, True, False)])
def test_a_slit_hardly_wider_than_its_beads_is_filled_with_a_layer(periodic):
    radii = np.full(80, 0.001)
    sides = np.array([0.022, 0.022, 0.00201])
    positions = random_positions(radii, sides, periodic=periodic, key=KEY)
    assert smallest_gap(positions, radii, sides, periodic) > 0.0


@pytest.mark.parametrize(('count', 'filling'), [(20_000, 0.26), (5_000, 0.45)])
def test_many_beads_are_placed_with_no_two_overlapping(count, filling):
    radii = np.full(count, 0.5)
    sides = cube_filled_to(filling, radii)
    positions = random_positions(radii, sides, periodic=True, key=KEY)
    near = cKDTree(positions, boxsize=sides).query_pairs(0.999_999_999)
    assert not near


def test_dense_beads_touch_as_often_as_in_a_fluid_in_equilibrium():
    # Carnahan and Starling 1969, J. Chem. Phys. 51, 635: g at contact is 3.704 at 0.40. Here
    # within 3 % (two standard errors); [B19] has nothing as dense.
    filling, radii = 0.40, np.full(2000, 0.5)
    sides = cube_filled_to(filling, radii)
    edges = np.linspace(1.0, 1.2, 11)
    counts = np.zeros(10)
    keys = range(6)
    for key in keys:
        positions = random_positions(radii, sides, periodic=True, key=np.uint64(key))
        i, j = cKDTree(positions, boxsize=sides).query_pairs(1.2, output_type='ndarray').T
        d = positions[j] - positions[i]
        d -= sides * np.rint(d / sides)
        counts += np.histogram(np.linalg.norm(d, axis=1), edges)[0]
    shells = 4.0 / 3.0 * math.pi * np.diff(edges**3)
    ideal = len(keys) * 0.5 * radii.size**2 / np.prod(sides) * shells
    middles = 0.5 * (edges[1:] + edges[:-1]) - 1.0
    at_contact = math.exp(np.polyfit(middles, np.log(counts / ideal), 2, w=np.sqrt(counts))[-1])
    expected = (1.0 - filling / 2.0) / (1.0 - filling) ** 3
    assert at_contact == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize('periodic', [WALLS, AROUND])
def test_points_are_even_over_the_box(periodic):
    n, bins = 20_000, 20
    sides = np.array([3.0, 2.0, 1.0])
    positions = random_positions(np.full(n, 1e-6), sides, periodic=periodic, key=KEY)
    for axis in range(3):
        counts, _ = np.histogram(positions[:, axis], bins, (0.0, sides[axis]))
        chi_square = np.sum((counts - n / bins) ** 2) / (n / bins)
        assert chi_square < 43.8  # one in a thousand for 19 degrees of freedom


def test_dense_beads_are_even_over_a_periodic_box():
    radii = np.full(3000, 0.5)
    sides = cube_filled_to(0.45, radii)
    positions = random_positions(radii, sides, periodic=True, key=KEY)
    for axis in range(3):
        counts, _ = np.histogram(positions[:, axis], 10, (0.0, sides[axis]))
        # Hard spheres this dense vary less than points would, by a standard deviation of 17.
        assert np.abs(counts - 300).max() < 40


@given(
    st.lists(st.floats(0.01, 1.0), min_size=1, max_size=12),
    st.tuples(*[st.floats(1.0, 4.0)] * 3),
    st.tuples(*[st.booleans()] * 3),
    st.integers(0, 2**64 - 1),
)
@settings(deadline=None, max_examples=100)
def test_beads_of_any_sizes_in_any_box_never_overlap(sizes, shape, periodic, key):
    radii = np.array(sizes)
    sides = cube_filled_to(0.15, radii) * np.array(shape)
    sides = np.maximum(sides, 2.001 * radii.max())
    positions, placed = pack_beads(radii, sides, np.array(periodic), np.uint64(key), 100)
    assert placed == radii.size
    assert smallest_gap(positions, radii, sides, periodic) > -1e-12


def test_the_same_key_gives_the_same_places_and_another_key_others():
    for filling in (0.2, 0.42):
        radii = np.full(100, 0.5)
        sides = cube_filled_to(filling, radii)
        first = random_positions(radii, sides, key=KEY)
        np.testing.assert_array_equal(first, random_positions(radii, sides, key=KEY))
        assert not np.array_equal(first, random_positions(radii, sides, key=np.uint64(2)))


def test_dense_places_are_the_same_bits_on_every_machine():
    radii = np.linspace(0.25, 0.5, 200)
    sides = np.array([4.0, 5.0, 4.5])
    positions = random_positions(radii, sides, periodic=(True, False, True), key=KEY)
    assert hashlib.sha256(positions.astype('<f8').tobytes()).hexdigest()[:16] == 'd0e977edc49e14e1'


def test_flags_may_be_one_or_three():
    radii, sides = np.full(30, 0.5), (4.0, 4.0, 4.0)
    expected = random_positions(radii, sides, periodic=(True, True, True), key=KEY)
    packed = random_positions(radii, sides, periodic=True, key=KEY)
    np.testing.assert_array_equal(packed, expected)
    packed, _ = pack_beads(radii, np.array(sides), np.array([True] * 3), KEY, MOST_TRIES)
    np.testing.assert_array_equal(packed, expected)


@pytest.mark.parametrize(
    ('count', 'sides'),
    [
        (72, (7.5, 7.5, 1.5)),  # 0.45, but in a slit in which that is a crystal
        (3, (1.2, 1.2, 2.5)),  # in a zigzag they are 2.92 long
        (100, (4.3, 4.3, 4.3)),  # 0.66
    ],
)
def test_beads_for_which_there_is_no_room_are_refused_in_time(count, sides):
    with pytest.raises(SimulationError, match=rf'found room for only \d+ of {count} beads'):
        random_positions(np.full(count, 0.5), sides, key=KEY)


def test_those_that_found_room_are_the_largest_and_have_valid_places():
    radii = np.linspace(0.3, 0.5, 60)
    sides = cube_filled_to(0.75, radii)
    positions, placed = pack_beads(radii, sides, NONE_AROUND, KEY, MOST_TRIES)
    assert 10 < placed < 60
    inside = np.argsort(radii)[-placed:]
    assert smallest_gap(positions[inside], radii[inside], sides, WALLS) > 0.0


@pytest.mark.parametrize(
    ('radii', 'sides', 'message'),
    [
        ([0.5, -0.1], (4, 4, 4), r'radii: number 1 is -0\.1; give finite lengths above 0'),
        ([0.0, 0.1], (4, 4, 4), r'radii: number 0 is 0\.0; '),
        ([0.5, math.nan], (4, 4, 4), 'radii: number 1 is nan; '),
        ([math.inf], (4, 4, 4), 'radii: number 0 is inf; '),
        ([], (4, 4, 4), r'radii: shape \(0,\), expected one for each bead; '),
        ([[0.5]], (4, 4, 4), r'radii: shape \(1, 1\), expected one for each bead; '),
        (['wide'], (4, 4, 4), 'radii: not an array of numbers; '),
        ([0.5], (4, 4), r'box: shape \(2,\), expected \(3,\); '),
        ([0.5], (4, 4, 0), r'box: number 2 is 0\.0; '),
        ([0.5], (4, math.nan, 4), 'box: number 1 is nan; '),
        ([0.5, 2.5], (9, 4, 9), 'beads: diameter 5 m in a box 4 m wide; give smaller beads'),
        ([0.5], (9, 1, 9), 'beads: diameter 1 m in a box 1 m wide; '),
        ([0.5] * 99, (3, 3, 3), r'beads: fill 1\.92 of the box; give fewer beads'),
    ],
)
def test_invalid_input_is_refused_in_one_line(radii, sides, message):
    for periodic in (False, True):
        with pytest.raises(SimulationError, match=f'^{message}') as caught:
            random_positions(radii, sides, periodic=periodic, key=KEY)
        assert '\n' not in str(caught.value)


@pytest.mark.parametrize('flags', [(True, False), 'yes', 1, None])
def test_invalid_flags_are_refused(flags):
    with pytest.raises(SimulationError, match=r'^periodic: .*; give True or False, or three'):
        random_positions([0.5], (4, 4, 4), periodic=flags, key=KEY)


@pytest.mark.parametrize('radius', [0.0, -0.5, math.nan, math.inf, 2.0])
def test_compiled_code_places_no_bead_when_one_does_not_fit(radius):
    radii = np.array([0.5, radius, 0.5])
    assert pack_beads(radii, np.full(3, 4.0), NONE_AROUND, KEY, 100)[1] == 0


@given(st.lists(st.integers(-4, 4)))
@settings(deadline=None)
def test_rising_order_keeps_equals_as_they_are(values):
    array = np.array(values, dtype=np.float64) / 3.0
    np.testing.assert_array_equal(stable_argsort(array), np.argsort(array, kind='stable'))
