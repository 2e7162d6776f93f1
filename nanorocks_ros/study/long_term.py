"""A campaign cycle by cycle: peak speeds, restitutions and cluster sizes from many recordings."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import stats

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.inference.campaign import (
    QuietPeriod,
    Trend,
    quiet_periods,
    robust_trend,
)
from nanorocks_ros.recordings.results import write_csv
from nanorocks_ros.records import CorStatus
from nanorocks_ros.study.result_tables import read_columns, trays_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

# A peak is looked for this long after a shaking event, the end of a cycle is its last part, [s].
_PEAK, _END = 3.0, 10.0
# Of the values there, so many at either end are left out of the mean; counts of pixels have no
# median worth the name. Of normal values its error is by this factor larger than that of all.
_TRIMMED, _WORSE = 0.25, 1.09
_KNOWN = (CorStatus.COOLING, CorStatus.FINAL)


class SizeMeasure(NamedTuple):
    """What a cluster size is read from: a table, its column, that of the error, and its unit."""

    table: str
    column: str
    error: str
    unit: str
    text: str


# The first that is there is taken for all recordings.
SIZE_MEASURES = (
    SizeMeasure('body', 'weighted_size', 'weighted_size_error', '1', 'beads of a cluster'),
    SizeMeasure('cluster', 'cluster_size', 'cluster_size_error', '1', 'beads of a cluster'),
    SizeMeasure('cluster', 'correlation_length', '', 'm', 'correlation length'),
)
QUANTITIES = ('peak_speed', 'restitution', 'cluster_size')


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """Many cycles of some trays.

    Parameters
    ----------
    cycles : tuple of CycleSummary
        In order of place, then tray.
    places : int
        Cycles in all.
    measure : SizeMeasure
    trends : dict of (tray, quantity) to Trend
        Change of a quantity in a cycle.
    periods : tuple of QuietPeriod
        By place.
    """

    cycles: tuple[CycleSummary, ...]
    places: int
    measure: SizeMeasure
    trends: dict[tuple[int, str], Trend]
    periods: tuple[QuietPeriod, ...]

    @property
    def trays(self) -> tuple[int, ...]:
        """Numbers of the trays."""
        return tuple(sorted({one.tray for one in self.cycles}))

    def values(self, tray: int, quantity: str) -> NDArray[np.float64]:
        """One quantity of one tray by place, (places,); NaN where not known."""
        found = np.full(self.places, math.nan)
        for one in self.cycles:
            if one.tray == tray:
                found[one.place] = getattr(one, quantity)
        return found


def read_campaign(folders: Sequence[Path], false_alarms: float = 0.01) -> Campaign:
    """Everything that results of `nanorocks analyse` say cycle by cycle.

    Parameters
    ----------
    folders : sequence of Path
        In order of time.
    false_alarms : float
        See `quiet_periods`.

    Raises
    ------
    RecordingError
        When a folder holds no results, or none of them a cycle.
    ConfigurationError
        For a rate of false alarms that is none, or a folder that is named twice.
    """
    places_of = [folder.resolve() for folder in folders]
    if len(set(places_of)) < len(places_of):
        again = next(one for one in places_of if places_of.count(one) > 1)
        raise ConfigurationError(str(again), 'is named twice', 'name each recording once')
    trays = {folder: trays_of(folder, 'speed') for folder in folders}
    measure = _measure(trays)
    cycles: list[CycleSummary] = []
    places = 0
    for folder, numbers in trays.items():
        found = {number: _cycles_of(folder, number, measure) for number in numbers}
        # Trays are filmed together, but a shaking event may be missed in one of them.
        known = sorted({one.cycle for own in found.values() for one in own})
        cycles += [
            _placed(one, places + known.index(one.cycle)) for own in found.values() for one in own
        ]
        places += len(known)
    if not cycles:
        raise RecordingError(
            ', '.join(str(one) for one in folders),
            'hold no cycle after a shaking event',
            'analyse recordings with shaking events',
        )
    cycles.sort(key=lambda one: (one.place, one.tray))
    campaign = Campaign(
        cycles=tuple(cycles), places=places, measure=measure, trends={}, periods=()
    )
    x = np.arange(places, dtype=np.float64)
    sizes = np.array([campaign.values(number, 'cluster_size') for number in campaign.trays])
    return Campaign(
        cycles=campaign.cycles,
        places=places,
        measure=measure,
        trends={
            (number, name): robust_trend(x, campaign.values(number, name))
            for number in campaign.trays
            for name in QUANTITIES
        },
        periods=quiet_periods(sizes, false_alarms),
    )


def write_campaign(campaign: Campaign, path: Path) -> None:
    """One row for each cycle of each tray, as CSV.

    Raises
    ------
    RecordingError
        When it cannot be written.
    """
    size = campaign.measure.unit
    units = {
        'recording': 'name',
        'place': '1',
        'tray': '1',
        'cycle': '1',
        'start': 's',
        'peak_speed': 'm/s',
        'peak_speed_error': 'm/s',
        'restitution': '1',
        'restitution_lower': '1',
        'restitution_upper': '1',
        'cluster_size': size,
        'cluster_size_error': size,
        'quiet': '1',
    }
    rows = [
        [*(getattr(one, name) for name in list(units)[:-1]), int(in_period(campaign, one.place))]
        for one in campaign.cycles
    ]
    write_csv(path, list(units), list(units.values()), rows)


def in_period(campaign: Campaign, place: int) -> bool:
    """Whether a cycle is in a quiet period."""
    return any(one.first <= place <= one.last for one in campaign.periods)


def _measure(trays: dict[Path, tuple[int, ...]]) -> SizeMeasure:
    """The best measure of cluster size that all results have."""

    def has(folder: Path, number: int, one: SizeMeasure) -> bool:
        path = folder / f'tray_{number}_{one.table}.csv'
        if not path.is_file():
            return False
        return one.column in read_columns(path, (), (one.column,))

    for one in SIZE_MEASURES[:-1]:
        if all(has(folder, number, one) for folder, own in trays.items() for number in own):
            return one
    return SIZE_MEASURES[-1]


def _placed(one: CycleSummary, place: int) -> CycleSummary:
    return replace(one, place=place)


def _cycles_of(folder: Path, tray: int, measure: SizeMeasure) -> list[CycleSummary]:
    speeds = read_columns(
        folder / f'tray_{tray}_speed.csv',
        (
            'time',
            'cycle',
            'cycle_start',
            'mean_projected_speed',
            'mean_projected_speed_error',
        ),
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
    found = []
    known = np.isfinite(speeds['cycle_start']) & (speeds['cycle'] > 0.0)
    for cycle in np.unique(speeds['cycle'][known]):
        own = known & (speeds['cycle'] == cycle)
        start = float(speeds['cycle_start'][own][0])
        # Of a recording that was played twice the first time is enough.
        own &= speeds['cycle_start'] == start
        end = float(speeds['time'][own].max())
        found.append(
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
    return found


def _table(
    path: Path, wanted: Sequence[str], optional: Sequence[str] = ()
) -> dict[str, NDArray[np.float64]]:
    """Columns of a table that need not be there."""
    if not path.is_file():
        return {name: np.zeros(0) for name in wanted}
    return read_columns(path, wanted, optional)


def _peak(
    speeds: dict[str, NDArray[np.float64]], own: NDArray[np.bool_], start: float
) -> dict[str, float]:
    early = own & (speeds['time'] - start <= _PEAK) & np.isfinite(speeds['mean_projected_speed'])
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
    middle = float(stats.trim_mean(values, _TRIMMED))
    error = math.nan
    if values.size > 1:
        error = _WORSE * float(np.std(values, ddof=1)) / math.sqrt(values.size)
    if measure.error in sizes:
        # Errors of one count after the other are those of the same bodies: they don't average.
        error = float(np.fmax(error, np.median(sizes[measure.error][own])))
    return {'cluster_size': middle, 'cluster_size_error': error}
