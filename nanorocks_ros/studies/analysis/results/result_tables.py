"""Tables that `nanorocks analyse` wrote, read back by the names of their columns.

Tested by ``test/studies/analysis/test_long_term.py``.
"""

from __future__ import annotations

import csv
import shlex
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.tables.csv_tables import csv_rows
from nanorocks_ros.studies.results.record_columns import number_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

_FORM = 'name the folder of results of `nanorocks analyse`'


def trays_of(folder: Path, table: str) -> tuple[int, ...]:
    """Numbers of the trays of which a folder of results holds a table, such as ``cluster``.

    Raises
    ------
    RecordingError
        When it is no folder, or holds none.
    """
    if not folder.is_dir():
        raise RecordingError(str(folder), 'is no folder', _FORM)
    names = (path.stem.split('_') for path in folder.glob(f'tray_*_{table}.csv'))
    trays = tuple(sorted(int(name[1]) for name in names if len(name) == 3 and name[1].isdigit()))
    if not trays:
        # As by `nanorocks measure`, whose decays have a folder each.
        below = min((path.parent for path in folder.rglob(f'tray_*_{table}.csv')), default=None)
        raise RecordingError(
            str(folder),
            f'holds no tray_K_{table}.csv',
            _FORM if below is None else f'name {shlex.quote(str(below))}',
        )
    return trays


def read_columns(
    path: Path, wanted: Sequence[str], optional: Sequence[str] = ()
) -> dict[str, NDArray[np.float64]]:
    """Columns of a table as numbers; those that are optional only where they are there.

    Words such as those of `status` become the numbers that stand for them.

    Raises
    ------
    RecordingError
        When the table cannot be read, or a column that is wanted is missing.
    """
    try:
        lines = csv_rows(path)
        names = next(lines, [])
        missing = [name for name in wanted if name not in names]
        if missing:
            raise RecordingError(str(path), f'has no column {", ".join(missing)}', _FORM)
        kept = [k for k, name in enumerate(names) if name in {*wanted, *optional}]
        # Line by line: the text of an hour takes ten times the memory of its numbers.
        values = [[number_of(names[k], line[k]) for k in kept] for line in lines]
    except OSError as error:
        raise RecordingError(
            str(path), f'cannot be read ({error.strerror})', 'name another folder'
        ) from error
    except (ValueError, IndexError, csv.Error) as error:
        raise RecordingError(str(path), 'is no table of numbers', _FORM) from error
    columns = np.array(values, dtype=np.float64).reshape(len(values), len(kept)).T
    return {names[k]: column for k, column in zip(kept, columns, strict=True)}
