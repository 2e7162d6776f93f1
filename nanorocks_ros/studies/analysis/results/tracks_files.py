"""Tracks as tables: CSV, or Parquet where pyarrow is installed.

Tested by ``test/studies/analysis/test_bag_tracks.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.experiment.trays import tray_values
from nanorocks_ros.outputs.tables.table_columns import Column
from nanorocks_ros.outputs.tables.table_files import write_table
from nanorocks_ros.studies.results.run_provenance import run_provenance

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks
    from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag

TABLES = '.csv', '.parquet'
"""Endings of the files below."""

COLUMNS = (
    Column(name='time', kind='float64', unit='s', doc='since epoch'),
    Column(name='frame', kind='int32', unit='1', doc='number of the frame, from 0'),
    Column(name='tray', kind='int32', unit='1', doc='number of the tray'),
    Column(name='id', kind='int32', unit='1', doc='number of the track'),
    Column(name='species', kind='string', doc='material of the bead'),
    Column(name='x', unit='m', doc='of the centre, along columns from the corner of the floor'),
    Column(name='y', unit='m', doc='along rows'),
    Column(
        name='position_error',
        unit='m',
        doc='one standard error of each, about a shift that all beads of a species share',
    ),
    Column(name='vx', unit='m/s', doc='past the camera, along columns'),
    Column(name='vy', unit='m/s', doc='along rows'),
    Column(name='velocity_error', unit='m/s', doc='one standard error of each'),
    Column(name='radius', unit='m', doc='of the bead'),
    Column(name='radius_error', unit='m', doc='one standard error'),
    Column(name='seen', kind='bool', doc='false where the bead is hidden and predicted'),
)
"""Columns of the table, a row for each bead in each frame."""

_LENGTHS = 'x', 'y', 'position_error', 'vx', 'vy', 'velocity_error', 'radius', 'radius_error'
_PX_COLUMNS = tuple(
    Column(
        name=f'{column.name}_px', kind='float64', unit=(column.unit or 'm').replace('m', 'px', 1)
    )
    for column in COLUMNS
    if column.name in _LENGTHS
)

# Digits of a number in CSV, except times: nanometres of a tray, and less than any error.
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


def write_tracks(path: Path, tracked: TrackedBag, *, described: bool = True) -> None:
    """Write the tracks of every tray, frame by frame.

    Parameters
    ----------
    path : Path
        ``.csv`` or ``.parquet``; a file there is replaced, once the new one is complete.
    tracked : TrackedBag
    described : bool
        Whether a CSV table gets a description of its own, and not that of its folder.

    Raises
    ------
    ConfigurationError
        When pyarrow, which writes Parquet, is not installed.
    RecordingError
        When the file cannot be written.
    """
    pieces = track_pieces(tracked)
    if path.suffix == '.csv':
        pieces = (_rounded(piece) for piece in pieces)
    columns = columns_of(tracked)
    write_table(path, columns, pieces, _provenance(tracked), described=described)


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
        'seen': tracks.seen,
    }
    in_px = {f'{name}_px': scale * rows[name] + corner.get(name, 0) for name in _LENGTHS}
    return rows | in_px


def _rounded(piece: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    return {
        name: np.array([float(f'{value:.{_DIGITS}g}') for value in values.tolist()])
        if values.dtype.kind == 'f' and name != 'time'
        else values
        for name, values in piece.items()
    }


def _provenance(tracked: TrackedBag) -> dict[str, Any]:
    return {
        **run_provenance(),
        'epoch_ns': tracked.epoch_ns,
        'pixels_per_metre': tracked.pixels_per_metre,
        'trays': {number: tray_values(tray) for number, tray in tracked.trays.items()},
    }
