"""Repair of time stamps: they rise strictly, and rising ones are not changed."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nanorocks_ros.recordings.film.timestamp_repair import RepairCounts, TimestampRepair

STEP = 40
TIMES = st.lists(st.none() | st.integers(-(10**4), 10**4), max_size=40)


def repaired(times):
    repair = TimestampRepair(STEP)
    stamped = list(repair.repaired((time, index) for index, time in enumerate(times)))
    return [pair.stamp_ns for pair in stamped], [pair.item for pair in stamped], repair.repairs


@given(TIMES)
def test_stamps_rise_and_no_picture_is_lost(times):
    stamps, indices, _ = repaired(times)
    assert all(before < after for before, after in pairwise(stamps))
    assert sorted(indices) == list(range(len(times)))


@given(st.lists(st.integers(0, 10**6), unique=True, max_size=40).map(sorted))
def test_rising_times_are_not_changed(times):
    assert repaired(times) == (times, list(range(len(times))), RepairCounts())


def test_frames_without_a_time_are_interpolated():
    stamps, _, repairs = repaired([0, 40, None, 120, None, 160, None, None])
    assert stamps == [0, 40, 80, 120, 140, 160, 200, 240]
    assert repairs.missing == 4


def test_a_film_without_times_has_the_usual_step():
    assert repaired([None] * 4)[0] == [0, 40, 80, 120]


def test_one_time_far_ahead_is_replaced():
    stamps, indices, repairs = repaired([0, 40, 80, 9000, *range(160, 600, 40)])
    assert stamps == list(range(0, 600, 40))
    assert indices == list(range(15))
    assert repairs == RepairCounts(replaced=1)


def test_a_duplicate_time_is_replaced():
    stamps, _, repairs = repaired([0, 40, 40, 80, 120])
    assert stamps == [0, 40, 60, 80, 120]
    assert repairs == RepairCounts(replaced=1)


@pytest.mark.parametrize('first', [[80, 0, 40], [40, 0, 80], [120, 0, 80, 40]])
def test_the_first_frames_are_sorted_by_time(first):
    times = [*first, *range(40 * len(first), 800, 40)]
    stamps, indices, repairs = repaired(times)
    assert stamps == sorted(times)
    assert [times[index] for index in indices] == stamps
    assert repairs == RepairCounts(reordered=repairs.reordered)
    assert repairs.reordered > 0


@pytest.mark.parametrize('first', [
    [500, 540, 580], [280, 320, 360], [*range(1000, 1320, 40)], [9000],
])  # fmt: skip
def test_a_clock_set_back_after_the_first_frames_moves_no_frame(first):
    times = [*first, *range(0, 800, 40)]
    stamps, indices, repairs = repaired(times)
    assert indices == list(range(len(times)))
    assert stamps == [first[0] + 40 * index for index in indices]
    assert repairs == RepairCounts(set_back=1)


@pytest.mark.parametrize('first', [[None], [None, None]])
def test_first_frames_without_a_time_are_extrapolated(first):
    stamps, _, repairs = repaired([*first, 1000, 1080, 1040, *range(1120, 1800, 40)])
    assert stamps == [*range(1000 - 40 * len(first), 1800, 40)]
    assert repairs == RepairCounts(missing=len(first), reordered=1)
