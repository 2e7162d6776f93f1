"""Parabolas through flights, and the clock of the gas without drag."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.flights.bend_fits import (
    BEND_SIZE,
    MIN_BEND_POINTS,
    undragged_times,
    write_bend,
)

TIMES = 5.0 + np.arange(40) / 30.0
ERROR = 8e-6


def _fit(positions, times=TIMES, errors=None):
    row = np.full(BEND_SIZE, np.nan)
    errors = np.full(times.size, ERROR) if errors is None else errors
    assert write_bend(times, positions, errors, row)
    return row


def test_a_parabola_gives_its_velocity_in_the_middle_and_its_acceleration():
    since = TIMES - TIMES.mean()
    velocity, acceleration = np.array([4e-3, -1e-3]), np.array([-8e-5, 3e-5])
    positions = 0.01 + np.outer(since, velocity) + 0.5 * np.outer(since**2, acceleration)
    row = _fit(positions)
    assert row[0] == pytest.approx(TIMES.mean())
    assert row[1] == pytest.approx(TIMES[-1] - TIMES[0])
    assert row[2] == TIMES.size
    np.testing.assert_allclose(row[3:5], velocity, rtol=1e-9)
    np.testing.assert_allclose(row[5:7], acceleration, rtol=1e-7)
    assert row[8] < 1e-9


def test_the_fit_is_that_of_weighted_least_squares():
    rng = np.random.default_rng(1)
    errors = rng.uniform(0.5, 3.0, TIMES.size) * ERROR
    positions = 0.01 + rng.normal(0.0, 1.0, (TIMES.size, 2)) * errors[:, np.newaxis]
    row = _fit(positions, errors=errors)
    for axis in range(2):
        (square, linear, _), covariance = np.polyfit(
            TIMES - row[0], positions[:, axis], 2, w=1.0 / errors, cov='unscaled'
        )
        assert row[3 + axis] == pytest.approx(linear, rel=1e-8)
        assert row[5 + axis] == pytest.approx(2.0 * square, rel=1e-8)
        assert row[7] == pytest.approx(2.0 * np.sqrt(covariance[0, 0]), rel=1e-8)


def test_a_short_flight_has_no_bend():
    row = np.full(BEND_SIZE, np.nan)
    few = MIN_BEND_POINTS - 1
    assert not write_bend(TIMES[:few], np.zeros((few, 2)), np.full(few, ERROR), row)
    assert row[2] == 0.0


@pytest.mark.parametrize('drag', [1e-6, 0.02, 0.5])
def test_a_dragged_flight_is_straight_in_the_undragged_clock(drag):
    origin = TIMES[25]
    positions = 4e-3 * -np.expm1(-drag * (TIMES - TIMES[0])) / drag
    clock = undragged_times(TIMES, origin, drag)
    slopes = np.diff(positions) / np.diff(clock)
    # The slope is the velocity at the origin.
    np.testing.assert_allclose(slopes, 4e-3 * np.exp(-drag * (origin - TIMES[0])), rtol=1e-9)
    assert clock[25] == origin


def test_without_drag_both_clocks_are_the_same():
    assert undragged_times(TIMES, 0.0, 0.0) is TIMES or np.array_equal(
        undragged_times(TIMES, 0.0, 0.0), TIMES
    )
