"""Discs that are known to be beads."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.tracking.scene.known_beads import ALIKE, KnownBeads

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


def test_a_finger_tip_of_the_colour_of_a_bead_has_another_size(known):
    assert known.have_size(np.array([14.0, 15.0, 16.5])).all()
    assert not known.have_size(np.array([11.9, 20.0])).any()


def test_few_mistakes_do_not_count_as_beads():
    colours = np.tile(ORANGE, (99, 1))
    mixed = KnownBeads.of(np.vstack([colours, [[255.0] * 3]]), np.full(100, 15.0))
    assert mixed.distances(np.array([[255.0] * 3]), np.array([15.0]))[0] > ALIKE
