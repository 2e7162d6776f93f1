"""Stamps rise whatever the times, and are left alone where they do."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from nanorocks_ros.recordings.steady import Repairs, Steady

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
