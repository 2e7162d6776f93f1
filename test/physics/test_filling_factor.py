"""Filling factors against exact geometry."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hexagonal_discs import hexagonal_patch
from hypothesis import given
from hypothesis import strategies as some
from scipy.spatial import ConvexHull, QhullError

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.physics.filling_factor import (
    HEXAGONAL_AREA,
    HEXAGONAL_LAYER,
    PAPER_CLUSTER_SIZES,
    PAPER_COMPACTION,
    RANDOM_CLOSE_PACKING,
    filling_of_height,
    hull_area,
    layer_filling,
    paper_cluster_filling,
)

PAPER = json.loads((Path(__file__).parents[1] / 'paper_values.json').read_text())
R = 0.001
VOLUME = 4.0 / 3.0 * math.pi * R**3


def perimeter(places):
    """Of the hull of discs of radius R: that of the centres, and one circle."""
    try:
        hull = ConvexHull(places).area
    except QhullError:
        hull = 2.0 * np.linalg.norm(np.ptp(places, axis=0))
    return hull + 2.0 * math.pi * R


def least_hull_area(beads, perimeter):
    """Lower bound of the hull area of discs of radius R that do not overlap, [m^2].

    Groemer 1960, Math. Z. 73, 285.
    """
    root = math.sqrt(3.0)
    area = 2.0 * root * (beads - 1) + (1.0 - 0.5 * root) * perimeter / R + math.pi * (root - 1.0)
    return area * R**2


def test_the_numbers_of_the_paper_are_those_printed():
    assert PAPER['filling_factor']['rcp'] == RANDOM_CLOSE_PACKING
    printed = PAPER['filling_factor']['relative_compaction_percent']
    assert {str(k): pytest.approx(100 * v) for k, v in PAPER_COMPACTION.items()} == printed
    for tray, size in PAPER_CLUSTER_SIZES.items():
        assert PAPER['table3_clusters']['rows'][str(tray)][1] == size


def test_a_hexagonal_layer_fills_0_605():
    # One bead in its cell: a hexagon of inner radius R, 2R high.
    assert pytest.approx(VOLUME / (2 * math.sqrt(3) * R**2 * 2 * R)) == HEXAGONAL_LAYER
    assert pytest.approx(0.6046, abs=5e-5) == HEXAGONAL_LAYER


@pytest.mark.parametrize('area', [3e-6, 4e-5])
def test_the_paper_has_twice_the_filling_of_a_layer(area):
    paper = paper_cluster_filling(7, VOLUME, area, R)
    assert paper == pytest.approx(2.0 * layer_filling(np.full(7, R), area))


def test_a_close_packed_layer_is_more_than_full_by_the_papers_formula():
    patch = hexagonal_patch(91, R)
    filling = paper_cluster_filling(91, VOLUME, hull_area(patch, np.full(91, R)), R)
    assert 1.1 < filling < 2.0 * HEXAGONAL_LAYER


@pytest.mark.parametrize(
    ('places', 'area'),
    [
        ([(0, 0)], math.pi),
        ([(0, 0), (2, 0)], math.pi + 4),
        ([(0, 0), (2, 0), (1, math.sqrt(3))], math.pi + 6 + math.sqrt(3)),
        ([(0, 0), (2, 0), (2, 2), (0, 2)], math.pi + 8 + 4),
        # The disc in the middle is within the hull of the others.
        ([(0, 0), (4, 0), (4, 4), (0, 4), (2, 2)], math.pi + 16 + 16),
    ],
)
def test_the_hull_of_discs_has_the_area_of_the_hull_of_centres_a_rim_and_a_disc(places, area):
    area_of_hull = hull_area(R * np.array(places, dtype=float), np.full(len(places), R))
    assert area_of_hull == pytest.approx(area * R**2, rel=3e-5)


def test_a_disc_inside_another_adds_nothing_to_the_hull():
    places = np.array([[0.0, 0.0], [0.5 * R, 0.0]])
    assert hull_area(places, np.array([2 * R, R])) == pytest.approx(4 * math.pi * R**2, rel=3e-5)


def test_the_hull_of_two_discs_of_different_size_is_a_belt_around_two_wheels():
    big, small, apart = 2 * R, R, 3 * R
    lean = math.asin((big - small) / apart)
    straight = math.sqrt(apart**2 - (big - small) ** 2)
    belt = (
        (math.pi / 2 + lean) * big**2 + (math.pi / 2 - lean) * small**2 + straight * (big + small)
    )
    area_of_hull = hull_area(np.array([[0.0, 0.0], [apart, 0.0]]), np.array([big, small]))
    assert area_of_hull == pytest.approx(belt, rel=3e-5)


@pytest.mark.parametrize('rings', [1, 2, 3])
def test_a_hexagon_of_touching_discs_has_its_exact_filling(rings):
    n = 1 + 3 * rings * (rings + 1)
    side = 2 * R * rings
    hull = 1.5 * math.sqrt(3) * side**2 + 6 * side * R + math.pi * R**2
    patch = hexagonal_patch(n, R)
    assert layer_filling(np.full(n, R), hull_area(patch, np.full(n, R))) == pytest.approx(
        2 / 3 * n * math.pi * R**2 / hull, rel=3e-5
    )
    # Of all orders of so many discs with this perimeter, none has a smaller hull.
    assert hull == pytest.approx(least_hull_area(n, 6 * side + 2 * math.pi * R))


def test_discs_of_a_patch_touch_and_do_not_overlap():
    for n in (2, 7, 12, 40):
        patch = hexagonal_patch(n, R)
        gaps = np.linalg.norm(patch[:, None] - patch, axis=2)[~np.eye(n, dtype=bool)]
        assert gaps.min() == pytest.approx(2 * R)
        assert np.allclose(np.reshape(gaps, (n, n - 1)).min(axis=1), 2 * R, rtol=1e-9)


@given(some.integers(0, 10_000), some.integers(2, 12))
def test_no_flat_cluster_fills_more_than_hexagonal_order_or_has_less_than_groemers_hull(seed, n):
    rng = np.random.default_rng(seed)
    places = [np.zeros(2)]
    while len(places) < n:
        # On the rim of a bead that is there, not within another: a cluster as they grow.
        angle = rng.uniform(0.0, 2.0 * math.pi)
        start = places[rng.integers(len(places))]
        new = start + 2 * R * np.array([math.cos(angle), math.sin(angle)])
        if min(np.linalg.norm(new - place) for place in places) > 2 * R * (1 - 1e-9):
            places.append(new)
    places = np.array(places)
    area = hull_area(places, np.full(n, R))
    assert layer_filling(np.full(n, R), area) < HEXAGONAL_LAYER
    assert area > least_hull_area(n, perimeter(places)) * (1 - 3e-5)


def test_folding_a_chain_into_a_patch_raises_its_filling():
    n = 7
    chain = np.column_stack((2 * R * np.arange(n), np.zeros(n)))
    bent = chain.copy()
    bent[4:] = chain[3] + 2 * R * np.column_stack((np.zeros(3), np.arange(1, 4)))
    fillings = [
        layer_filling(np.full(n, R), hull_area(places, np.full(n, R)))
        for places in (bent, chain, hexagonal_patch(n, R))
    ]
    assert fillings == sorted(fillings)
    assert fillings[2] / fillings[0] > 1.5


def test_the_hull_of_a_closely_filled_chain_would_not_tell_it_from_hexagonal_order():
    # What the docstring of hull_area says: a disc, and on both sides the gap to the next one
    # that no further disc enters.
    gap = math.sqrt(3) * R**2 - 0.5 * math.pi * R**2
    assert math.pi * R**2 / (math.pi * R**2 + 2 * gap) == pytest.approx(HEXAGONAL_AREA)


def test_of_any_sizes_a_layer_fills_two_thirds_of_the_area_that_its_beads_cover():
    radii = np.array([R, R, 0.5 * R, 0.7 * R])
    area = 1.3 * math.pi * np.sum(radii**2)
    assert layer_filling(radii, area) == pytest.approx(2 / 3 / 1.3)
    height = 2 * np.sum(radii**3) / np.sum(radii**2)
    assert filling_of_height(radii, area, height) == pytest.approx(2 / 3 / 1.3)


def test_turning_moving_and_scaling_a_cluster_changes_nothing():
    rng = np.random.default_rng(5)
    places, radii = rng.normal(0.0, 3 * R, (9, 2)), rng.uniform(0.5 * R, R, 9)
    turn = np.array([[math.cos(1.0), -math.sin(1.0)], [math.sin(1.0), math.cos(1.0)]])
    moved = 3.0 * (places @ turn.T + 0.01)
    assert layer_filling(3 * radii, hull_area(moved, 3 * radii)) == pytest.approx(
        layer_filling(radii, hull_area(places, radii)), rel=5e-5
    )


@pytest.mark.parametrize(
    'call',
    [
        lambda: layer_filling(np.array([]), 1e-6),
        lambda: layer_filling(np.array([R, -R]), 1e-6),
        lambda: layer_filling(np.array([R]), 0.0),
        lambda: paper_cluster_filling(0, VOLUME, 1e-6, R),
        lambda: paper_cluster_filling(3, VOLUME, math.nan, R),
        lambda: hull_area(np.zeros((2, 3)), np.full(2, R)),
        lambda: hull_area(np.array([[math.inf, 0.0]]), np.array([R])),
        lambda: filling_of_height(np.array([R]), 1e-6, -1.0),
    ],
)
def test_wrong_clusters_are_refused_in_one_line(call):
    with pytest.raises(ConfigurationError) as caught:
        call()
    assert '\n' not in str(caught.value)
