"""Outlines in a picture, and where beads are expected."""

from __future__ import annotations

import cv2
import numpy as np

from nanorocks_ros.stages.tracking.scene.outlines.edge_votes import Voting
from nanorocks_ros.stages.tracking.scene.outlines.outline_search import search_outlines

VOTING = Voting(9.0, 18.0, -1, 60.0, 1.0)
DISC = np.array([80.0, 60.0, 12.0])


def picture():
    y, x = np.mgrid[:120, :160]
    cover = np.clip(DISC[2] + 0.5 - np.hypot(x - DISC[0], y - DISC[1]), 0.0, 1.0)
    noise = np.random.default_rng(1).normal(0.0, 1.0, x.shape)
    return np.rint(cv2.GaussianBlur(150.0 - 80.0 * cover, (0, 0), 0.8) + noise).astype(np.uint8)


def found(radius):
    """Outlines on the disc, where a bead of this radius is expected."""
    outlines = search_outlines(picture(), VOTING, DISC[None] * [1.0, 1.0, radius / DISC[2]])
    off = np.hypot(*(outlines.discs[:, :2] - DISC[:2]).T)
    return outlines.chosen(off < 2.0)


def test_no_votes_are_followed_where_an_expected_bead_shows_well():
    assert len(found(DISC[2]).steps) == 1


def test_votes_are_followed_where_the_circle_has_another_size_than_the_bead():
    outlines = found(1.3 * DISC[2])
    assert len(outlines.steps) > 1
    np.testing.assert_allclose(outlines.discs[:, 2], DISC[2], atol=0.5)
