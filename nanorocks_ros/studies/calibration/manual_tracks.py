"""Tracks that people made by hand, in the formats of the programs they use."""

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
# Names of columns, in lower case, of the programs that people use.
_FRAME = 'frame', 'frame number', 'frame_number', 'frame no', 'slice', 't', 'image'
_TRACK = 'id', 'track_id', 'track id', 'track', 'particle', 'object', 'target', 'trajectory'
_COLUMN = 'x', 'position_x', 'x_px', 'x (px)', 'x (pixel)', 'x(px)', 'x [px]', 'xpos', 'column'
_ROW = 'y', 'position_y', 'y_px', 'y (px)', 'y (pixel)', 'y(px)', 'y [px]', 'ypos', 'row'
_PIXELS = '', 'pixel', 'pixels', 'px'


@dataclass(frozen=True, slots=True)
class ManualTracks:
    """Places of beads in pictures, marked by a person.

    Parameters
    ----------
    frames : ndarray of int64, (n,)
        Pictures, as the file counts them.
    ids : ndarray of int64, (n,)
        Beads.
    places : ndarray (n, 2), [px]
        Column and row, as the file gives them.
    """

    frames: NDArray[np.int64]
    ids: NDArray[np.int64]
    places: NDArray[np.float64]


def read_manual_tracks(path: str | Path) -> ManualTracks:
    """Read tracks that were made by hand; the format is found from the content.

    Parameters
    ----------
    path : str or Path
        TrackMate CSV (spots table) or XML (whole model, or exported tracks), plain CSV with
        columns for frame, bead and place, or the text of NASA Spotlight: numbers in columns,
        frame first, then column and row of each bead.

    Raises
    ------
    RecordingError
        When the file cannot be read; names the line at fault.
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
    again = np.flatnonzero((np.diff(frames) == 0) & (np.diff(ids) == 0))
    if again.size:
        raise RecordingError(
            str(path),
            f'bead {ids[again[0]]} is twice in frame {frames[again[0]]}',
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
            return [one.strip() for one in next(csv.reader([line], delimiter=mark))]
    return line.split()


def _columns(names: Sequence[str]) -> tuple[int, int | None, int, int] | None:
    """Which columns hold frame, bead, column and row; None when these are no such names."""
    known = [name.lower() for name in names]

    def place(wanted: Sequence[str]) -> int | None:
        return next((known.index(one) for one in wanted if one in known), None)

    frame, track, column, row = (place(one) for one in (_FRAME, _TRACK, _COLUMN, _ROW))
    if frame is None or column is None or row is None:
        return None
    # TrackMate numbers the spots in ID, and the beads in TRACK_ID.
    if 'track_id' in known:
        track = known.index('track_id')
    return frame, track, column, row


def _named_rows(
    lines: Sequence[tuple[int, str]], columns: tuple[int, int | None, int, int], where: str
) -> Iterable[_Row]:
    frame, track, column, row = columns
    started = False
    for number, line in lines:
        cells = _cells(line)
        try:
            # A spot of TrackMate that belongs to no track has no number.
            bead = 0.0 if track is None else float(cells[track] or 'nan')
            found = float(cells[frame]), bead, float(cells[column]), float(cells[row])
        except (ValueError, IndexError) as error:
            # Below its names TrackMate repeats them for people, and gives units.
            if not started:
                _refuse_units(cells, (column, row), where, number)
                continue
            raise RecordingError(
                f'{where}:{number}', f'{line[:60]!r} is no row', _REMEDY
            ) from error
        started = True
        if not math.isnan(bead):
            yield _checked(found, where, number)


def _refuse_units(cells: Sequence[str], columns: tuple[int, int], where: str, number: int) -> None:
    for place in columns:
        unit = re.fullmatch(r'\((.*)\)', cells[place]) if place < len(cells) else None
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
            yield _checked((values[0], float(bead), x, y), where, number)


def _checked(row: _Row, where: str, number: int) -> _Row:
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
            _refuse_unit(root.get('spaceUnits', ''), where)
            return [
                _checked(
                    (
                        float(one.attrib['t']),
                        float(bead),
                        float(one.attrib['x']),
                        float(one.attrib['y']),
                    ),
                    where,
                    1,
                )
                for bead, particle in enumerate(root.iter('particle'))
                for one in particle.iter('detection')
            ]
    except (KeyError, ValueError) as error:
        raise RecordingError(
            where, f'lacks or garbles {error}', 'export the tracks again'
        ) from error
    raise RecordingError(where, f'<{root.tag}> is not of TrackMate', _REMEDY)


def _model_rows(root: ElementTree.Element, where: str) -> Iterable[_Row]:
    model = root.find('Model')
    _refuse_unit('' if model is None else model.get('spatialunits', ''), where)
    spots = {
        one.attrib['ID']: (
            float(one.attrib['FRAME']),
            float(one.attrib['POSITION_X']),
            float(one.attrib['POSITION_Y']),
        )
        for one in root.iter('Spot')
    }
    for track in root.iter('Track'):
        number = float(track.attrib['TRACK_ID'])
        ends = {edge.attrib[name] for edge in track.iter('Edge') for name in _EDGE}
        for spot in ends:
            frame, x, y = spots[spot]
            yield _checked((frame, number, x, y), where, 1)


_EDGE = 'SPOT_SOURCE_ID', 'SPOT_TARGET_ID'


def _refuse_unit(unit: str, where: str) -> None:
    if unit.lower() not in _PIXELS:
        raise RecordingError(
            where,
            f'places are in {unit}, not in pixels',
            'remove the calibration of the images in Fiji (Image > Properties), export again',
        )
