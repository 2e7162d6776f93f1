"""Pictures of docs/method/theory.md and restitution.md and of docs/use/sweeps.md, by commands.

``python -m benchmarks.closed_form_pictures FOLDER`` writes them, in some minutes of one core.
Cycles are simulated without rotation, and random errors are added to their mean speeds.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from nanorocks_ros.cli.main import main as nanorocks
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.tables.csv_tables import write_csv
from nanorocks_ros.outputs.tables.table_columns import float_columns
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs
from nanorocks_ros.simulation.shaken_tray import ShakenTray

TIMES = np.arange(0.1, 30.0, 0.1)
PERIOD = 60.0
FIELDS = {
    'time': 's',
    'cycle': '1',
    'cycle_start': 's',
    'mean_projected_speed': 'm/s',
    'mean_projected_speed_error': 'm/s',
}
# Runs at each point, as in the paper.
SWEEP = ('--runs', '178', '--times', '0:30:31', '--seed', '7')


def measured_cycles(path, cycles, error, *, tray=1, restitution=0.89, walls=0.99, seed=3):
    """A table of speeds as `nanorocks analyse` writes it, from simulated cycles.

    Errors are one number, [m/s], independent from one speed to the next.
    """
    settings = SimulationSettings(
        tray=tray, restitution=restitution, wall_restitution=walls, seed=seed
    )
    speeds = cooling_runs(settings, load_trays()[tray], TIMES, range(cycles)).mean_projected_speed
    noisy = speeds + error * np.random.default_rng(seed).normal(size=speeds.shape)
    rows = [
        (k * PERIOD + age, k + 1, k * PERIOD, speed, error)
        for k in range(cycles)
        for age, speed in zip(TIMES.tolist(), noisy[k].tolist(), strict=True)
    ]
    write_csv(path, float_columns(FIELDS, FIELDS.values()), rows)


def measured_mixture(path, cycles, error, *, tray=5, restitution=0.89, walls=0.97, seed=4):
    """A table with the speeds of both species of a mixture, at 5 Hz, started at 10 mm/s."""
    settings = SimulationSettings(
        tray=tray,
        restitution=restitution,
        wall_restitution=walls,
        mean_speed=0.010,
        first_shake=0.0,
        frame_rate=5.0,
        seed=seed,
    )
    counts = [bead_species.count for bead_species in load_trays()[tray].species]
    species = np.repeat(np.arange(2), counts)
    rng = np.random.default_rng(seed)
    rows = []
    for run in range(cycles):
        start = run * PERIOD
        for k, moment in enumerate(ShakenTray(settings, load_trays()[tray], run).moments(126)):
            bead_speeds = np.hypot(*moment.velocities[:, :2].T)
            species_speeds = [
                bead_speeds[species == index].mean() + error * rng.normal() for index in (0, 1)
            ]
            mean = np.average(species_speeds, weights=counts)
            if k:
                speeds = (mean, error, species_speeds[0], error, species_speeds[1], error)
                rows.append((start + 0.2 * k, run + 1, start, *speeds))
    names = [
        f'{name}_species_speed{suffix}'
        for name in ('first', 'second')
        for suffix in ('', '_error')
    ]
    write_csv(path, float_columns([*FIELDS, *names], [*FIELDS.values(), *['m/s'] * 4]), rows)


def _draw(folder, scratch):
    table = scratch / 'tray_1_speed.csv'
    measured_cycles(table, 18, 3e-4)
    for kind in ('decay', 'instantaneous'):
        yield ('figure', kind, str(table), '-o', str(folder / f'{kind}.png'), '--force')
    mixture = scratch / 'tray_5_speed.csv'
    measured_mixture(mixture, 18, 1e-4)
    yield ('figure', 'decay', str(mixture), '-o', str(folder / 'species.png'), '--force')
    grid = {
        'walls': ('--restitution', '0.7:1:31', '--wall-restitution', '0.95:1:11'),
        'width': ('--restitution', '0.7:0.9:21', '--restitution-width', '0:0.2:6'),
    }
    for name, axes in grid.items():
        output = str(scratch / f'{name}.npz')
        picture = str(folder / f'sweep_{name}.png')
        yield (
            'sweep', *axes, *SWEEP, '-o', output, '--keep-runs', '--workers', '1',
            '--figure', picture, '--reference', str(table), '--free-speed',
        )  # fmt: skip


def main(folder):
    """Write the pictures, and return the first exit code that is not 0, or 0."""
    with TemporaryDirectory() as scratch:
        for arguments in _draw(Path(folder), Path(scratch)):
            code = nanorocks(arguments)
            if code:
                return code
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1] if len(sys.argv) > 1 else 'docs/pictures'))
