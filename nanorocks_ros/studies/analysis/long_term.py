"""A campaign cycle by cycle: peak speeds, restitutions and cluster sizes from many recordings."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.inference.trend_tests import (
    QuietPeriod,
    Trend,
    quiet_periods,
    robust_trend,
)
from nanorocks_ros.outputs.tables.table_columns import Column
from nanorocks_ros.outputs.tables.table_files import write_rows
from nanorocks_ros.records import CorEstimate
from nanorocks_ros.studies.analysis.cycle_summaries import (
    CycleSummary,
    SizeMeasure,
    cycles_of,
    size_measure,
)
from nanorocks_ros.studies.analysis.results.result_tables import trays_of
from nanorocks_ros.studies.results.record_columns import columns_of
from nanorocks_ros.studies.results.run_provenance import run_provenance

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

QUANTITIES = ('peak_speed', 'restitution', 'cluster_size')


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
        return tuple(sorted({cycle.tray for cycle in self.cycles}))

    def values(self, tray: int, quantity: str) -> NDArray[np.float64]:
        """One quantity of one tray by place, (places,); NaN where not known."""
        values = np.full(self.places, math.nan)
        for cycle in self.cycles:
            if cycle.tray == tray:
                values[cycle.place] = getattr(cycle, quantity)
        return values


def read_campaign(folders: Sequence[Path], false_alarms: float = 0.01) -> Campaign:
    """The cycles in results of `nanorocks analyse`, with trends.

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
        again = next(place for place in places_of if places_of.count(place) > 1)
        raise ConfigurationError(str(again), 'is named twice', 'name each recording once')
    trays = {folder: trays_of(folder, 'speed') for folder in folders}
    measure = size_measure(trays)
    recordings = [
        {number: cycles_of(folder, number, measure) for number in numbers}
        for folder, numbers in trays.items()
    ]
    if not any(own for recording in recordings for own in recording.values()):
        raise RecordingError(
            ', '.join(str(folder) for folder in folders),
            'hold no cycle after a shaking event',
            'analyse recordings with shaking events',
        )
    return campaign_of(recordings, measure, false_alarms)


def campaign_of(
    recordings: Sequence[Mapping[int, Sequence[CycleSummary]]],
    measure: SizeMeasure,
    false_alarms: float = 0.01,
) -> Campaign:
    """Cycles of many recordings, one after the other.

    Parameters
    ----------
    recordings : sequence of mappings of int to sequences of CycleSummary
        Of each recording the cycles of each tray; one cycle at least in all.
    measure : SizeMeasure
        By which their sizes were read.
    false_alarms : float
        See `quiet_periods`.

    Raises
    ------
    ConfigurationError
        For a rate of false alarms that is none.
    """
    cycles: list[CycleSummary] = []
    places = 0
    for recording in recordings:
        # Trays are filmed together, but a shaking event may be missed in one of them.
        cycle_numbers = sorted({summary.cycle for own in recording.values() for summary in own})
        cycles += [
            _placed(summary, places + cycle_numbers.index(summary.cycle))
            for own in recording.values()
            for summary in own
        ]
        places += len(cycle_numbers)
    cycles.sort(key=lambda summary: (summary.place, summary.tray))
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
    columns = campaign_columns(campaign.measure)
    rows = [
        [
            *(getattr(cycle, column.name) for column in columns[:-1]),
            in_period(campaign, cycle.place),
        ]
        for cycle in campaign.cycles
    ]
    write_rows(path, columns, rows, run_provenance())


def campaign_columns(measure: SizeMeasure) -> tuple[Column, ...]:
    """Columns of the table of a campaign, a row for each cycle of each tray."""
    of_cor = {column.name: column for column in columns_of(CorEstimate)}
    return (
        Column(name='recording', kind='string', doc='name of the folder of results'),
        Column(name='place', kind='int64', unit='1', doc='in the campaign, from 0'),
        Column(name='tray', kind='int64', unit='1', doc='number of the tray'),
        of_cor['cycle'],
        Column(name='start', unit='s', doc='of the cycle in the recording, since epoch'),
        Column(name='peak_speed', unit='m/s', doc='largest mean projected speed of the cycle'),
        Column(name='peak_speed_error', unit='m/s', doc='one standard error'),
        *(of_cor[name] for name in ('restitution', 'restitution_lower', 'restitution_upper')),
        Column(name='cluster_size', unit=measure.unit, doc=f'at the end: {measure.text}'),
        Column(name='cluster_size_error', unit=measure.unit, doc='one standard error'),
        Column(name='quiet', kind='bool', doc='whether the cycle is in a quiet period'),
    )


def in_period(campaign: Campaign, place: int) -> bool:
    """Whether a cycle is in a quiet period."""
    return any(period.first <= place <= period.last for period in campaign.periods)


def _placed(summary: CycleSummary, place: int) -> CycleSummary:
    return replace(summary, place=place)
