"""Pictures that are late, against the straight flights of the beads in them."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.late_stamps import LateTray
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import SimulationSettings, with_values
from nanorocks_ros.simulation.shaken_tray import ShakenTray

TRAY = load_trays()[1]
VALUES = {'tray': 1, 'first_shake': 0.0, 'frame_rate': 30.0, 'mean_speed': 0.01, 'seed': 3}
SETTINGS = with_values(SimulationSettings(), VALUES, 'test')
LATE = 3e-3


def late_moments(late, frames=200):
    gas = LateTray(ShakenTray(SETTINGS, TRAY, 0), late, 30.0, np.random.default_rng(1))
    return list(gas.moments(frames))


def test_all_beads_of_a_picture_have_flown_on_for_the_same_time():
    exact = list(ShakenTray(SETTINGS, TRAY, 0).moments(200))
    times = []
    for true, seen in zip(exact, late_moments(LATE), strict=True):
        assert seen.truth.stamp_ns == true.truth.stamp_ns
        free = np.abs(seen.velocities - true.velocities).max(axis=1) < 1e-12
        flown, speeds = (seen.positions - true.positions)[free], true.velocities[free]
        late = np.vdot(flown, speeds) / np.vdot(speeds, speeds)
        assert np.abs(flown - late * speeds).max() < 1e-9
        times.append(late)
    assert np.std(times) == pytest.approx(LATE, rel=0.2)
    assert abs(np.mean(times)) < LATE / 4


def test_pictures_come_one_after_the_other_however_late():
    positions = np.array([moment.positions for moment in late_moments(1.0, 50)])
    assert (np.abs(np.diff(positions, axis=0)).max(axis=(1, 2)) > 0.0).all()


def test_pictures_in_time_show_the_frames():
    for true, seen in zip(
        ShakenTray(SETTINGS, TRAY, 0).moments(5), late_moments(0.0, 5), strict=True
    ):
        np.testing.assert_allclose(seen.positions, true.positions, atol=1e-12)
