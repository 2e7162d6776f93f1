"""Edges vote for the centres of discs of the right size and brightness."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from nanorocks_ros.stages.tracking.scene.outlines.edge_votes import (
    Voting,
    centres_of_all_sizes,
    find_centres,
)

DISCS = np.array([[60.0, 50.0, 10.0], [130.0, 90.0, 10.0], [40.0, 120.0, 10.0]])


def picture_of(discs, *, floor=120.0, inside=60.0, size=(160, 200)):
    y, x = np.mgrid[: size[0], : size[1]]
    picture = np.full(size, floor)
    for column, row, radius in discs:
        cover = np.clip(radius - np.hypot(x - column, y - row) + 0.5, 0.0, 1.0)
        picture += (inside - floor) * cover
    noise = np.random.default_rng(1).normal(0.0, 1.0, size)
    return np.rint(cv2.GaussianBlur(picture, (0, 0), 0.8) + noise).astype(np.uint8)


def voting(sign, smallest=8.0, largest=12.0):
    return Voting(smallest, largest, sign, 60.0, 1.0)


@pytest.mark.parametrize(('sign', 'inside'), [(-1, 60.0), (1, 180.0), (0, 60.0)])
def test_each_disc_is_the_centre_of_most_of_its_outline(sign, inside):
    centres = find_centres(picture_of(DISCS, inside=inside), voting(sign), 0.5)
    best = centres[: len(DISCS)]
    apart = np.hypot(*(best[:, None, :2] - DISCS[None, :, :2]).transpose(2, 0, 1))
    assert sorted(apart.argmin(axis=1).tolist()) == [0, 1, 2]
    assert apart.min(axis=1).max() < 1.5
    assert best[:, 3].min() > 0.7


def test_discs_of_the_other_brightness_get_no_votes():
    centres = find_centres(picture_of(DISCS, inside=180.0), voting(-1), 0.5)
    apart = np.hypot(*(centres[:, None, :2] - DISCS[None, :, :2]).transpose(2, 0, 1))
    assert len(centres) == 0 or apart.min() > 4.0


def test_a_straight_edge_has_few_votes():
    picture = np.full((160, 200), 120, np.uint8)
    picture[80:] = 60
    centres = find_centres(picture, voting(-1), 0.0)
    assert len(centres) == 0 or centres[:, 3].max() < 0.5


def test_discs_of_very_different_sizes_are_found_in_parts():
    discs = np.array([[60.0, 60.0, 5.0], [130.0, 90.0, 25.0]])
    centres = centres_of_all_sizes(picture_of(discs), voting(-1, 4.0, 30.0), 0.5)
    for disc in discs:
        near = np.hypot(*(centres[:, :2] - disc[:2]).T) < 2.0
        assert (np.abs(np.log(centres[near, 2] / disc[2])) < 0.35).any()


def test_large_discs_are_found_where_they_are_in_the_reduced_picture():
    discs = np.array([[100.0, 80.0, 40.0]])
    centres = find_centres(picture_of(discs), voting(-1, 34.0, 46.0), 0.5)
    assert np.hypot(*(centres[0, :2] - discs[0, :2])) < 4.0
