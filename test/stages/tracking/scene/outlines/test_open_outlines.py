"""The end of something longer that moves is no bead; what only touches something is one."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from nanorocks_ros.stages.tracking.scene.outlines.open_outlines import ends_of_others

FLOOR, BEAD = (30, 30, 30), (60, 120, 200)
RADIUS = 12
CENTRE = (60, 60)


def ends(discs, *, to=None, wall=0, size=(160, 120)):
    """Ends among discs, in a picture of them, of a stroke from the first, and of a wall."""
    picture = np.full((size[1], size[0], 3), FLOOR, dtype=np.uint8)
    moving = np.zeros((size[1], size[0]), dtype=np.uint8)
    picture[:, :wall] = BEAD
    for x, y, radius in discs:
        cv2.circle(picture, (x, y), radius, BEAD, -1)
        cv2.circle(moving, (x, y), radius, 1, -1)
    if to is not None:
        cv2.line(picture, discs[0][:2], to, BEAD, 2 * RADIUS)
        cv2.line(moving, discs[0][:2], to, 1, 2 * RADIUS)
    count = len(discs)
    colours = (
        np.tile(np.array(BEAD, float), (count, 1)),
        np.tile(np.array(FLOOR, float), (count, 1)),
    )
    support = np.full(count, 0.6)
    return ends_of_others(picture, moving, np.array(discs, float), support, colours).tolist()


@pytest.mark.parametrize('to', [(140, 60), (0, 60), (60, 119), (120, 110)])
def test_the_tip_of_a_finger_is_an_end(to):
    assert ends([(*CENTRE, RADIUS)], to=to) == [True]


def test_a_bead_alone_or_at_the_border_is_none():
    assert ends([(*CENTRE, RADIUS)]) == [False]
    assert ends([(6, 60, RADIUS)]) == [False]


def test_a_bead_at_a_wall_of_its_colour_is_none():
    assert ends([(*CENTRE, RADIUS)], wall=CENTRE[0] - RADIUS + 2) == [False]


def test_beads_that_touch_are_none():
    assert ends([(*CENTRE, RADIUS), (CENTRE[0] + 2 * RADIUS - 4, 60, RADIUS)]) == [False, False]


def test_a_bead_smeared_to_both_sides_is_none():
    cut = ends([(*CENTRE, RADIUS)], to=(CENTRE[0] + 12, 60))
    picture = np.full((120, 160, 3), FLOOR, dtype=np.uint8)
    moving = np.zeros((120, 160), dtype=np.uint8)
    for image, colour in ((picture, BEAD), (moving, 1)):
        cv2.line(image, (CENTRE[0] - 12, 60), (CENTRE[0] + 12, 60), colour, 2 * RADIUS)
    colours = np.array([BEAD], float), np.array([FLOOR], float)
    disc = np.array([[*CENTRE, RADIUS]], float)
    assert not ends_of_others(picture, moving, disc, np.array([0.6]), colours).any()
    assert cut == [True]


def test_a_whole_outline_is_not_looked_at():
    picture, moving = np.full((120, 160, 3), BEAD, np.uint8), np.ones((120, 160), np.uint8)
    colours = np.array([BEAD], float), np.array([FLOOR], float)
    disc = np.array([[*CENTRE, RADIUS]], float)
    assert not ends_of_others(picture, moving, disc, np.array([0.9]), colours).any()
