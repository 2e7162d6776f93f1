"""The speed of the tray on its springs, from its velocities picture by picture."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nanorocks_ros.records import (
    Measured,
    SpeedEstimate,
    SpeedMethod,
    TrayImage,
)
from nanorocks_ros.stages.speed.tray_oscillation import TrayOscillation

NS = 1_000_000_000
GRAY = np.zeros((8, 8), dtype=np.uint8)


def image(time, velocity, error=1e-4):
    return TrayImage(
        stamp_ns=round(time * NS), tray=1, gray=GRAY, velocity=velocity, velocity_error=error
    )


def estimate(time):
    return SpeedEstimate(
        stamp_ns=round(time * NS),
        tray=1,
        cycle=1,
        cycle_start_ns=0,
        mean_projected_speed=Measured(1e-3, 1e-4),
        window=0.1,
        method=SpeedMethod.TRACKING,
    )


def test_the_root_mean_square_of_a_swing_is_found_whatever_its_phase():
    meter = TrayOscillation()
    for time in np.arange(0.0, 4.0, 1 / 30):
        meter.push(image(time, (3e-3 * math.cos(9.4 * time), 0.0), 1e-6))
    for time in (1.0, 1.2, 1.45, 2.0):
        assert meter.speed(estimate(time)) == pytest.approx(3e-3 / math.sqrt(2.0), rel=0.05)


def test_noise_is_no_swing():
    random = np.random.default_rng(1)
    meter = TrayOscillation()
    for time in np.arange(0.0, 6.0, 1 / 30):
        meter.push(image(time, tuple(1e-4 * random.standard_normal(2))))
    results = [meter.speed(estimate(time)) for time in np.arange(0.5, 5.5, 0.5)]
    assert np.mean(results) < 2e-5


def test_a_tray_that_was_not_followed_has_no_speed():
    meter = TrayOscillation()
    assert math.isnan(meter.speed(estimate(1.0)))
    meter.push(image(1.0, (math.nan, math.nan), math.nan))
    assert math.isnan(meter.speed(estimate(1.0)))
