"""Synthetic results of many recordings, in the tables of `nanorocks analyse`."""

from __future__ import annotations

import math

import numpy as np

from nanorocks_ros.outputs.tables.csv_tables import write_csv
from nanorocks_ros.outputs.tables.table_columns import float_columns

PERIOD, SIZE, PEAK = 60.0, 6e-4, 0.008
TIMES = np.concatenate((np.linspace(0.1, 3.0, 10), np.linspace(5.0, 59.0, 20)))


def write_recording(folder, trays, cycles, sizes, *, peaks=None, bodies=False, seed=1):
    """Write the tables of cycles 1 to `cycles`; sizes and peaks by cycle, restitution 0.89."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    for number in trays:
        speeds, clusters, cors, counts = [(0.0, 0, math.nan, 1e-5, 1e-5)], [], [], []
        for k in range(cycles):
            start, peak = 1.0 + PERIOD * k, PEAK if peaks is None else peaks[k]
            fall = peak / (1.0 + TIMES)
            fall[1] = peak
            speeds += [
                (start + t, k + 1, start, v, 1e-4)
                for t, v in zip(TIMES.tolist(), fall.tolist(), strict=True)
            ]
            for t in TIMES.tolist():
                value = (sizes[k] if t > 49.0 else 0.1) * (1.0 + 1e-4 * rng.normal())
                clusters.append((start + t, k + 1, math.pi * value**2, value))
                counts.append((start + t, k + 1, 1e4 * value, 0.5))
            # A provisional estimate, which is ignored, and the final one.
            cors += [(k + 1, 1, 0.5, 0.1, 0.9), (k + 1, 2, 0.89, 0.87, 0.91)]
        for name, fields, rows in (
            (
                'speed',
                'time cycle cycle_start mean_projected_speed mean_projected_speed_error',
                speeds,
            ),
            ('cluster', 'time cycle level_area correlation_length', clusters),
            ('cor', 'cycle status restitution restitution_lower restitution_upper', cors),
            ('bodies', 'time cycle weighted_size weighted_size_error', counts if bodies else []),
        ):
            if rows:
                names = fields.split()
                write_csv(
                    folder / f'tray_{number}_{name}.csv',
                    float_columns(names, ['1'] * len(names)),
                    rows,
                )
    return folder
