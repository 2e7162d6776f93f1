"""Beads that move while the shutter is open are found where they are in its middle."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from nanorocks_ros.stages.tracking.scene.outlines.edge_votes import Voting
from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import fit_outlines
from nanorocks_ros.stages.tracking.scene.outlines.smeared_discs import smeared_discs

PLACE = np.array([152.0, 121.0])


def smeared(radius, smear, turn=0.7, size=(240, 300)):
    """A dark disc, the mean over its way, smear in px; and where the floor changes."""
    y, x = np.mgrid[: size[0], : size[1]]
    cover = np.zeros(size)
    steps = np.linspace(-0.5, 0.5, 41)
    for part in steps:
        column, row = PLACE + part * smear * np.array([np.cos(turn), np.sin(turn)])
        cover += np.clip(radius - np.hypot(x - column, y - row) + 0.5, 0.0, 1.0) / len(steps)
    noise = np.random.default_rng(1).normal(0.0, 2.0, size)
    picture = cv2.GaussianBlur(160.0 - 80.0 * cover, (0, 0), 0.8) + noise
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8), (cover > 0.1).astype(np.uint8)


@pytest.mark.parametrize(('radius', 'smear'), [(12.0, 9.0), (40.0, 20.0), (40.0, 32.0)])
def test_a_smeared_bead_is_found_in_the_middle_of_its_way(radius, smear):
    picture, moving = smeared(radius, smear)
    voting = Voting(radius / 1.2, radius * 1.2, -1, 70.0, 2.0)
    start = np.array([[*PLACE + 3.0, radius]])
    found = smeared_discs(picture, moving, start, voting)
    assert len(found.support) == 1
    # Within what is stated, and an eighth of the radius.
    off = np.hypot(*(found.discs[0, :2] - PLACE))
    assert off < min(0.12 * radius, 4.0 * found.errors[0])
    assert found.discs[0, 2] == pytest.approx(radius, rel=0.15)


def test_a_circle_alone_loses_a_smeared_bead():
    picture, moving = smeared(40.0, 30.0)
    voting = Voting(33.0, 48.0, -1, 70.0, 2.0)
    start = np.array([[*PLACE, 40.0]])
    assert fit_outlines(picture, start, voting).support[0] < 0.5
    assert smeared_discs(picture, moving, start, voting).support[0] > 0.6


def test_what_does_not_move_is_not_smeared():
    picture, moving = smeared(40.0, 30.0)
    voting = Voting(33.0, 48.0, -1, 70.0, 2.0)
    start = np.array([[*PLACE, 40.0]])
    assert len(smeared_discs(picture, np.zeros_like(moving), start, voting).support) == 0


def test_a_rod_is_no_smeared_disc():
    picture = np.full((240, 300), 160, np.uint8)
    cv2.line(picture, (90, 120), (210, 120), 80, 24)
    voting = Voting(10.0, 15.0, -1, 70.0, 2.0)
    starts = np.array([[float(x), 120.0, 12.0] for x in range(90, 211, 6)])
    moving = (picture < 120).astype(np.uint8)
    found = smeared_discs(cv2.GaussianBlur(picture, (0, 0), 0.8), moving, starts, voting)
    assert len(found.support) == 0
