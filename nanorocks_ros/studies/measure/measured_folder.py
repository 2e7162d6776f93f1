"""The folder of results of `nanorocks measure`: its tables, its numbers, and what it says again.

Tested by ``test/interface/test_measuring.py``.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.outputs.json_values import read_object
from nanorocks_ros.outputs.tables.table_files import write_package, write_table
from nanorocks_ros.outputs.unfinished_files import holds_files
from nanorocks_ros.studies.analysis.results.tracks_files import columns_of
from nanorocks_ros.studies.measure.measure_tables import tray_tables
from nanorocks_ros.studies.measure.measured_tray import DECAY_NOT_READ
from nanorocks_ros.studies.results.results_provenance import provenance_of, read_provenance

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from nanorocks_ros.outputs.tables.table_columns import Column
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag
    from nanorocks_ros.studies.measure.measured_tray import MeasuredTray
    from nanorocks_ros.studies.results.results_provenance import ResultsProvenance

MARK = 'measured.json'
"""File of a folder of results; it marks the folder, and holds the numbers."""

TRACKS = 'tracks.csv'
"""Table of all tracks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredFolder:
    """What a folder says of a film.

    Parameters
    ----------
    film : str
        Its name.
    usable : bool
        Whether the beads were recognised well enough.
    notices : tuple of str
    trays : dict of int to dict
        As of `MeasuredTray.as_json`.
    provenance : ResultsProvenance
    """

    film: str
    usable: bool
    notices: tuple[str, ...]
    trays: dict[int, dict[str, Any]]
    provenance: ResultsProvenance

    @property
    def decay_read(self) -> bool:
        """Whether there are results of the decay, in the folder of a tray."""
        return any(
            tray['decay'] and not tray['decay'][0].startswith(DECAY_NOT_READ)
            for tray in self.trays.values()
        )


def is_measured(folder: Path) -> bool:
    """Whether a folder is one of `nanorocks measure`."""
    return (folder / MARK).is_file()


def prepare_folder(folder: Path) -> None:
    """Make the folder of results.

    Raises
    ------
    RecordingError
        When it holds something else, or cannot be made.
    """
    if folder.exists() and not (folder / MARK).exists() and holds_files(folder):
        raise RecordingError(
            str(folder), 'exists and holds no results of `nanorocks measure`', 'pass another -o'
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(
            str(folder), f'cannot be written ({error.strerror})', 'pass another -o'
        ) from error
    if not (folder / MARK).exists():
        write_bytes(folder / MARK, b'{}\n')


def write_measured(
    folder: Path,
    film: str,
    tracked: TrackedBag,
    trays: Sequence[MeasuredTray],
    settings: PipelineSettings,
) -> None:
    """Write tables, their description, and the numbers.

    The table of the tracks is there already.

    Raises
    ------
    RecordingError
        When a file cannot be written.
    """
    tables: dict[str, Sequence[Column]] = {TRACKS: columns_of(tracked)}
    for tray in trays:
        for table_name, table in tray_tables(tray, tracked).items():
            name = f'tray_{tray.number}_{table_name}.csv'
            write_table(folder / name, table.columns, [table.values], {}, described=False)
            tables[name] = table.columns
    provenance = provenance_of(settings, source=film, epoch_ns=tracked.epoch_ns, recorded={})
    write_package(folder, tables, provenance.as_json())
    content = {
        'film': film,
        'usable': tracked.usable,
        'notices': list(tracked.notices),
        'trays': {str(tray.number): tray.as_json() for tray in trays},
    }
    write_bytes(folder / MARK, (json.dumps(content, indent=1) + '\n').encode())


def read_measured(folder: Path) -> MeasuredFolder:
    """Read what a folder says.

    Raises
    ------
    RecordingError
        When it cannot be read, or is that of a run that was interrupted.
    """
    path = folder / MARK
    try:
        content = read_object(path)
        provenance = read_provenance(folder)
        if not content or provenance is None:
            raise RecordingError(
                str(folder), 'is not complete', 'run the same `nanorocks measure` again'
            )
        return MeasuredFolder(
            film=str(content['film']),
            usable=bool(content['usable']),
            notices=tuple(map(str, content['notices'])),
            trays={int(number): dict(values) for number, values in content['trays'].items()},
            provenance=provenance,
        )
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise RecordingError(
            str(path), 'holds no results', 'run the same `nanorocks measure` again'
        ) from error
