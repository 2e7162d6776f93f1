"""Trends and quiet periods of many cycles."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.inference.trend_tests import quiet_periods, robust_trend

CYCLES = np.arange(60.0)


def noise(seed, trays=3, cycles=60):
    return np.random.default_rng(seed).normal(5.0, 1.0, (trays, cycles))


def test_a_line_is_found_whatever_a_quarter_of_the_values_does():
    values = 3.0 + 0.02 * CYCLES + 0.01 * np.random.default_rng(1).normal(size=60)
    values[::4] = 40.0
    trend = robust_trend(CYCLES, values)
    assert trend.slope == pytest.approx(0.02, abs=0.002)
    assert trend.samples == 60


def test_the_error_of_a_slope_is_what_slopes_scatter_by():
    trends = [robust_trend(CYCLES, row) for row in noise(2, trays=300)]
    slopes = np.array([trend.slope for trend in trends])
    errors = np.array([trend.slope_error for trend in trends])
    assert errors.mean() == pytest.approx(slopes.std(), rel=0.15)
    assert np.mean(np.abs(slopes) < errors) == pytest.approx(0.68, abs=0.09)


def test_unknown_values_are_left_out():
    values = 1.0 + 0.5 * CYCLES
    values[10:20] = math.nan
    trend = robust_trend(CYCLES, values)
    assert trend.slope == pytest.approx(0.5)
    assert trend.samples == 50
    assert trend.at(CYCLES)[:10] == pytest.approx(values[:10])


@pytest.mark.parametrize('count', [0, 1, 4])
def test_too_few_values_have_no_slope(count):
    trend = robust_trend(CYCLES[:count], np.ones(count))
    assert math.isnan(trend.slope)
    assert math.isnan(trend.slope_error)


def test_three_periods_are_found_where_they_are():
    sizes = noise(3, cycles=180)
    wanted = [(20, 29), (80, 95), (150, 156)]
    for first, last in wanted:
        sizes[:, first : last + 1] += 2.0
    periods = quiet_periods(sizes)
    assert len(periods) == 3
    for (first, last), period in zip(wanted, periods, strict=True):
        assert abs(period.first - first) <= 1
        assert abs(period.last - last) <= 1
        assert period.excess > 1.0
        assert period.chance <= 0.01


def test_periods_are_of_large_clusters_only():
    sizes = noise(4)
    sizes[:, 20:35] -= 4.0
    assert not quiet_periods(sizes)


def test_independent_cycles_have_periods_at_the_false_alarm_rate():
    alarms = [bool(quiet_periods(noise(k), 0.05, orders=99, seed=k)) for k in range(200)]
    # 10 are expected; 21 or more in one of a thousand such tests.
    assert 1 <= sum(alarms) <= 20


def test_a_slow_trend_is_no_period():
    sizes = noise(5) + 0.1 * CYCLES
    assert not quiet_periods(sizes)


def test_trays_of_any_size_count_alike_and_may_have_gaps():
    sizes = noise(6, cycles=100)
    sizes[:, 40:52] += 2.5
    sizes[0] *= 100.0
    sizes[1, ::3] = math.nan
    sizes[2, 45:47] = math.nan
    (period,) = quiet_periods(sizes)
    assert abs(period.first - 40) <= 1
    assert abs(period.last - 51) <= 1


@pytest.mark.parametrize('sizes', [np.empty((0, 0)), np.ones((2, 40)), np.full((2, 9), math.nan)])
def test_without_scatter_there_is_no_period(sizes):
    assert quiet_periods(sizes) == ()


@pytest.mark.parametrize(
    ('given', 'text'),
    [
        ({'false_alarms': 0.0}, 'false alarms'),
        ({'false_alarms': 0.001, 'orders': 99}, 'false alarms'),
        ({'shortest': 0}, 'shortest'),
    ],
)
def test_numbers_outside_their_ranges_are_refused(given, text):
    with pytest.raises(ConfigurationError, match=text):
        quiet_periods(noise(1), **given)
