"""Discs that lie on one another, and the colours of circles around discs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nanorocks_ros.stages.tracking.scene.outlines.disc_kernels import have_near
from nanorocks_ros.stages.tracking.scene.outlines.disc_measures import apart, ring_colours
from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import Outlines


def outlines_of(discs, support):
    count = len(discs)
    return Outlines(
        np.array(discs), np.zeros(count), np.zeros(count), np.array(support), np.ones(count)
    )


def test_of_discs_that_lie_on_one_another_the_best_is_kept():
    outlines = outlines_of(
        [[10.0, 10.0, 5.0], [13.0, 10.0, 5.0], [17.0, 10.0, 5.0], [40.0, 10.0, 5.0]],
        [0.8, 0.9, 0.7, 0.6],
    )
    assert apart(outlines).tolist() == [False, True, False, True]
    # The third lies on the second, which is left out itself where it is the worst.
    weak = outlines._replace(support=np.array([0.9, 0.6, 0.7, 0.6]))
    assert apart(weak).tolist() == [True, False, True, True]


def test_discs_one_distance_apart_are_all_kept():
    places = np.array([(11.0 * i, 11.0 * j, 5.0) for i in range(20) for j in range(20)])
    assert apart(outlines_of(places, np.full(400, 0.9)), 2.0).all()


@pytest.mark.parametrize('parts', [(0.5, 1.2), (0.5,), (0.15, 0.45, 0.7)])
@pytest.mark.parametrize('levels', [2, 256])
def test_the_colour_of_a_circle_is_the_median_of_its_pixels(parts, levels):
    rng = np.random.default_rng(1)
    color = rng.integers(256 - levels, 256, (60, 80, 3), dtype=np.uint8)
    discs = np.column_stack([rng.uniform(-3, 83, 50), rng.uniform(-3, 63, 50), np.full(50, 6.0)])
    turns = np.arange(8) * 0.25 * np.pi
    expected = []
    for column, row, radius in discs:
        x = np.rint(column + radius * np.outer(parts, np.cos(turns)).ravel())
        y = np.rint(row + radius * np.outer(parts, np.sin(turns)).ravel())
        pixels = color[np.clip(y, 0, 59).astype(int), np.clip(x, 0, 79).astype(int)]
        expected.append(np.median(pixels, axis=0))
    assert np.array_equal(ring_colours(color, discs, parts), expected)


def test_no_disc_has_no_colour():
    assert ring_colours(np.zeros((5, 5, 3), np.uint8), np.empty((0, 3)), (0.5,)).shape == (0, 3)


def test_the_colour_of_a_disc_that_is_nowhere_is_that_of_a_corner():
    color = np.zeros((4, 5, 3), np.uint8)
    color[0, 0] = 9
    nowhere = np.array([[np.nan, np.nan, 3.0]])
    assert ring_colours(color, nowhere, (0.5,)).tolist() == [[9.0, 9.0, 9.0]]


@given(
    st.integers(0, 12),
    st.integers(0, 12),
    st.floats(0.0, 30.0),
    st.integers(1, 3),
    st.integers(0, 1000),
)
def test_places_are_near_when_enough_others_are_within_reach(count, others, reach, least, seed):
    rng = np.random.default_rng(seed)
    places, known = rng.uniform(0.0, 50.0, (count, 2)), rng.uniform(0.0, 50.0, (others, 2))
    near = np.empty(count, dtype=bool)
    have_near(places, known, np.full(count, reach), least, near)
    away = np.hypot(*(places[:, None, k] - known[None, :, k] for k in range(2)))
    assert near.tolist() == ((away < reach).sum(axis=1) >= least).tolist()
