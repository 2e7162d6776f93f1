"""Tables of speeds as `nanorocks analyse` writes them, from simulated cycles."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.tables.csv_tables import write_csv
from nanorocks_ros.outputs.tables.table_columns import float_columns
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs
from nanorocks_ros.simulation.shaken_tray import ShakenTray

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
    write_csv(path, float_columns(FIELDS, FIELDS.values()), rows)
    return path


def simulated_table(path, cycles, error=1e-4, restitution=0.89, speed=0.007, seed=3):
    """Cycles of tray 1, walls 0.99."""
    settings = SimulationSettings(restitution=restitution, mean_speed=speed, seed=seed)
    speeds = cooling_runs(settings, load_trays()[1], TIMES, range(cycles)).mean_projected_speed
    noisy = speeds + error * np.random.default_rng(seed).normal(size=speeds.shape)
    rows = [
        (k * PERIOD + age, k + 1, k * PERIOD, speed_now, error, 0.3)
        for k in range(cycles)
        for age, speed_now in zip(TIMES.tolist(), noisy[k].tolist(), strict=True)
    ]
    return write_rows(path, rows)


def simulated_mixture(path, number, cycles, error=1e-4, restitution=0.89, speed=0.01, seed=4):
    """Cycles of a tray of two species, walls 0.97, with the speeds of each species."""
    tray = load_trays()[number]
    settings = SimulationSettings(
        tray=number,
        restitution=restitution,
        wall_restitution=0.97,
        mean_speed=speed,
        first_shake=0.0,
        frame_rate=5.0,
        seed=seed,
    )
    species = np.repeat(np.arange(2), [beads.count for beads in tray.species])
    rng = np.random.default_rng(seed)
    rows = []
    for run in range(cycles):
        for k, moment in enumerate(ShakenTray(settings, tray, run).moments(111)):
            bead_speeds = np.hypot(*moment.velocities[:, :2].T)
            species_speeds = [
                bead_speeds[species == index].mean() + error * rng.normal() for index in (0, 1)
            ]
            start = run * PERIOD
            mean = np.average(species_speeds, weights=[beads.count for beads in tray.species])
            values = (mean, error, species_speeds[0], error, species_speeds[1], error)
            if k:
                rows.append((start + 0.2 * k, run + 1, start, *values, 0.3))
    names = ['mean_projected_speed', 'first_species_speed', 'second_species_speed']
    fields = ['time', 'cycle', 'cycle_start', *(f'{a}{b}' for a in names for b in ('', '_error'))]
    units = ['s', '1', 's', *['m/s'] * 6, 's']
    write_csv(path, float_columns([*fields, 'window'], units), rows)
    return path
