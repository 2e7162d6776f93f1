"""The age of a gas whose tray has come to rest."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.cooling_age import cooling_age
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion
from nanorocks_ros.simulation.shaken_tray import ShakenTray


def test_a_gas_on_a_tray_that_did_not_swing_is_shaken_at_time_0():
    assert cooling_age(0.0).value == 0.0
    assert cooling_age(0.0).error == 0.0


@pytest.mark.parametrize('rest', [5.0, 20.0])
def test_the_share_is_the_same_at_any_time(rest):
    age, half = cooling_age(rest), cooling_age(0.5 * rest)
    assert age.value == pytest.approx(2.0 * half.value)
    assert age.error == pytest.approx(2.0 * half.error)


def test_knocks_of_a_tray_keep_a_gas_younger_by_the_share():
    # 0.2 mm at 1.5 Hz, damped by 0.16 /s: after 18 s the tray has 0.07 mm/s.
    swing = WallMotion(
        amplitude=(1.4e-4, 1.4e-4, 0.0), angular_frequency=3.0 * math.pi, damping=0.16, end=60.0
    )
    settings = SimulationSettings(
        restitution=0.75, wall_restitution=0.8, first_shake=0.0, shake_period=100.0, seed=3
    )
    rest = 18.0

    def mean_speed(motion):
        speeds = []
        for run in range(12):
            _, velocities = ShakenTray(settings, load_trays()[7], run, motion).at(rest)
            speeds.append(np.hypot(*velocities[:, :2].T).mean())
        return np.mean(speeds)

    younger = 1.0 - mean_speed(None) / mean_speed(swing)
    age = cooling_age(rest)
    assert younger > 0.0
    assert younger * rest == pytest.approx(rest - age.value, abs=2.0 * age.error)
