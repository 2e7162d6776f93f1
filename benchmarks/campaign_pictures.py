"""``python -m benchmarks.campaign_pictures FOLDER``: pictures of packing, dust and a campaign.

The campaign is simulated: 60 cycles of trays 1, 3 and 5 in recordings of 10, shaken to 10 mm/s.
Beads stick below 0.2 mm/s, and below 3 mm/s in cycles 18 to 25, which is a quiet period. Speeds
have an error of 0.1 mm/s; restitutions are those of the confined theory.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from nanorocks_ros.cli.main import main as nanorocks
from nanorocks_ros.errors import FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.confined_decay import confined_restitution
from nanorocks_ros.inference.decay.haff_fit import fit_haff
from nanorocks_ros.outputs.tables.csv_tables import write_csv
from nanorocks_ros.outputs.tables.table_columns import float_columns
from nanorocks_ros.physics.error_propagation import Estimate
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs
from nanorocks_ros.studies.analysis.simulated_packing import simulated_packing

_TRAYS, _CYCLES, _EACH, _QUIET = (1, 3, 5), 60, 10, range(17, 25)
_ERROR, _WALLS = 1e-4, 0.97
_TIMES = 0.2 * np.arange(1, 101)


def _write_recording(folder, number, cycles, seed):
    tray, rng = load_trays()[number], np.random.default_rng([seed, number])
    settings = SimulationSettings(
        tray=number, wall_restitution=_WALLS, mean_speed=0.010, seed=seed
    )
    decays = cooling_runs(settings, tray, _TIMES, range(len(cycles))).mean_projected_speed
    speeds, sizes, cors = [], [], []
    for k, cycle in enumerate(cycles):
        sticking = 0.003 if cycle in _QUIET else 0.0002
        measured = decays[k] + rng.normal(0.0, _ERROR, _TIMES.size)
        speeds += [
            (60.0 * k + t, k + 1, 60.0 * k, v, _ERROR)
            for t, v in zip(_TIMES.tolist(), measured.tolist(), strict=True)
        ]
        # One more speed marks the end of the cycle.
        speeds.append((60.0 * k + 59.0, k + 1, 60.0 * k, _ERROR, _ERROR))
        (curve,) = simulated_packing(
            tray, replace(settings, sticking_speed=sticking, seed=seed + cycle), 1
        )
        sizes += [
            (60.0 * k + t, k + 1, area, math.sqrt(area / math.pi))
            for t, area in zip(curve.times.tolist(), curve.level_area.tolist(), strict=True)
        ]
        late = _TIMES > 2.0
        fit = fit_haff(_TIMES[late], measured[late], np.full(late.sum(), _ERROR), tray.count)
        rate = Estimate(value=fit.decay_rate, error=fit.decay_rate * fit.log_decay_rate_error)
        try:
            cor = confined_restitution(tray, rate, _WALLS)
        except FitError:
            continue
        ends = cor.value - cor.error, cor.value + cor.error
        cors.append((60.0 * k + 59.0, k + 1, 2.0, cor.value, *ends))
    for name, fields, units, rows in (
        (
            'speed',
            ('time', 'cycle', 'cycle_start', 'mean_projected_speed', 'mean_projected_speed_error'),
            ('s', '1', 's', 'm/s', 'm/s'),
            speeds,
        ),
        (
            'cluster',
            ('time', 'cycle', 'level_area', 'correlation_length'),
            ('s', '1', 'm^2', 'm'),
            sizes,
        ),
        (
            'cor',
            ('time', 'cycle', 'status', 'restitution', 'restitution_lower', 'restitution_upper'),
            ('s', '1', '1', '1', '1', '1'),
            cors,
        ),
    ):
        write_csv(folder / f'tray_{number}_{name}.csv', float_columns(fields, units), rows)


def main() -> None:
    folder = Path(sys.argv[1])
    with TemporaryDirectory() as scratch:
        names = []
        for first in range(0, _CYCLES, _EACH):
            recording = Path(scratch) / f'recording_{first // _EACH + 1:02d}'
            recording.mkdir()
            for number in _TRAYS:
                _write_recording(recording, number, range(first, first + _EACH), 100 + first)
            names.append(str(recording))
        nanorocks(['figure', 'long-term', *names, '-o', str(folder / 'long_term.png'), '--force'])
    packing = ['figure', 'packing', '--simulate', '--cycles', '18', '--force']
    nanorocks([*packing, '-o', str(folder / 'packing.png')])
    nanorocks(['figure', 'dust', '--force', '-o', str(folder / 'dust.png')])


if __name__ == '__main__':
    main()
