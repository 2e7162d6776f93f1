"""Tracks as tables: CSV, or Parquet where pyarrow is installed.

Tested by ``test/studies/analysis/test_bag_tracks.py``.
"""

from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros import __version__
from nanorocks_ros.outputs.atomic_files import atomic_file
from nanorocks_ros.outputs.parquet import Column, write_parquet

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks
    from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag

TABLES = '.csv', '.parquet'
"""Endings of the files below."""

COLUMNS = (
    Column(name='time', kind='f8', unit='s'),
    Column(name='frame', kind='i4'),
    Column(name='tray', kind='i4'),
    Column(name='id', kind='i4'),
    Column(name='species', kind='text'),
    Column(name='x', kind='f8', unit='m'),
    Column(name='y', kind='f8', unit='m'),
    Column(name='position_error', kind='f8', unit='m'),
    Column(name='vx', kind='f8', unit='m/s'),
    Column(name='vy', kind='f8', unit='m/s'),
    Column(name='velocity_error', kind='f8', unit='m/s'),
    Column(name='radius', kind='f8', unit='m'),
    Column(name='radius_error', kind='f8', unit='m'),
    Column(name='seen', kind='i4'),
)
"""Columns of the table, a row for each bead in each frame: positions from the corner of the
tray floor, velocities past the camera, `seen` 0 where the bead is hidden and predicted."""

_LENGTHS = 'x', 'y', 'position_error', 'vx', 'vy', 'velocity_error', 'radius', 'radius_error'
_PX_COLUMNS = tuple(
    Column(name=f'{column.name}_px', kind='f8', unit=(column.unit or 'm').replace('m', 'px', 1))
    for column in COLUMNS
    if column.name in _LENGTHS
)

# Digits of a number in CSV: nanometres of a tray, and less than any error.
_DIGITS = 7
_NS = 1e9


def columns_of(tracked: TrackedBag) -> tuple[Column, ...]:
    """Columns of the table of a recording.

    Where its trays file was made for the film, lengths and speeds stand there in px of the frame,
    too; and in px alone where the scale is not known.
    """
    if tracked.film is None:
        return COLUMNS
    if tracked.film.scale_known:
        return (*COLUMNS, *_PX_COLUMNS)
    return (*(column for column in COLUMNS if column.name not in _LENGTHS), *_PX_COLUMNS)


def write_tracks(path: Path, tracked: TrackedBag) -> None:
    """Write the tracks of every tray, frame by frame.

    Parameters
    ----------
    path : Path
        ``.csv`` or ``.parquet``; a file there is replaced, once the new one is complete. CSV
        leaves empty what is not known, and names the units in its first line.
    tracked : TrackedBag

    Raises
    ------
    ConfigurationError
        When pyarrow, which writes Parquet, is not installed.
    RecordingError
        When the file cannot be written.
    """
    columns = columns_of(tracked)
    if path.suffix == '.parquet':
        write_parquet(path, columns, track_pieces(tracked), _provenance(tracked))
        return
    with atomic_file(path) as part, part.open('w', encoding='utf-8', newline='') as stream:
        units = ', '.join(f'{column.name} [{column.unit}]' for column in columns if column.unit)
        stream.write(f'# {units}\n')
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow([column.name for column in columns])
        for piece in track_pieces(tracked):
            texts = [_as_text(piece[column.name]) for column in columns]
            writer.writerows(zip(*texts, strict=True))


def track_pieces(tracked: TrackedBag) -> Iterator[dict[str, NDArray[Any]]]:
    """The rows of the table, by column, frame by frame."""
    for number in tracked.trays:
        frames = zip(tracked.tracks[number], tracked.numbers[number], strict=True)
        for tracks, frame in frames:
            if tracks.ids.size:
                yield _rows(tracks, frame, tracked)


def _rows(tracks: Tracks, frame: int, tracked: TrackedBag) -> dict[str, NDArray[Any]]:
    n = tracks.ids.size
    scale, region = tracked.pixels_per_metre, tracked.regions.get(tracks.tray)
    corner = {} if region is None else {'x': region.x, 'y': region.y}
    materials = np.array([species.material for species in tracked.trays[tracks.tray].species])
    rows = {
        'time': np.full(n, (tracks.stamp_ns - tracked.epoch_ns) / _NS),
        'frame': np.full(n, frame, dtype=np.int32),
        'tray': np.full(n, tracks.tray, dtype=np.int32),
        'id': tracks.ids,
        'species': materials[tracks.species],
        'x': tracks.positions[:, 0],
        'y': tracks.positions[:, 1],
        'position_error': tracks.position_errors,
        'vx': tracks.velocities[:, 0],
        'vy': tracks.velocities[:, 1],
        'velocity_error': tracks.velocity_errors,
        'radius': tracks.radii,
        'radius_error': tracks.radius_errors,
        'seen': tracks.seen.astype(np.int32),
    }
    in_px = {f'{name}_px': scale * rows[name] + corner.get(name, 0) for name in _LENGTHS}
    return rows | in_px


def _as_text(values: NDArray[Any]) -> list[str]:
    if values.dtype.kind != 'f':
        return [str(value) for value in values.tolist()]
    return ['' if value != value else f'{value:.{_DIGITS}g}' for value in values.tolist()]


def _provenance(tracked: TrackedBag) -> str:
    return json.dumps(
        {'version': __version__, 'trays': sorted(tracked.trays), 'epoch_ns': tracked.epoch_ns}
    )
