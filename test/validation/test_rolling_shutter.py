"""Beads that a rolling shutter sees, against their straight flights."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.rolling_shutter import RolledTray, rolled_run
from benchmarks.soft_spheres import SoftRun
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import SimulationSettings, with_values
from nanorocks_ros.simulation.shaken_tray import ShakenTray

TRAY = load_trays()[1]
VALUES = {'tray': 1, 'first_shake': 0.0, 'frame_rate': 30.0, 'mean_speed': 0.01, 'seed': 3}
SETTINGS = with_values(SimulationSettings(), VALUES, 'test')
READOUT = 0.03


@pytest.fixture(scope='module')
def moments():
    exact = list(ShakenTray(SETTINGS, TRAY, 0).moments(60))
    rolled = list(RolledTray(ShakenTray(SETTINGS, TRAY, 0), TRAY, READOUT, 30.0).moments(60))
    return exact, rolled


def test_free_beads_are_seen_where_they_are_when_their_row_is_read(moments):
    free, off = 0, []
    for exact, rolled, after in zip(moments[0], moments[1], moments[0][1:], strict=False):
        straight = np.abs(after.velocities - exact.velocities).max(axis=1) < 1e-12
        # Read at a time at which the bead has come to the row: it moves while others are read.
        delay = rolled.positions[:, 1] / TRAY.dimensions[1] * READOUT
        expected = exact.positions + exact.velocities * delay[:, np.newaxis]
        off.append(np.abs(rolled.positions - expected)[straight].max())
        free += straight.sum()
    assert free > 500
    assert max(off) < 1e-9


def test_beads_stay_within_the_tray_and_frames_have_their_stamps(moments):
    for exact, rolled in zip(*moments, strict=True):
        assert rolled.truth.stamp_ns == exact.truth.stamp_ns
        low, high = rolled.positions.min(axis=0), rolled.positions.max(axis=0)
        assert (low > 0.9e-3).all()
        assert (high < np.array(TRAY.dimensions) - 0.9e-3).all()


def test_rows_that_are_read_at_once_show_the_frame():
    gas = RolledTray(ShakenTray(SETTINGS, TRAY, 0), TRAY, 0.0, 30.0)
    for exact, rolled in zip(
        ShakenTray(SETTINGS, TRAY, 0).moments(5), gas.moments(5), strict=True
    ):
        np.testing.assert_allclose(rolled.positions, exact.positions, atol=1e-12)


def test_states_of_a_run_are_seen_row_by_row():
    # Two spheres in even motion, 100 states a second, and a picture every tenth.
    times = np.arange(100) / 100.0
    speeds = np.array([[1e-3, 8e-3, 0.0], [0.0, -5e-3, 0.0]])
    starts = np.array([[0.01, 0.004, 0.001], [0.01, 0.016, 0.001]])
    positions = starts + times[:, np.newaxis, np.newaxis] * speeds
    run = SoftRun(
        positions=positions,
        velocities=np.broadcast_to(speeds, positions.shape),
        displacement=np.zeros((100, 2)),
        collisions=0,
    )
    rolled = rolled_run(run, 10, np.linspace(0.0, 1.0, 10), 0.03)
    assert len(rolled.positions) == 9
    # The middle of both first places is that of the picture.
    row = (rolled.positions[:, :, 1] - 0.01) / 0.03 + 0.5
    when = 0.1 * np.arange(9)[:, np.newaxis] + 0.09 * row
    np.testing.assert_allclose(rolled.positions, starts + when[:, :, np.newaxis] * speeds)
