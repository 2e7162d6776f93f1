"""Speeds from tracks are flagged where much of a species lies under other beads."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Quality, Tracks, TrayImage
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.speed.track_speed import TrackSpeed

INTERVAL_NS = 40_000_000
VELOCITY = np.array([1.5e-3, 1e-3])
SEEN_GLASS = 26


def places(spacing):
    """Large beads in a square lattice, small ones in its gaps and on its lines, [m]."""
    large = [(2e-3 + spacing * (k % 5), 2e-3 + 2e-3 * (k // 5)) for k in range(15)]
    small = [(2.5e-3 + spacing * (k % 7), 2.5e-3 + 1e-3 * (k // 7)) for k in range(SEEN_GLASS)]
    return np.array(large + small)


def speeds(tray, positions):
    """Speed estimates from the tracks of beads that move together past a camera at rest."""
    stage = TrackSpeed(PipelineSettings(), tray, crowded=False)
    species = np.repeat([0, 1], [15, SEEN_GLASS]).astype(np.int32)
    sizes = np.array([0.5 * kind.diameter for kind in tray.species])
    n = len(positions)
    estimates = []
    for number in range(40):
        stamp_ns = number * INTERVAL_NS
        gray = np.zeros((4, 4), dtype=np.uint8)
        stage.push(
            TrayImage(
                stamp_ns=stamp_ns,
                tray=tray.number,
                gray=gray,
                color=np.zeros((4, 4, 3), dtype=np.uint8),
                cycle=1,
                cycle_start_ns=0,
            )
        )
        estimates += stage.push(
            Tracks(
                stamp_ns=stamp_ns,
                tray=tray.number,
                ids=np.arange(n, dtype=np.int32),
                species=species,
                displacement=np.zeros(2),
                positions=positions + VELOCITY * number * INTERVAL_NS / 1e9,
                position_errors=np.full(n, 2e-6),
                velocities=np.tile(VELOCITY, (n, 1)),
                velocity_errors=np.full(n, 1e-5),
                radii=sizes[species],
                radius_errors=np.full(n, 1e-6),
                seen=np.ones(n, dtype=bool),
                expected=np.array([kind.count for kind in tray.species], dtype=np.int32),
            )
        )
    return estimates


@pytest.mark.parametrize(('spacing', 'flagged'), [(2e-3, True), (4.5e-3, False)])
def test_speeds_are_flagged_where_many_beads_lie_under_others(spacing, flagged):
    tray = load_trays()[3]
    estimates = speeds(tray, places(spacing))
    assert estimates
    for estimate in estimates:
        assert bool(estimate.quality & Quality.FEW_BEADS) is flagged
        # All beads move alike, whoever counts for how many.
        assert estimate.mean_projected_speed.value == pytest.approx(np.hypot(*VELOCITY), rel=0.01)
