"""Packing of the clusters of a tray, from places and bodies."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hexagonal_discs import hexagonal_patch

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.physics.filling_factor import HEXAGONAL_LAYER
from nanorocks_ros.stages.clusters.packing_density import bodies_of_pairs, packing_of_clusters

R, HEIGHT = 0.001, 0.003


def two_clusters():
    """A pair, a hexagon of 7, and a bead of its own."""
    places = np.concatenate((hexagonal_patch(2, R), hexagonal_patch(7, R) + 0.02, [[0.05, 0.05]]))
    return places, np.full(10, R), np.array([0] * 2 + [2] * 7 + [9])


def test_areas_and_beads_of_clusters_are_added_before_they_are_divided():
    packing = packing_of_clusters(*two_clusters(), HEIGHT)
    assert packing.clusters == 2
    assert packing.beads == 4.5
    pair, hexagon = math.pi + 4, math.pi + 12 + 6 * math.sqrt(3)
    assert packing.area == pytest.approx(0.5 * (pair + hexagon) * R**2, rel=3e-5)
    assert packing.filling == pytest.approx(2 / 3 * 9 * math.pi / (pair + hexagon), rel=3e-5)
    assert packing.filling < HEXAGONAL_LAYER
    assert packing.paper == pytest.approx(2 * packing.filling)
    assert packing.least == pytest.approx(packing.filling * 2 * R / HEIGHT)


def test_the_error_is_half_of_the_difference_that_either_of_two_clusters_makes():
    packing = packing_of_clusters(*two_clusters(), HEIGHT)
    pair, hexagon = math.pi + 4, math.pi + 12 + 6 * math.sqrt(3)
    alone = 2 / 3 * math.pi * np.array([2 / pair, 7 / hexagon])
    assert packing.filling_error == pytest.approx(0.5 * abs(alone[0] - alone[1]), rel=1e-2)


def test_a_single_cluster_has_no_error_that_is_known():
    places, radii = hexagonal_patch(4, R), np.full(4, R)
    assert math.isnan(packing_of_clusters(places, radii, np.zeros(4, int), HEIGHT).filling_error)


def test_the_error_is_what_clusters_scatter_by():
    rng = np.random.default_rng(1)

    def drawn():
        chains = [
            np.cumsum(2 * R * np.column_stack((np.cos(a), np.sin(a))), axis=0)
            for a in np.cumsum(rng.uniform(-1.0, 1.0, (12, 4)), axis=1)
        ]
        return packing_of_clusters(
            np.concatenate(chains), np.full(48, R), np.repeat(np.arange(12), 4), HEIGHT
        )

    several = [drawn() for _ in range(60)]
    scatter = np.std([packing.filling for packing in several])
    assert np.mean([packing.filling_error for packing in several]) == pytest.approx(
        scatter, rel=0.3
    )


def test_without_clusters_there_is_no_packing():
    places, radii, _ = two_clusters()
    assert packing_of_clusters(places, radii, np.arange(10), HEIGHT) is None


def test_pairs_that_stick_make_bodies_through_beads_that_are_not_seen():
    labels = bodies_of_pairs(np.array([7, 3, 5, 8]), [(8, 4), (3, 4), (5, 6)])
    assert labels.tolist() == [7, 3, 5, 3]


def test_other_shapes_are_refused():
    places, radii, bodies = two_clusters()
    with pytest.raises(ConfigurationError, match='a body for each bead'):
        packing_of_clusters(places, radii, bodies[:-1], HEIGHT)
