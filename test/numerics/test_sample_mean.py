"""The mean of a sample leaves out unknown values."""

from __future__ import annotations

import math

import pytest

from nanorocks_ros.numerics.sample_mean import mean_of


def test_unknown_values_do_not_count():
    mean, deviation, number = mean_of([1.0, None, 3.0, math.nan, 5.0])
    assert (mean, number) == (3.0, 3)
    assert deviation == pytest.approx(2.0)


def test_a_single_value_has_no_deviation():
    mean, deviation, number = mean_of([2.0])
    assert (mean, number) == (2.0, 1)
    assert math.isnan(deviation)


def test_no_known_value_has_no_mean():
    mean, deviation, number = mean_of([None, math.inf])
    assert number == 0
    assert math.isnan(mean)
    assert math.isnan(deviation)
