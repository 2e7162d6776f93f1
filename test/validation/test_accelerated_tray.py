"""A gas in an accelerated tray: energy with its potential, and no acceleration as without."""

import numpy as np
import pytest

from benchmarks import rough_gas as gas
from benchmarks.accelerated_tray import AcceleratedTray
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.simulation.shaken_tray import ShakenTray

TRAY = load_trays()[1]
ELASTIC = gas.settings_of(
    TRAY, gas.SMOOTH, restitution=1.0, wall_restitution=1.0, seed=3, mean_speed=0.002
)


@pytest.mark.parametrize('acceleration', [(1e-3, 0.0, 0.0), (-3e-4, 2e-4, 1e-4)])
def test_elastic_beads_that_fall_keep_their_kinetic_and_potential_energy(acceleration):
    tray = AcceleratedTray(ELASTIC, TRAY, 0, acceleration)
    kinetic, potential = np.array(
        [
            (
                0.5 * np.sum(moment.velocities**2),
                -np.sum(moment.positions @ np.array(acceleration)),
            )
            for moment in tray.moments(150)
        ]
    ).T
    assert np.ptp(kinetic) > 0.1 * kinetic[0]
    assert np.ptp(kinetic + potential) < 1e-4 * np.ptp(kinetic)


def test_beads_without_contacts_fall_freely():
    acceleration = np.array([2e-4, 0.0, -1e-4])
    tray = AcceleratedTray(ELASTIC, TRAY, 0, tuple(acceleration))
    first, second = tray.moments(2)
    interval = 1.0 / ELASTIC.frame_rate
    fallen = second.velocities - first.velocities
    free = np.abs(fallen - acceleration * interval).max(axis=1) < 1e-9
    assert free.mean() > 0.8
    flown = (0.5 * (first.velocities + second.velocities) * interval)[free]
    assert np.allclose((second.positions - first.positions)[free], flown, rtol=0.0, atol=1e-12)


def test_hardly_any_acceleration_changes_hardly_anything():
    *_, moved = AcceleratedTray(ELASTIC, TRAY, 0, (1e-12, 0.0, 0.0)).moments(30)
    *_, resting = ShakenTray(ELASTIC, TRAY, 0).moments(30)
    assert np.allclose(moved.positions, resting.positions, rtol=0.0, atol=1e-9)
