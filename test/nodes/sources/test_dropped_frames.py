"""Dropped frames are counted by their stamps, where the frame rate is steady."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.nodes.sources.dropped_frames import DroppedFrames

NS = 10**9


def counted(stamps):
    """How many frames are missing before each frame; stamps in seconds."""
    dropped = DroppedFrames()
    missing = [dropped.push(round(stamp * NS)) for stamp in stamps]
    assert dropped.count == sum(missing)
    return missing


@pytest.mark.parametrize('rate', [7.5, 30.0, 100.0])
def test_each_missing_frame_is_counted_where_it_is_missing(rate):
    rng = np.random.default_rng(1)
    numbers = [number for number in range(200) if number not in {50, 51, 52, 90, 150}]
    stamps = np.array(numbers) / rate + rng.normal(0.0, 0.03 / rate, len(numbers))
    missing = zip(numbers, counted(stamps), strict=True)
    assert {number: count for number, count in missing if count} == {53: 3, 91: 1, 151: 1}


def test_every_second_frame_is_missed_when_the_first_ones_came():
    numbers = [*range(40), *range(41, 80, 2)]
    assert sum(counted(np.array(numbers) / 30.0)) == 20


def test_half_the_frame_rate_is_accepted_after_a_while():
    missing = counted([*(np.arange(60) / 30.0), *(2.0 + np.arange(200) / 15.0)])
    assert 0 < sum(missing) < 70
    assert not any(missing[-100:])


def test_no_frame_is_missing_of_a_camera_without_a_steady_rate():
    rng = np.random.default_rng(2)
    assert sum(counted(np.cumsum(rng.exponential(0.03, 300)))) == 0


def test_time_that_goes_back_is_no_gap():
    once = np.arange(40) / 30.0
    assert sum(counted([*(100.0 + once), *once])) == 0


def test_a_pause_is_no_gap():
    once = np.arange(40) / 30.0
    assert sum(counted([*once, *(60.0 + once)])) == 0
