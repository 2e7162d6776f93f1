"""Synthetic tables of clusters and speeds, as `nanorocks analyse` writes them."""

from __future__ import annotations

import math

from nanorocks_ros.outputs.tables.csv_tables import write_csv
from nanorocks_ros.outputs.tables.table_columns import float_columns


def write_results(folder, areas, starts=(2.0, 62.0), period=60.0):
    folder.mkdir(exist_ok=True)
    count = len(areas)
    rows = [(t, 0.0, 1e-6, 1e-3) for t in (0.0, 1.0)]
    rows += [
        (start + period * k / count, n + 1, area, math.sqrt(area / math.pi))
        for n, start in enumerate(starts)
        for k, area in enumerate(areas)
    ]
    write_csv(
        folder / 'tray_1_cluster.csv',
        float_columns(
            ['time', 'cycle', 'level_area', 'correlation_length'], ['s', '1', 'm^2', 'm']
        ),
        rows,
    )
    write_csv(
        folder / 'tray_1_speed.csv',
        float_columns(['time', 'cycle', 'cycle_start'], ['s', '1', 's']),
        [(0.0, 0.0, math.nan), *((start, n + 1, start) for n, start in enumerate(starts))],
    )
    return folder
