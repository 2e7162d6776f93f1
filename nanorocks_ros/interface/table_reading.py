"""Tables that the program wrote, as pandas DataFrames: CSV and Parquet, with their units.

Tested by ``test/interface/test_reading.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.limits import require_regular_file
from nanorocks_ros.outputs.json_values import parse_object, read_object
from nanorocks_ros.outputs.tables.parquet import read_parquet, read_parquet_schema
from nanorocks_ros.outputs.tables.table_files import PACKAGE

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

TABLES = '.csv', '.parquet'
"""Endings of the files that are read."""

# By the types of Table Schema; whole numbers get that of pandas which allows for empty cells.
_TYPES = {'number': 'float64', 'integer': 'Int64', 'boolean': 'boolean', 'string': 'object'}


def read_frame(path: Path) -> pd.DataFrame:
    """Read a table.

    Parameters
    ----------
    path : Path
        ``.csv``, or ``.parquet``, which needs pyarrow.

    Returns
    -------
    DataFrame
        With ``attrs['units']`` and ``attrs['provenance']`` where a description of the table
        stands beside it; missing cells are NaN, or NA of whole numbers.

    Raises
    ------
    RecordingError
        When it cannot be read.
    ConfigurationError
        When it is Parquet, and pyarrow is not installed.
    """
    require_regular_file(path, RecordingError)
    try:
        return _of_parquet(path) if path.suffix == '.parquet' else _of_csv(path)
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise RecordingError(
            str(path), f'cannot be read ({error})', 'write it again, or read it with pandas'
        ) from error


def run_of(path: Path) -> dict[str, Any]:
    """What is said of the run that made a table: versions, command, date; empty where nothing is.

    Raises
    ------
    RecordingError
        When the description cannot be read.
    """
    try:
        if path.suffix == '.parquet':
            told = _text(read_parquet_schema(path).metadata, b'provenance')
            return parse_object(told) if told else {}
        return _description(path)[1]
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise RecordingError(
            str(path), f'has a damaged description ({error})', 'read it with pandas'
        ) from error


def described_tables(folder: Path) -> list[Path]:
    """The tables of a folder that has a description of them; none where it has none.

    Raises
    ------
    RecordingError
        When the description is damaged.
    """
    path = folder / PACKAGE
    if not path.is_file():
        return []
    try:
        names = [str(resource['path']) for resource in read_object(path)['resources']]
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise RecordingError(
            str(path), 'is no description of tables', 'name a table itself'
        ) from error
    # Names alone: a description cannot name files elsewhere.
    return [folder / name for name in names if name == (folder / name).name]


def _of_csv(path: Path) -> pd.DataFrame:
    resource, provenance = _description(path)
    fields = resource['schema']['fields'] if resource else []
    types = {field['name']: _TYPES[field['type']] for field in fields}
    frame = pd.read_csv(path, dtype=types, keep_default_na=False, na_values=[''])
    for name, kind in types.items():
        if kind in ('Int64', 'boolean') and not frame[name].isna().any():
            frame[name] = frame[name].astype(kind.lower() if kind == 'Int64' else 'bool')
    frame.attrs['units'] = {field['name']: field.get('unit', '') for field in fields}
    frame.attrs['provenance'] = provenance
    return frame


def _description(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """What is said of a table, and of the run that made it; empty where nothing is said."""
    own = path.with_name(f'{path.name}.json')
    if own.is_file():
        content = read_object(own)
        return content, dict(content['provenance'])
    package = path.with_name(PACKAGE)
    if package.is_file():
        content = read_object(package)
        for resource in content['resources']:
            if resource['path'] == path.name:
                return resource, dict(content['provenance'])
    return {}, {}


def _of_parquet(path: Path) -> pd.DataFrame:
    table = read_parquet(path)
    frame: pd.DataFrame = table.to_pandas()
    for name in frame.columns[frame.dtypes == 'category']:
        frame[name] = frame[name].astype(object)
    frame.attrs['units'] = {field.name: _text(field.metadata, b'unit') for field in table.schema}
    told = _text(table.schema.metadata, b'provenance')
    frame.attrs['provenance'] = parse_object(told) if told else {}
    return frame


def _text(metadata: Mapping[bytes, bytes] | None, name: bytes) -> str:
    return (metadata or {}).get(name, b'').decode()
