"""Tables as files with a description of their columns: units, meanings, words, and provenance.

A description follows Data Package and Table Schema (specs.frictionlessdata.io): that of a single
table ``tracks.csv`` stands beside it in ``tracks.csv.json``, that of the tables of a folder in its
``datapackage.json``. `unit` and `provenance` are additions, which these standards allow. Parquet
files hold units, meanings and provenance themselves.

Tested by ``test/outputs/tables/test_table_files.py``.
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.outputs.json_values import json_values
from nanorocks_ros.outputs.tables.csv_tables import rows_of, write_csv
from nanorocks_ros.outputs.tables.parquet import write_parquet
from nanorocks_ros.outputs.tables.table_columns import JOINED

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.outputs.tables.table_columns import Column

PACKAGE = 'datapackage.json'
"""Describes the tables of a folder."""

_TYPES = {
    'float64': 'number',
    'int64': 'integer',
    'int32': 'integer',
    'bool': 'boolean',
    'string': 'string',
}
_MEDIA = {'csv': 'text/csv', 'parquet': 'application/vnd.apache.parquet'}


def write_table(
    path: Path,
    columns: Sequence[Column],
    pieces: Iterable[Mapping[str, NDArray[Any]]],
    provenance: dict[str, Any],
    *,
    described: bool = True,
) -> None:
    """Write a table, piece by piece, and its description.

    Parameters
    ----------
    path : Path
        ``.csv`` or ``.parquet``; a file there is replaced, once the new one is complete.
    columns : sequence of Column
    pieces : iterable of mappings
        Columns by name; rows of one piece after those of the other.
    provenance : dict
        Values for JSON.
    described : bool
        Whether a CSV table gets a description of its own, and not that of its folder.

    Raises
    ------
    ConfigurationError
        When pyarrow, which writes Parquet, is not installed.
    RecordingError
        When a file cannot be written.
    """
    if path.suffix == '.parquet':
        write_parquet(path, columns, pieces, json.dumps(json_values(provenance), allow_nan=False))
        return
    write_csv(path, columns, rows_of(columns, pieces))
    if described:
        write_description(path, columns, provenance)


def write_rows(
    path: Path,
    columns: Sequence[Column],
    rows: Iterable[Sequence[object]],
    provenance: dict[str, Any],
) -> None:
    """Write a CSV table from its rows, and its description.

    Raises
    ------
    RecordingError
        When a file cannot be written, or a row has another length.
    """
    write_csv(path, columns, rows)
    write_description(path, columns, provenance)


def write_description(path: Path, columns: Sequence[Column], provenance: dict[str, Any]) -> None:
    """Describe a single table: a Data Resource beside it, under its name with ``.json`` added."""
    content = {**_resource(path.name, columns), 'provenance': provenance}
    _write(path.with_name(f'{path.name}.json'), content)


def write_package(
    folder: Path, tables: Mapping[str, Sequence[Column]], provenance: dict[str, Any]
) -> None:
    """Describe the tables of a folder: a Data Package.

    Parameters
    ----------
    folder : Path
    tables : mapping of str to sequence of Column
        Columns by the name of the file.
    provenance : dict
        Of the folder; values for JSON.

    Raises
    ------
    RecordingError
        When it cannot be written.
    """
    resources = [_resource(name, columns) for name, columns in tables.items()]
    _write(folder / PACKAGE, {'resources': resources, 'provenance': provenance})


def _write(path: Path, content: dict[str, Any]) -> None:
    text = json.dumps(json_values(content), indent=1, allow_nan=False)
    write_bytes(path, f'{text}\n'.encode())


def _resource(name: str, columns: Sequence[Column]) -> dict[str, Any]:
    stem, _, form = name.rpartition('.')
    csv_only = {'encoding': 'utf-8'} if form == 'csv' else {}
    return {
        'name': re.sub(r'[^a-z0-9._-]', '-', stem.lower()) or 'table',
        'path': name,
        'format': form,
        'mediatype': _MEDIA[form],
        **csv_only,
        'schema': {'fields': [_field(column) for column in columns], 'missingValues': ['']},
    }


def _field(column: Column) -> dict[str, Any]:
    field: dict[str, Any] = {'name': column.name, 'type': _TYPES[column.kind]}
    if column.unit:
        field['unit'] = column.unit
    if column.doc:
        field['description'] = column.doc
    if column.several:
        word = '|'.join(column.words)
        field['constraints'] = {'pattern': f'({word})({JOINED}({word}))*'}
    elif column.words:
        field['constraints'] = {'enum': list(column.words)}
    return field
