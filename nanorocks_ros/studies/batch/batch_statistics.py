"""Statistics of the gas in every recording of a batch, and their section in its report."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import NanorocksError, RecordingError
from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.outputs.html_report import NOT_KNOWN, Picture, Section, Table, with_error
from nanorocks_ros.outputs.json_values import read_object
from nanorocks_ros.outputs.safe_text import printable
from nanorocks_ros.records import Tracks
from nanorocks_ros.studies.analysis.results.results_folder import STATISTICS
from nanorocks_ros.studies.gas_statistics.statistics_figure import statistics_figure
from nanorocks_ros.studies.gas_statistics.statistics_files import statistics_values
from nanorocks_ros.studies.gas_statistics.tray_statistics import GasChoices, tray_statistics

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import CorEstimate
    from nanorocks_ros.settings import PipelineSettings

_PER_MM = 1e-3
_USUAL = GasChoices()
# Measured, theory beside it where there is one, and factor of the unit in the report.
_COLUMNS = (
    ('a2', 'fourth_cumulant', '', 1.0),
    ('anisotropy', 'anisotropy', '', 1.0),
    ('energy over that of the first', 'energy_ratio', '', 1.0),
    ('collisions per mm of path', 'collisions_per_path', 'theory_collisions_per_path', _PER_MM),
    ('wall hits per mm of path', 'wall_hits_per_path', 'theory_wall_hits_per_path', _PER_MM),
)


class TrackCollector:
    """Keeps the tracks of a recording while it is analysed."""

    def __init__(self) -> None:
        self.tracks: dict[int, list[Tracks]] = defaultdict(list)

    def __call__(self, record: object) -> None:
        """Keep the record if it holds tracks."""
        if isinstance(record, Tracks):
            self.tracks[record.tray].append(record)


def write_statistics(
    folder: Path,
    collector: TrackCollector,
    trays: Mapping[int, Tray],
    settings: PipelineSettings,
    last: Mapping[int, CorEstimate],
) -> None:
    """Measure the gas of every tray of a recording; write values and a figure of each.

    Parameters
    ----------
    folder : Path
        Of the results of the recording.
    collector : TrackCollector
        Of the recording.
    trays : mapping of int to Tray
    settings : PipelineSettings
        Of the analysis: its delay is the start of the part of each cycle that is used.
    last : mapping of int to CorEstimate
        Last estimate of each tray, whose restitutions are those of the gas of theory.

    Raises
    ------
    RecordingError
        When a file cannot be written.
    """
    values: dict[str, Any] = {}
    for number, tracks in sorted(collector.tracks.items()):
        try:
            choices = _choices(settings, last.get(number))
            statistics = tray_statistics(tracks, trays[number], choices)
        except NanorocksError as error:
            # The restitutions stand without them.
            values[str(number)] = {'reason': printable(str(error))}
            continue
        values[str(number)] = statistics_values(statistics)
        statistics_figure(folder / figure_name(number), statistics)
    write_bytes(folder / STATISTICS, json.dumps(values, allow_nan=False).encode())


def figure_name(tray: int) -> str:
    """Name of the figure of a tray."""
    return f'tray_{tray}_statistics.png'


def _choices(settings: PipelineSettings, last: CorEstimate | None) -> GasChoices:
    beads, walls = _USUAL.restitution, _USUAL.wall_restitution
    if last is not None and math.isfinite(last.restitution.value):
        beads = last.restitution.value
    if last is not None and math.isfinite(last.wall_restitution.value):
        walls = last.wall_restitution.value
    return GasChoices(start=settings.cooling.delay, restitution=beads, wall_restitution=walls)


def statistics_section(results: Mapping[str, Path]) -> Section | None:
    """The section of the report; None for a batch without statistics.

    Parameters
    ----------
    results : mapping of str to Path
        Folder of the results of each recording, by its name.
    """
    by_tray: dict[int, list[tuple[str, dict[str, Any]]]] = defaultdict(list)
    reasons: list[str] = []
    for name, folder in results.items():
        for number, values in _read(folder).items():
            if 'reason' in values:
                reasons.append(f'{Path(name).name}: {values["reason"]}.')
            else:
                by_tray[int(number)].append((name, values))
    if not by_tray and not reasons:
        return None
    section = Section(title='The gas: velocities, collisions, pairs, structure')
    if by_tray:
        section.parts.append(_table(by_tray))
    for tray, own in sorted(by_tray.items()):
        longest, values = max(own, key=lambda pair: float(pair[1]['seconds']))
        section.parts.append(
            Picture(
                path=results[longest] / figure_name(tray),
                caption=f'Tray {tray} in {Path(longest).name}, the recording with the most '
                f'time used, {values["seconds"]:.0f} s. The figures of the others lie beside '
                'their tables.',
            )
        )
    return Section(title=section.title, parts=[*section.parts, *reasons])


def _read(folder: Path) -> dict[str, dict[str, Any]]:
    try:
        return read_object(folder / STATISTICS)
    except (OSError, ValueError, RecordingError):
        return {}


def _table(by_tray: Mapping[int, list[tuple[str, dict[str, Any]]]]) -> Table:
    rows = []
    for number, own in sorted(by_tray.items()):
        kinds = [values['species'] for _, values in own]
        for place, species in enumerate(kinds[0]):
            same = [recording[place] for recording in kinds]
            cells = [_cell(same, name, theory, factor) for _, name, theory, factor in _COLUMNS]
            rows.append((str(number), printable(species['material']), str(len(own)), *cells))
    return Table(
        head=('tray', 'beads', 'recordings', *(title for title, *_ in _COLUMNS)),
        rows=rows,
        caption='Means over the recordings, weighted by their errors; in brackets what kinetic '
        'theory between walls gives for the restitutions measured. a2: fourth cumulant of the '
        'velocities, 0 of a normal law. Path: projected.',
    )


def _cell(recordings: Sequence[Mapping[str, Any]], name: str, theory: str, factor: float) -> str:
    """Weighted mean and its error, and the mean of theory."""
    known = [
        (float(values[name]), float(values[f'{name}_error']))
        for values in recordings
        if values.get(name) is not None and values.get(f'{name}_error')
    ]
    if not known:
        return NOT_KNOWN
    weights = [error**-2 for _, error in known]
    mean = sum(weight * value for weight, (value, _) in zip(weights, known, strict=True))
    text = with_error(mean / sum(weights), sum(weights) ** -0.5, factor)
    expected = [float(values[theory]) for values in recordings if theory and values.get(theory)]
    if expected:
        text += f' ({factor * sum(expected) / len(expected):.3g})'
    return text
