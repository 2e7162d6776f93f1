"""Files of manual tracks, in the formats of several programs."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from nanorocks_ros.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

_REMEDY = (
    'give a CSV file with the columns frame, id, x, y, a TrackMate CSV or XML file, or a text '
    'file of NASA Spotlight'
)
# Names of columns in several programs, in lower case.
_FRAME = 'frame', 'frame number', 'frame_number', 'frame no', 'slice', 't', 'image'
_TRACK = 'id', 'track_id', 'track id', 'track', 'particle', 'object', 'target', 'trajectory'
_COLUMN = 'x', 'position_x', 'x_px', 'x (px)', 'x (pixel)', 'x(px)', 'x [px]', 'xpos', 'column'
_ROW = 'y', 'position_y', 'y_px', 'y (px)', 'y (pixel)', 'y(px)', 'y [px]', 'ypos', 'row'
_PIXELS = '', 'pixel', 'pixels', 'px'


@dataclass(frozen=True, slots=True)
class ManualTracks:
    """Manually marked positions of beads in images.

    Parameters
    ----------
    frames : ndarray of int64, (n,)
        Frame numbers of the file.
    ids : ndarray of int64, (n,)
        Bead of each position.
    places : ndarray (n, 2), [px]
        Column and row.
    """

    frames: NDArray[np.int64]
    ids: NDArray[np.int64]
    places: NDArray[np.float64]


def read_manual_tracks(path: str | Path) -> ManualTracks:
    """Read manual tracks; the format is detected from the content.

    Parameters
    ----------
    path : str or Path
        TrackMate CSV (spots table) or XML (whole model, or exported tracks), plain CSV with
        columns for frame, bead and position, or the text of NASA Spotlight: numbers in columns,
        frame first, then column and row of each bead.

    Raises
    ------
    RecordingError
        When the file cannot be read; names the line with the error.
    """
    try:
        text = Path(path).read_text(encoding='utf-8-sig')
    except UnicodeDecodeError as error:
        raise RecordingError(str(path), 'is not UTF-8 text', _REMEDY) from error
    except OSError as error:
        raise RecordingError(str(path), error.strerror or 'cannot be read', _REMEDY) from error
    if text.lstrip().startswith('<'):
        rows = list(_xml_rows(text, str(path)))
    else:
        rows = list(_table_rows(text, str(path)))
    if not rows:
        raise RecordingError(str(path), 'holds no track', _REMEDY)
    table = np.array(rows, dtype=np.float64)
    order = np.lexsort((table[:, 0], table[:, 1]))
    frames, ids = table[order, 0].astype(np.int64), table[order, 1].astype(np.int64)
    duplicates = np.flatnonzero((np.diff(frames) == 0) & (np.diff(ids) == 0))
    if duplicates.size:
        raise RecordingError(
            str(path),
            f'bead {ids[duplicates[0]]} is twice in frame {frames[duplicates[0]]}',
            'give each bead a number of its own',
        )
    return ManualTracks(frames, ids, table[order, 2:])


_Row = tuple[float, float, float, float]


def _table_rows(text: str, where: str) -> Iterable[_Row]:
    lines = [(n, line) for n, line in enumerate(text.splitlines(), start=1) if line.strip()]
    lines = [(n, line) for n, line in lines if not line.lstrip().startswith(('#', '%', '//'))]
    header = next((k for k, (_, line) in enumerate(lines) if _columns(_cells(line))), None)
    if header is not None:
        columns = _columns(_cells(lines[header][1]))
        assert columns is not None
        return _named_rows(lines[header + 1 :], columns, where)
    return _number_rows(lines, where)


def _cells(line: str) -> list[str]:
    """Cells of a line, between commas, semicolons or tabs, else between blanks."""
    for mark in ',;\t':
        if mark in line:
            return [cell.strip() for cell in next(csv.reader([line], delimiter=mark))]
    return line.split()


def _columns(names: Sequence[str]) -> tuple[int, int | None, int, int] | None:
    """Indices of the columns for frame, bead, column and row; None without such names."""
    lower_names = [name.lower() for name in names]

    def index_of(wanted: Sequence[str]) -> int | None:
        return next((lower_names.index(name) for name in wanted if name in lower_names), None)

    frame, track, column, row = (index_of(name) for name in (_FRAME, _TRACK, _COLUMN, _ROW))
    if frame is None or column is None or row is None:
        return None
    # TrackMate has the number of the spot in ID, that of the bead in TRACK_ID.
    if 'track_id' in lower_names:
        track = lower_names.index('track_id')
    return frame, track, column, row


def _named_rows(
    lines: Sequence[tuple[int, str]], columns: tuple[int, int | None, int, int], where: str
) -> Iterable[_Row]:
    frame, track, column, row = columns
    started = False
    for number, line in lines:
        cells = _cells(line)
        try:
            # A spot of TrackMate without a track has no number.
            bead = 0.0 if track is None else float(cells[track] or 'nan')
            values = float(cells[frame]), bead, float(cells[column]), float(cells[row])
        except (ValueError, IndexError) as error:
            # TrackMate has further header lines with long names and units.
            if not started:
                _check_units(cells, (column, row), where, number)
                continue
            raise RecordingError(
                f'{where}:{number}', f'{line[:60]!r} is no row', _REMEDY
            ) from error
        started = True
        if not math.isnan(bead):
            yield _checked_row(values, where, number)


def _check_units(cells: Sequence[str], columns: tuple[int, int], where: str, number: int) -> None:
    for column in columns:
        unit = re.fullmatch(r'\((.*)\)', cells[column]) if column < len(cells) else None
        if unit and unit.group(1).lower() not in _PIXELS:
            raise RecordingError(
                f'{where}:{number}',
                f'places are in {unit.group(1)}, not in pixels',
                'remove the calibration of the images in Fiji (Image > Properties), export again',
            )


def _number_rows(lines: Sequence[tuple[int, str]], where: str) -> Iterable[_Row]:
    """Rows without names: the frame, then column and row of one bead after another."""
    started = False
    for number, line in lines:
        try:
            values = [float(cell) for cell in _cells(line) if cell]
        except ValueError as error:
            if not started:
                continue
            raise RecordingError(
                f'{where}:{number}', f'{line[:60]!r} is no row', _REMEDY
            ) from error
        if len(values) < 3 or len(values) % 2 == 0:
            raise RecordingError(
                f'{where}:{number}',
                f'{len(values)} numbers; expected a frame, and column and row of each bead',
                _REMEDY,
            )
        started = True
        for bead in range(len(values) // 2):
            x, y = values[1 + 2 * bead], values[2 + 2 * bead]
            yield _checked_row((values[0], float(bead), x, y), where, number)


def _checked_row(row: _Row, where: str, number: int) -> _Row:
    whole = row[0].is_integer() and row[1].is_integer()
    if not whole or not (math.isfinite(row[2]) and math.isfinite(row[3])):
        raise RecordingError(
            f'{where}:{number}',
            f'frame {row[0]:g}, bead {row[1]:g} at {row[2]:g}, {row[3]:g}',
            'give whole numbers of frames and beads, and places in pixels',
        )
    return row


def _xml_rows(text: str, where: str) -> Iterable[_Row]:
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        line = error.position[0]
        raise RecordingError(f'{where}:{line}', 'not XML', 'export the tracks again') from error
    try:
        if root.tag == 'TrackMate':
            return list(_model_rows(root, where))
        if root.tag == 'Tracks':
            _check_unit(root.get('spaceUnits', ''), where)
            return [
                _checked_row(
                    (
                        float(detection.attrib['t']),
                        float(bead),
                        float(detection.attrib['x']),
                        float(detection.attrib['y']),
                    ),
                    where,
                    1,
                )
                for bead, particle in enumerate(root.iter('particle'))
                for detection in particle.iter('detection')
            ]
    except (KeyError, ValueError) as error:
        raise RecordingError(
            where, f'lacks or garbles {error}', 'export the tracks again'
        ) from error
    raise RecordingError(where, f'<{root.tag}> is not of TrackMate', _REMEDY)


def _model_rows(root: ElementTree.Element, where: str) -> Iterable[_Row]:
    model = root.find('Model')
    _check_unit('' if model is None else model.get('spatialunits', ''), where)
    spots = {
        spot.attrib['ID']: (
            float(spot.attrib['FRAME']),
            float(spot.attrib['POSITION_X']),
            float(spot.attrib['POSITION_Y']),
        )
        for spot in root.iter('Spot')
    }
    for track in root.iter('Track'):
        number = float(track.attrib['TRACK_ID'])
        ends = {edge.attrib[name] for edge in track.iter('Edge') for name in _EDGE}
        for spot in ends:
            frame, x, y = spots[spot]
            yield _checked_row((frame, number, x, y), where, 1)


_EDGE = 'SPOT_SOURCE_ID', 'SPOT_TARGET_ID'


def _check_unit(unit: str, where: str) -> None:
    if unit.lower() not in _PIXELS:
        raise RecordingError(
            where,
            f'places are in {unit}, not in pixels',
            'remove the calibration of the images in Fiji (Image > Properties), export again',
        )
