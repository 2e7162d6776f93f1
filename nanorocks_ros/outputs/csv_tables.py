"""Tables as CSV files: names with units in the header, then numbers."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.limits import require_regular_file
from nanorocks_ros.outputs.atomic_files import atomic_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence


def write_csv(
    path: str | Path,
    fields: Sequence[str],
    units: Sequence[str],
    rows: Iterable[Sequence[object]],
) -> None:
    """Write a table, complete or not at all.

    The header reads ``time [s],mean_projected_speed [m/s]``. Numbers are written so that
    reading gives the same number back; NaN, not known, is written ``nan``.

    Parameters
    ----------
    path : str or Path
        An earlier table there is replaced.
    fields, units : sequence of str, (n_fields,)
    rows : iterable of sequences, (n_fields,)

    Raises
    ------
    RecordingError
        When the file cannot be written, or a row has another length.
    """
    path = Path(path)
    header = [f'{field} [{unit}]' for field, unit in zip(fields, units, strict=True)]
    with atomic_file(path) as part, part.open('w', encoding='utf-8', newline='') as stream:
        table = csv.writer(stream, lineterminator='\n')
        table.writerow(header)
        table.writerows(_checked(path, rows, len(fields)))


def read_csv(path: Path) -> tuple[list[str], list[list[str]]]:
    """Read a table that `write_csv` wrote, or one like it.

    Parameters
    ----------
    path : Path

    Returns
    -------
    names : list of str, (n_fields,)
        Without units.
    rows : list of list of str
        Blank lines are left out.

    Raises
    ------
    OSError
        When the file cannot be read.
    ValueError, csv.Error
        When it is empty, or is not text in UTF-8 separated by commas.
    RecordingError
        When it is no regular file.
    """
    require_regular_file(path, RecordingError)
    with path.open(encoding='utf-8', newline='') as stream:
        header, *rows = [row for row in csv.reader(stream) if row]
    return [name.split('[')[0].strip() for name in header], rows


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
