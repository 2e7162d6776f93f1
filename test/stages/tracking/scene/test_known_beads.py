"""Discs that are known to be beads."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.tracking.scene.bead_looks import Candidates
from nanorocks_ros.stages.tracking.scene.known_beads import ALIKE, AtRest, KnownBeads
from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import Outlines

ORANGE = np.array([70.0, 120.0, 220.0])


@pytest.fixture(scope='module')
def known():
    rng = np.random.default_rng(3)
    return KnownBeads.of(ORANGE + rng.normal(0.0, 4.0, (40, 3)), rng.normal(15.0, 0.2, 40))


def test_nothing_is_known_without_beads():
    assert KnownBeads.of(np.empty((0, 3)), np.empty(0)) is None


def test_other_colours_are_farther_away(known):
    own, blue = known.distances(np.array([ORANGE, ORANGE[::-1]]), np.array([15.0, 15.0]))
    assert own < ALIKE < blue


@pytest.mark.parametrize('count', [1, 5, 8, 40, 700])
def test_those_are_near_whose_distance_is_below_the_limit(count):
    rng = np.random.default_rng(count)
    beads = KnownBeads.of(rng.uniform(0.0, 255.0, (count, 3)), rng.uniform(10.0, 12.0, count))
    colours, radii = rng.uniform(0.0, 255.0, (300, 3)), rng.uniform(9.0, 13.0, 300)
    distances = beads.distances(colours, radii)
    # None equal to a distance, whose rounding would decide.
    limits = 1.0000001 * rng.permutation(distances)
    assert np.array_equal(beads.are_near(colours, radii, limits), distances < limits)
    assert beads.are_near(colours, radii, limits).any()


def test_a_finger_tip_of_the_colour_of_a_bead_has_another_size(known):
    assert known.have_size(np.array([14.0, 15.0, 16.5])).all()
    assert not known.have_size(np.array([11.9, 20.0])).any()


def test_few_mistakes_do_not_count_as_beads():
    colours = np.tile(ORANGE, (99, 1))
    mixed = KnownBeads.of(np.vstack([colours, [[255.0] * 3]]), np.full(100, 15.0))
    assert mixed.distances(np.array([[255.0] * 3]), np.array([15.0]))[0] > ALIKE


def discs(quality, moving):
    """Discs whose outlines have a quality, and of which a share moves."""
    count = len(quality)
    none, colours = np.zeros(count), np.zeros((count, 3))
    outlines = Outlines(np.ones((count, 3)), none, none, np.array(quality), np.ones(count))
    return Candidates(outlines, colours, colours, colours, np.array(moving), none.astype(bool))


def test_stains_do_not_show_as_well_as_beads_that_move():
    at_rest = AtRest.beside(discs(np.linspace(0.8, 1.0, 40), np.full(40, 0.6)))
    rested = at_rest.allows(discs([0.35, 0.35, 0.9, 0.9], [0.0, 0.25, 0.0, 0.6]))
    assert rested.tolist() == [False, False, True, True]


def test_a_bead_that_moves_may_show_badly():
    at_rest = AtRest.beside(discs(np.linspace(0.8, 1.0, 40), np.full(40, 0.6)))
    assert at_rest.allows(discs([0.35], [0.5])).all()


def test_without_beads_that_move_any_disc_may_rest():
    assert AtRest().allows(discs([0.2], [0.0])).all()


def test_colours_of_known_beads_are_those_of_the_discs():
    colours = np.array([[10.0, 20.0, 30.0], [60.0, 80.0, 40.0]])
    assert np.allclose(KnownBeads.of(colours, np.full(2, 9.0)).colours, colours)
