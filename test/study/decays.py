"""Tables of speeds as `nanorocks analyse` writes them, from simulated cycles."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.experiment.settings import SimulationSettings
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.recordings.results import write_csv
from nanorocks_ros.simulation.ensemble import cooling_runs

TIMES = 0.1 * np.arange(1, 221)
PERIOD = 60.0
FIELDS = {
    'time': 's',
    'cycle': '1',
    'cycle_start': 's',
    'mean_projected_speed': 'm/s',
    'mean_projected_speed_error': 'm/s',
    'window': 's',
}


def write_rows(path, rows):
    write_csv(path, list(FIELDS), list(FIELDS.values()), rows)
    return path


def simulated_table(path, cycles, error=1e-4, restitution=0.89, speed=0.007, seed=3):
    """Cycles of tray 1, walls 0.99."""
    settings = SimulationSettings(restitution=restitution, mean_speed=speed, seed=seed)
    speeds = cooling_runs(settings, load_trays()[1], TIMES, range(cycles)).mean_projected_speed
    noisy = speeds + error * np.random.default_rng(seed).normal(size=speeds.shape)
    rows = [
        (k * PERIOD + age, k + 1, k * PERIOD, one, error, 0.3)
        for k in range(cycles)
        for age, one in zip(TIMES.tolist(), noisy[k].tolist(), strict=True)
    ]
    return write_rows(path, rows)
