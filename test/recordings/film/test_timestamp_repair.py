"""Stamps rise whatever the times, and are left alone where they do."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nanorocks_ros.recordings.film.timestamp_repair import Repairs, Steady

STEP = 40
TIMES = st.lists(st.none() | st.integers(-(10**4), 10**4), max_size=40)


def steadied(times):
    steady = Steady(STEP)
    stamped = list(steady.stamps((time, place) for place, time in enumerate(times)))
    return [one.stamp_ns for one in stamped], [one.item for one in stamped], steady.repairs


@given(TIMES)
def test_stamps_rise_and_no_picture_is_lost(times):
    stamps, places, _ = steadied(times)
    assert all(one < other for one, other in pairwise(stamps))
    assert sorted(places) == list(range(len(times)))


@given(st.lists(st.integers(0, 10**6), unique=True, max_size=40).map(sorted))
def test_times_that_rise_are_left_alone(times):
    assert steadied(times) == (times, list(range(len(times))), Repairs())


def test_pictures_without_a_time_lie_between_their_neighbours():
    stamps, _, repairs = steadied([0, 40, None, 120, None, 160, None, None])
    assert stamps == [0, 40, 80, 120, 140, 160, 200, 240]
    assert repairs.missing == 4


def test_a_film_without_times_has_the_usual_step():
    assert steadied([None] * 4)[0] == [0, 40, 80, 120]


def test_one_time_far_ahead_is_replaced():
    stamps, places, repairs = steadied([0, 40, 80, 9000, *range(160, 600, 40)])
    assert stamps == list(range(0, 600, 40))
    assert places == list(range(15))
    assert repairs == Repairs(replaced=1)


def test_the_same_time_twice_is_parted():
    stamps, _, repairs = steadied([0, 40, 40, 80, 120])
    assert stamps == [0, 40, 60, 80, 120]
    assert repairs == Repairs(replaced=1)


@pytest.mark.parametrize('first', [[80, 0, 40], [40, 0, 80], [120, 0, 80, 40]])
def test_the_first_pictures_are_sorted_by_their_times_too(first):
    times = [*first, *range(40 * len(first), 800, 40)]
    stamps, places, repairs = steadied(times)
    assert stamps == sorted(times)
    assert [times[place] for place in places] == stamps
    assert repairs == Repairs(reordered=repairs.reordered)
    assert repairs.reordered > 0


@pytest.mark.parametrize('first', [
    [500, 540, 580], [280, 320, 360], [*range(1000, 1320, 40)], [9000],
])  # fmt: skip
def test_a_clock_that_was_set_back_at_once_moves_no_picture(first):
    times = [*first, *range(0, 800, 40)]
    stamps, places, repairs = steadied(times)
    assert places == list(range(len(times)))
    assert stamps == [first[0] + 40 * place for place in places]
    assert repairs == Repairs(set_back=1)


@pytest.mark.parametrize('first', [[None], [None, None]])
def test_a_film_whose_first_pictures_have_no_time_begins_a_step_earlier(first):
    stamps, _, repairs = steadied([*first, 1000, 1080, 1040, *range(1120, 1800, 40)])
    assert stamps == [*range(1000 - 40 * len(first), 1800, 40)]
    assert repairs == Repairs(missing=len(first), reordered=1)
