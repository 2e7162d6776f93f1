"""A batch as tables: a row for every cycle, and one for every tray.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.outputs.csv_tables import write_csv
from nanorocks_ros.outputs.parquet import Column, write_parquet
from nanorocks_ros.records import CorEstimate
from nanorocks_ros.studies.analysis.results_json import BY_SOURCE
from nanorocks_ros.studies.batch.campaign_means import Combined, means_as_json
from nanorocks_ros.wire.array_layouts import layout

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

CYCLES, TRAYS = 'cycles', 'trays'
# Besides those of a CorEstimate.
_UNITS = {
    'start': 's',
    'peak_speed': 'm/s',
    'peak_speed_error': 'm/s',
    'onset': 's',
    'sticking_speed': 'm/s',
    'sticking_speed_lower': 'm/s',
    'sticking_speed_upper': 'm/s',
}
_TEXTS = 'recording', 'status', 'relation', 'headline', 'sticking_status'
_WHOLE = 'tray', 'cycle', 'quality', 'samples', 'rebounds', 'collisions'
_CYCLE = (
    *('recording', 'tray', 'cycle', 'start', 'status', 'relation', 'samples', 'quality'),
    *('restitution', 'restitution_lower', 'restitution_upper'),
    *('wall_restitution', 'wall_restitution_lower', 'wall_restitution_upper', 'correlation'),
    *('headline', *BY_SOURCE),
    *('paper_restitution', 'initial_speed', 'initial_speed_error'),
    *('haff_time', 'haff_time_error', 'reduced_chi_square'),
    *('window_start', 'window_end', 'cooling_start', 'rebounds', 'collisions', 'tension'),
    *('peak_speed', 'peak_speed_error', 'cluster_size', 'cluster_size_error'),
    *('bodies', 'bodies_error', 'onset', 'sticking_status'),
    *('sticking_speed', 'sticking_speed_lower', 'sticking_speed_upper'),
)


def write_tables(combined: Combined, folder: Path, kind: str, provenance: str) -> list[Path]:
    """Write both.

    Parameters
    ----------
    combined : Combined
    folder : Path
    kind : 'csv' or 'parquet'
    provenance : str
        Kept in Parquet files.

    Returns
    -------
    list of Path

    Raises
    ------
    ConfigurationError
        When nothing can write Parquet here.
    RecordingError
        When they cannot be written.
    """
    cycles = [
        {'recording': cycle.recording, 'tray': cycle.tray, **cycle.values}
        for cycle in combined.cycles
    ]
    trays = [
        {'tray': number, **means_as_json(tray)} for number, tray in sorted(combined.trays.items())
    ]
    paths = []
    for name, rows, columns in (
        (CYCLES, cycles, _CYCLE),
        (TRAYS, trays, tuple(dict.fromkeys(key for row in trays for key in row))),
    ):
        path = folder / f'{name}.{kind}'
        units = {column: _unit(column, combined.size_unit) for column in columns}
        if kind == 'csv':
            values = [[_cell(row.get(column)) for column in columns] for row in rows]
            write_csv(path, columns, list(units.values()), values)
        else:
            kinds = [
                Column(name=column, kind=_kind(column), unit=units[column]) for column in columns
            ]
            write_parquet(path, kinds, [_arrays(kinds, rows)], provenance)
        paths.append(path)
    return paths


def _unit(column: str, size: str) -> str:
    if column in _TEXTS:
        return 'name'
    base = column.removeprefix('mean_').removesuffix('_scatter').removesuffix('_error')
    units = {field.name: field.unit for field in layout(CorEstimate).fields}
    if base == 'cluster_size':
        return size
    return _UNITS.get(base) or units.get(base) or '1'


def _cell(value: Any) -> Any:
    return float('nan') if value is None else value


def _kind(column: str) -> str:
    return 'text' if column in _TEXTS else 'i4' if column in _WHOLE else 'f8'


def _arrays(columns: Sequence[Column], rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    types = {'text': np.str_, 'i4': np.int32, 'f8': np.float64}
    empty = {'text': '', 'i4': 0, 'f8': np.nan}
    return {
        column.name: np.array(
            [
                empty[column.kind] if row.get(column.name) is None else row[column.name]
                for row in rows
            ],
            dtype=types[column.kind],
        )
        for column in columns
    }
