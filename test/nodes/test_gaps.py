"""Missing frames are counted by their stamps, where those are steady."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.nodes._gaps import Gaps

NS = 10**9


def counted(stamps):
    gaps = Gaps()
    found = [gaps.push(round(stamp * NS)) for stamp in stamps]
    assert gaps.missing == sum(found)
    return found


@pytest.mark.parametrize('rate', [7.5, 30.0, 100.0])
def test_each_missing_frame_is_counted_where_it_is_missing(rate):
    rng = np.random.default_rng(1)
    numbers = [one for one in range(200) if one not in {50, 51, 52, 90, 150}]
    stamps = np.array(numbers) / rate + rng.normal(0.0, 0.03 / rate, len(numbers))
    found = counted(stamps)
    assert {numbers[k]: one for k, one in enumerate(found) if one} == {53: 3, 91: 1, 151: 1}


def test_every_second_frame_is_missed_when_the_first_ones_came():
    numbers = [*range(40), *range(41, 80, 2)]
    assert sum(counted(np.array(numbers) / 30.0)) == 20


def test_a_camera_that_goes_on_at_half_the_rate_is_not_lossy_for_ever():
    found = counted([*(np.arange(60) / 30.0), *(2.0 + np.arange(200) / 15.0)])
    assert 0 < sum(found) < 70
    assert not any(found[-100:])


def test_a_camera_without_a_rate_misses_nothing():
    rng = np.random.default_rng(2)
    assert sum(counted(np.cumsum(rng.exponential(0.03, 300)))) == 0


def test_time_that_goes_back_is_no_gap():
    once = np.arange(40) / 30.0
    assert sum(counted([*(100.0 + once), *once])) == 0


def test_a_pause_is_no_gap():
    once = np.arange(40) / 30.0
    assert sum(counted([*once, *(60.0 + once)])) == 0
