"""Summary of each shaking cycle from the tables: peak speed, restitution, cluster size.

Tested by ``test/studies/analysis/test_long_term.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.records import CorStatus, Quality
from nanorocks_ros.studies.analysis.results.result_tables import read_columns

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

# A peak is looked for this long after a shaking event, the end of a cycle is its last part, [s].
_PEAK, _END = 3.0, 10.0
# Of the values there, so many at either end are left out of the mean; counts of pixels have no
# median worth the name. Of normal values its error is by this factor larger than that of all.
_TRIMMED, _WORSE = 0.25, 1.09
_KNOWN = (CorStatus.COOLING, CorStatus.FINAL)


class SizeMeasure(NamedTuple):
    """A measure of cluster size: table, column, column of the error, unit."""

    table: str
    column: str
    error: str
    unit: str
    text: str


# The first that is known in every tray of every recording is taken for all of them.
SIZE_MEASURES = (
    SizeMeasure('cluster', 'combined_size', 'combined_size_error', '1', 'beads of a cluster'),
    SizeMeasure('bodies', 'weighted_size', 'weighted_size_error', '1', 'beads of a cluster'),
    SizeMeasure('cluster', 'cluster_size', 'cluster_size_error', '1', 'beads of a cluster'),
    SizeMeasure('cluster', 'correlation_length', '', 'm', 'correlation length'),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleSummary:
    """One shaking cycle of one tray; NaN where something is not known.

    Parameters
    ----------
    tray : int
    recording : str
        Name of the folder of results.
    cycle : int
        In that recording.
    place : int
        In the campaign, counted from 0: the same in all trays.
    start : float, [s]
        Of the cycle in the recording.
    peak_speed, peak_speed_error : float, [m/s]
        Largest mean projected speed after the shaking event, and its error as a measurement.
    restitution, restitution_lower, restitution_upper : float
    cluster_size, cluster_size_error : float
        At the end of the cycle, as `Campaign.measure` says.
    """

    tray: int
    recording: str
    cycle: int
    place: int
    start: float
    peak_speed: float
    peak_speed_error: float
    restitution: float
    restitution_lower: float
    restitution_upper: float
    cluster_size: float
    cluster_size_error: float


def size_measure(trays: Mapping[Path, tuple[int, ...]]) -> SizeMeasure:
    """The best measure of cluster size that all results have: folders, and their trays."""

    def has(folder: Path, number: int, measure_checked: SizeMeasure) -> bool:
        path = folder / f'tray_{number}_{measure_checked.table}.csv'
        if not path.is_file():
            return False
        values = read_columns(path, (), (measure_checked.column,)).get(measure_checked.column)
        return values is not None and bool(np.isfinite(values).any())

    for measure in SIZE_MEASURES[:-1]:
        if all(has(folder, number, measure) for folder, own in trays.items() for number in own):
            return measure
    return SIZE_MEASURES[-1]


def cycles_of(folder: Path, tray: int, measure: SizeMeasure) -> list[CycleSummary]:
    """The cycles of one tray in one recording, their places not counted yet.

    Raises
    ------
    RecordingError
        When a table cannot be read.
    """
    speeds = read_columns(
        folder / f'tray_{tray}_speed.csv',
        (
            'time',
            'cycle',
            'cycle_start',
            'mean_projected_speed',
            'mean_projected_speed_error',
        ),
        ('quality',),
    )
    cors = _table(
        folder / f'tray_{tray}_cor.csv',
        ('cycle', 'status', 'restitution', 'restitution_lower', 'restitution_upper'),
    )
    sizes = _table(
        folder / f'tray_{tray}_{measure.table}.csv',
        ('time', 'cycle', measure.column),
        (measure.error,),
    )
    summaries = []
    has_cycle = np.isfinite(speeds['cycle_start']) & (speeds['cycle'] > 0.0)
    for cycle in np.unique(speeds['cycle'][has_cycle]):
        own = has_cycle & (speeds['cycle'] == cycle)
        start = float(speeds['cycle_start'][own][0])
        # If a recording was played twice, the first pass is used.
        own &= speeds['cycle_start'] == start
        end = float(speeds['time'][own].max())
        summaries.append(
            CycleSummary(
                tray=tray,
                recording=folder.name,
                cycle=int(cycle),
                place=0,
                start=start,
                **_peak(speeds, own, start),
                **_restitution(cors, cycle),
                **_size(sizes, measure, cycle, (max(start, end - _END), end)),
            )
        )
    return summaries


def _table(
    path: Path, wanted: Sequence[str], optional: Sequence[str] = ()
) -> dict[str, NDArray[np.float64]]:
    """Columns of a table; empty columns if the table is missing."""
    if not path.is_file():
        return {name: np.zeros(0) for name in wanted}
    return read_columns(path, wanted, optional)


def _peak(
    speeds: dict[str, NDArray[np.float64]], own: NDArray[np.bool_], start: float
) -> dict[str, float]:
    early = own & (speeds['time'] - start <= _PEAK) & np.isfinite(speeds['mean_projected_speed'])
    if 'quality' in speeds:
        # Speeds at a wrong scale have an unknown error.
        early &= (speeds['quality'].astype(np.int64) & Quality.WRONG_SCALE) == 0
    if not early.any():
        return {'peak_speed': math.nan, 'peak_speed_error': math.nan}
    values = speeds['mean_projected_speed'][early]
    highest = int(np.argmax(values))
    return {
        'peak_speed': float(values[highest]),
        'peak_speed_error': float(speeds['mean_projected_speed_error'][early][highest]),
    }


def _restitution(cors: dict[str, NDArray[np.float64]], cycle: float) -> dict[str, float]:
    names = 'restitution', 'restitution_lower', 'restitution_upper'
    own = np.flatnonzero((cors['cycle'] == cycle) & np.isin(cors['status'], _KNOWN))
    if own.size == 0:
        return dict.fromkeys(names, math.nan)
    final = own[cors['status'][own] == CorStatus.FINAL]
    row = final[-1] if final.size else own[-1]
    return {name: float(cors[name][row]) for name in names}


def _size(
    sizes: dict[str, NDArray[np.float64]],
    measure: SizeMeasure,
    cycle: float,
    span: tuple[float, float],
) -> dict[str, float]:
    """Mean of the middle half of values at the end of a cycle, and its error, or that stated."""
    own = (sizes['cycle'] == cycle) & (sizes['time'] >= span[0]) & (sizes['time'] <= span[1])
    own &= np.isfinite(sizes[measure.column])
    values = sizes[measure.column][own]
    if values.size == 0:
        return {'cluster_size': math.nan, 'cluster_size_error': math.nan}
    left_out = int(_TRIMMED * values.size)
    ends = left_out, values.size - left_out
    middle = float(np.mean(np.partition(values, (ends[0], ends[1] - 1))[slice(*ends)]))
    error = math.nan
    if values.size > 1:
        error = _WORSE * float(np.std(values, ddof=1)) / math.sqrt(values.size)
    if measure.error in sizes:
        # Errors of one count after the other are those of the same bodies: they don't average.
        error = float(np.fmax(error, np.median(sizes[measure.error][own])))
    return {'cluster_size': middle, 'cluster_size_error': error}
