"""Circles are fitted to the edges along rays, with errors that hold."""

from __future__ import annotations

import cv2
import numpy as np

from nanorocks_ros.stages.tracking.scene.outlines.edge_votes import Voting
from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import fit_outlines

VOTING = Voting(8.0, 14.0, -1, 70.0, 2.0)


def drawn(discs, *, noise=2.0, seed=1, size=(200, 300)):
    y, x = np.mgrid[: size[0], : size[1]]
    picture = np.full(size, 150.0)
    for column, row, radius in discs:
        picture -= 80.0 * np.clip(radius - np.hypot(x - column, y - row) + 0.5, 0.0, 1.0)
    picture = cv2.GaussianBlur(picture, (0, 0), 0.9)
    picture += np.random.default_rng(seed).normal(0.0, noise, size)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def grid_of_discs():
    rng = np.random.default_rng(3)
    places = np.array([(30.0 + 40.0 * i, 30.0 + 40.0 * j) for i in range(6) for j in range(4)])
    return np.column_stack([places + rng.uniform(-3, 3, places.shape), rng.uniform(9, 13, 24)])


def test_centres_and_radii_are_right_to_a_twentieth_of_a_pixel():
    discs = grid_of_discs()
    starts = discs + np.random.default_rng(4).uniform(-2.0, 2.0, discs.shape)
    outlines = fit_outlines(drawn(discs), starts, VOTING)
    off = outlines.discs - discs
    assert np.sqrt((off[:, :2] ** 2).mean()) < 0.06
    assert np.abs(off[:, 2]).max() < 0.3
    assert outlines.support.min() > 0.9


def test_stated_errors_are_those_of_the_scatter():
    discs = grid_of_discs()
    off, errors = [], []
    for seed in range(8):
        outlines = fit_outlines(drawn(discs, noise=6.0, seed=seed), discs, VOTING)
        off.append(outlines.discs[:, :2] - discs[:, :2])
        errors.append(outlines.errors)
    ratio = np.sqrt(np.mean(np.square(off))) / np.sqrt(np.mean(np.square(errors)))
    assert 0.4 < ratio < 1.6


def test_half_of_an_outline_still_gives_the_circle():
    picture = drawn([[100.0, 100.0, 12.0]])
    picture[100:] = 150
    outlines = fit_outlines(picture, np.array([[100.0, 99.0, 11.0]]), VOTING)
    assert 0.35 < outlines.support[0] < 0.75
    assert np.hypot(*(outlines.discs[0, :2] - 100.0)) < 1.0


def test_where_there_is_no_disc_there_is_no_support():
    outlines = fit_outlines(drawn([]), np.array([[100.0, 100.0, 10.0]]), VOTING)
    assert outlines.support[0] == 0.0


def test_no_disc_is_no_circle():
    outlines = fit_outlines(drawn([]), np.empty((0, 3)), VOTING)
    assert outlines.discs.shape == (0, 3)
    assert outlines.support.shape == (0,)


def test_discs_that_are_nowhere_and_pictures_of_a_pixel_have_no_support():
    nowhere = np.array([[np.nan, 20.0, 10.0], [1e30, -1e30, 10.0], [50.0, 50.0, np.nan]])
    assert (fit_outlines(drawn([]), nowhere, VOTING).support == 0.0).all()
    pixel = np.full((1, 1), 90, np.uint8)
    assert (fit_outlines(pixel, np.array([[0.0, 0.0, 10.0]]), VOTING).support == 0.0).all()


def test_beyond_the_border_of_the_picture_the_circle_is_the_same():
    # Rays that leave the picture are sampled in another way than those within.
    discs = grid_of_discs()
    picture = drawn(discs)
    whole = fit_outlines(picture, discs, VOTING)
    left = discs[:, 0] < 40.0
    column = int((discs[left, 0] - discs[left, 2]).min()) - 1
    shift = np.array([column, 0.0, 0.0])
    cut = fit_outlines(picture[:, column:], discs[left] - shift, VOTING)
    rays_lost = cut.support < whole.support[left]
    assert rays_lost.any()
    assert np.abs(cut.discs + shift - whole.discs[left]).max() < 0.15
    within = fit_outlines(picture[:, column:], discs[~left] - shift, VOTING)
    np.testing.assert_allclose(within.discs + shift, whole.discs[~left], rtol=0.0, atol=1e-3)
