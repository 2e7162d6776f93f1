"""Bodies from bonds, and the size statistics of an estimate."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.bodies.body_sizes import bodies_of, joined_bodies, size_statistics
from nanorocks_ros.stages.bodies.bonds import Bond


def test_beads_bonded_to_an_unlisted_bead_are_one_body():
    assert bodies_of([1, 2, 3, 4], [(2, 9), (3, 9)]) == {1: 1, 2: 2, 3: 2, 4: 4}


def _bond(first, second, start):
    return Bond((first, second), start, (2e-3, 0.0), 1e-4)


def test_a_bond_joins_the_bodies_of_that_time():
    bond = _bond(1, 2, 1.0)
    bonds = [bond, _bond(2, 3, 0.5), _bond(3, 4, 0.8)]
    assert joined_bodies(bond, bonds, 0.9) == ({1}, {2, 3, 4})
    assert joined_bodies(bond, bonds, 0.6) == ({1}, {2, 3})
    assert joined_bodies(bond, bonds, 0.4) == ({1}, {2})


def test_a_bond_between_beads_of_one_body_has_it_on_both_sides():
    bond = _bond(1, 3, 1.0)
    one, other = joined_bodies(bond, [_bond(1, 2, 0.2), _bond(2, 3, 0.3)], 0.9)
    assert one == other == {1, 2, 3}


def test_sizes_are_means_over_bodies_and_over_beads():
    statistics = size_statistics(np.array([1, 1, 1, 2, 3, 7]), 15, [])
    assert statistics.bodies.value == 6.0
    assert statistics.mean_size.value == pytest.approx(2.5)
    assert statistics.weighted_size.value == pytest.approx((3 + 4 + 9 + 49) / 15)
    assert statistics.clustered_share.value == pytest.approx(12 / 15)
    assert statistics.clusters.value == 3.0
    assert statistics.counts.tolist() == [3.0, 1.0, 1.0, 0.0, 1.0]
    assert statistics.bodies.error == 0.0


def test_a_merge_of_probability_one_half_sets_the_errors():
    statistics = size_statistics(np.array([1, 1, 3]), 5, [(1, 3, 0.5)])
    # The mean shift and the scatter of one merge or none, in squares.
    assert statistics.bodies.error == pytest.approx(np.sqrt(0.5**2 + 0.25))
    assert statistics.weighted_size.error == pytest.approx(np.sqrt(0.5) * 2 * 3 / 5)
    assert statistics.clustered_share.error == pytest.approx(np.sqrt(0.5) / 5)


def test_double_detections_do_not_make_bodies_larger_than_the_tray_has_beads():
    statistics = size_statistics(np.array([12]), 10, [])
    assert statistics.weighted_size.value == pytest.approx(10.0)
    assert statistics.bodies.error > 0.0
    # One body is seen; 10/12 of one is none.
    assert statistics.bodies.value == statistics.clusters.value == 1.0
