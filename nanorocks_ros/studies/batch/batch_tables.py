"""A batch as tables: a row for every cycle, and one for every tray.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.outputs.tables.table_columns import JOINED, Column
from nanorocks_ros.outputs.tables.table_files import write_package, write_table
from nanorocks_ros.records import ClusterEstimate, CorEstimate
from nanorocks_ros.studies.analysis.results.results_json import BY_SOURCE
from nanorocks_ros.studies.batch.campaign_means import MEANS, Combined
from nanorocks_ros.studies.batch.means_json import means_as_json
from nanorocks_ros.studies.results.record_columns import GOOD, columns_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.outputs.tables.table_columns import Kind

CYCLES, TRAYS = 'cycles', 'trays'
_OF_COR = {column.name: column for column in columns_of(CorEstimate)}
_OF_CLUSTERS = {column.name: column for column in columns_of(ClusterEstimate)}
_RECORDING = Column(name='recording', kind='string', doc='name of the recording')
_TRAY = Column(name='tray', kind='int64', unit='1', doc='number of the tray')
_FROM_COR = (
    *('status', 'relation', 'samples', 'quality'),
    *('restitution', 'restitution_lower', 'restitution_upper'),
    *('restitution_lower_68', 'restitution_upper_68'),
    *('wall_restitution', 'wall_restitution_lower', 'wall_restitution_upper'),
    *('wall_restitution_lower_68', 'wall_restitution_upper_68', 'correlation'),
    *('headline', *BY_SOURCE),
    *('paper_restitution', 'initial_speed', 'initial_speed_error'),
    *('haff_time', 'haff_time_error', 'reduced_chi_square'),
    *('window_start', 'window_end', 'cooling_start', 'rebounds', 'collisions', 'tension'),
)
_FROM_CLUSTERS = (
    *('bodies', 'bodies_error', 'onset', 'sticking_status'),
    *('sticking_speed', 'sticking_speed_lower', 'sticking_speed_upper'),
    *('sticking_speed_lower_68', 'sticking_speed_upper_68'),
)
_WORDS = 'headline', 'sticking_status'
_COUNTS = 'recordings', 'cycles', 'cycles_read', 'decays_left_out', 'rebounds', 'collisions'
# What the end of a name says of the quantity before it.
_ENDS = {
    '_error': 'one standard error',
    '_lower': 'lower end of the interval',
    '_upper': 'upper end of the interval',
    '_lower_68': 'lower end of the interval of 68 %',
    '_upper_68': 'upper end of the interval of 68 %',
    '_scatter': 'standard deviation of a cycle',
}
_UNKNOWN = 'unknown'
_YES_OR_NO = {
    'friction_unknown': 'whether beads count as smooth, since rebounds do not tell if they rub',
    'speed_dependent': 'whether contacts at different speeds contradict a constant restitution',
}
_ANSWERS = {True: 'yes', False: 'no', None: None}
# Of a value that is not known, and type of the array.
_EMPTY: dict[Kind, tuple[Any, Any]] = {
    'string': (_UNKNOWN, np.str_),
    'int64': (0, np.int64),
    'float64': (np.nan, np.float64),
}


def write_tables(
    combined: Combined, folder: Path, kind: str, provenance: dict[str, Any]
) -> list[Path]:
    """Write both, and what describes them.

    Parameters
    ----------
    combined : Combined
    folder : Path
    kind : 'csv' or 'parquet'
    provenance : dict
        Values for JSON.

    Returns
    -------
    list of Path
        Of the tables.

    Raises
    ------
    ConfigurationError
        When nothing can write Parquet here.
    RecordingError
        When they cannot be written.
    """
    cycles = [
        {'recording': cycle.recording, 'tray': cycle.tray, **_in_words(cycle.values)}
        for cycle in combined.cycles
    ]
    trays = [
        {'tray': number, **_tray_in_words(means_as_json(tray))}
        for number, tray in sorted(combined.trays.items())
    ]
    names = tuple(dict.fromkeys(key for row in trays for key in row))
    tables = {
        f'{CYCLES}.{kind}': (cycle_columns(combined.size_unit), cycles),
        f'{TRAYS}.{kind}': (
            tuple(_mean_column(name, combined.size_unit) for name in names) or (_TRAY,),
            trays,
        ),
    }
    for name, (columns, rows) in tables.items():
        arrays = {column.name: _array(column, rows) for column in columns}
        write_table(folder / name, columns, [arrays], provenance, described=False)
    write_package(folder, {name: columns for name, (columns, _) in tables.items()}, provenance)
    return [folder / name for name in tables]


def _in_words(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values of a cycle; its flags, a list in JSON, as in the tables."""
    return {**values, 'quality': JOINED.join(values.get('quality') or ()) or GOOD}


def _tray_in_words(values: Mapping[str, Any]) -> dict[str, Any]:
    return {**values, **{name: _ANSWERS[values[name]] for name in _YES_OR_NO}}


def cycle_columns(size_unit: str) -> tuple[Column, ...]:
    """Columns of the table of cycles; cluster sizes in beads, ``1``, or lengths, ``m``."""
    return (
        _RECORDING,
        _TRAY,
        _OF_COR['cycle'],
        Column(name='start', unit='s', doc='of the cycle, since epoch'),
        *(_OF_COR[name] for name in _FROM_COR),
        Column(name='peak_speed', unit='m/s', doc='largest mean projected speed of the cycle'),
        Column(name='peak_speed_error', unit='m/s', doc='one standard error'),
        Column(name='cluster_size', unit=size_unit, doc='at the end of the cycle'),
        Column(name='cluster_size_error', unit=size_unit, doc='one standard error'),
        *(_OF_CLUSTERS[name] for name in _FROM_CLUSTERS),
    )


def _mean_column(name: str, size_unit: str) -> Column:
    """A column of the means of all cycles of a tray."""
    if name == 'tray':
        return _TRAY
    if name in _WORDS:
        return _OF_COR.get(name) or _OF_CLUSTERS[name]
    if name in _YES_OR_NO:
        words = 'yes', 'no', _UNKNOWN
        return Column(name=name, kind='string', doc=_YES_OR_NO[name], words=words)
    quantity, doc = name.removeprefix('mean_'), ''
    if name in _COUNTS or name.endswith('_cycles'):
        return Column(name=name, kind='int64', unit='1', doc='number of these')
    for end, meaning in _ENDS.items():
        if quantity.endswith(end):
            quantity, doc = quantity.removesuffix(end), meaning
    units = {**{key: column.unit for key, column in _OF_COR.items()}, **MEANS}
    unit = size_unit if quantity == 'cluster_size' else units.get(quantity)
    own = _OF_COR.get(quantity) or _OF_CLUSTERS.get(quantity)
    return Column(
        name=name,
        unit=unit or (own.unit if own else '1'),
        doc=doc or (f'mean over cycles: {own.doc}' if own else 'mean over cycles'),
    )


def _array(column: Column, rows: Sequence[Mapping[str, Any]]) -> NDArray[Any]:
    empty, dtype = _EMPTY[column.kind]
    values = [row.get(column.name) for row in rows]
    return np.array([empty if value is None else value for value in values], dtype=dtype)
