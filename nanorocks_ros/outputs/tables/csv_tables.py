"""Tables as CSV files: one header row of plain names, then values; pandas, R and Excel read them.

What is not known is an empty cell, and so is a number that is not finite; truth values are
``true`` and ``false``. Units and meanings stand beside the table, as `table_files` says.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.limits import require_regular_file
from nanorocks_ros.outputs.atomic_files import atomic_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.outputs.tables.table_columns import Column

_TRUTH = {'true': 1.0, 'false': 0.0}


def write_csv(
    path: str | Path, columns: Sequence[Column], rows: Iterable[Sequence[object]]
) -> None:
    """Write a table, complete or not at all.

    Numbers are written so that reading gives the same number back.

    Parameters
    ----------
    path : str or Path
        An earlier table there is replaced.
    columns : sequence of Column, (n_columns,)
    rows : iterable of sequences, (n_columns,)

    Raises
    ------
    RecordingError
        When the file cannot be written, or a row has another length.
    """
    path = Path(path)
    with atomic_file(path) as part, part.open('w', encoding='utf-8', newline='') as stream:
        table = csv.writer(stream, lineterminator='\n')
        table.writerow([column.name for column in columns])
        for row in _checked(path, rows, len(columns)):
            table.writerow([_cell(value) for value in row])


def rows_of(
    columns: Sequence[Column], pieces: Iterable[Mapping[str, NDArray[Any]]]
) -> Iterator[tuple[object, ...]]:
    """The rows of a table from columns by name, piece after piece."""
    for piece in pieces:
        yield from zip(*(piece[column.name].tolist() for column in columns), strict=True)


def read_csv(path: Path) -> tuple[list[str], list[list[str]]]:
    """Read a table that `write_csv` wrote, or one like it.

    Earlier versions wrote a unit behind each name, ``time [s]``, or a line of units that begins
    with ``#`` before the header: both are left out.

    Parameters
    ----------
    path : Path

    Returns
    -------
    names : list of str, (n_fields,)
        Without units.
    rows : list of list of str
        Blank lines are left out. `number` reads a cell.

    Raises
    ------
    OSError
        When the file cannot be read.
    ValueError, csv.Error
        When it is empty, or is not text in UTF-8 separated by commas.
    RecordingError
        When it is no regular file.
    """
    names, *rows = csv_rows(path)
    return names, rows


def csv_rows(path: Path) -> Iterator[list[str]]:
    """The names, as of `read_csv`, then the rows of a table, one by one; same errors."""
    require_regular_file(path, RecordingError)
    # Spreadsheets write a mark at the beginning.
    with path.open(encoding='utf-8-sig', newline='') as stream:
        rows = (row for row in csv.reader(stream) if row)
        header = next((row for row in rows if not row[0].startswith('#')), None)
        if header is not None:
            yield [name.split('[')[0].strip() for name in header]
        yield from rows


def number(cell: str) -> float:
    """The number in a cell: NaN where it is empty, 1 and 0 for true and false.

    Raises
    ------
    ValueError
        When it is none.
    """
    text = cell.strip()
    if not text:
        return math.nan
    truth = _TRUTH.get(text.lower())
    return float(text) if truth is None else truth


def _cell(value: object) -> object:
    if value is None:
        return ''
    if isinstance(value, bool | np.bool_):
        return 'true' if value else 'false'
    if isinstance(value, float | np.floating):
        if not math.isfinite(value):
            return ''
        # The writer takes `repr` of a double, in which NumPy names the type.
        return float(value) if isinstance(value, float) else value
    return value


def _checked(
    path: Path, rows: Iterable[Sequence[object]], expected: int
) -> Iterator[Sequence[object]]:
    for number, row in enumerate(rows, start=1):
        if len(row) != expected:
            raise RecordingError(
                str(path),
                f'row {number} has {len(row)} values for {expected} fields',
                'give one value for each field',
            )
        yield row
