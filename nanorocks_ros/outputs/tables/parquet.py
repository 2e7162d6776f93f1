"""Tables as Parquet files, where pyarrow is installed.

Tested by ``test/studies/synthetic/test_trajectory.py``.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.outputs.atomic_files import atomic_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.outputs.tables.table_columns import Column

# Rows written together, at least, unless there are no more.
_GROUP_ROWS = 1 << 16


def check_parquet(path: Path) -> None:
    """Refuse a Parquet file where nothing can write it.

    Raises
    ------
    ConfigurationError
        When pyarrow is not installed.
    """
    if path.suffix == '.parquet':
        _pyarrow('pyarrow', path)


def write_parquet(
    path: Path,
    columns: Sequence[Column],
    pieces: Iterable[Mapping[str, NDArray[Any]]],
    provenance: str,
) -> None:
    """Write a table, piece by piece.

    Parameters
    ----------
    path : Path
        A file there is replaced, once the new one is complete.
    columns : sequence of Column
    pieces : iterable of mappings
        Columns by name; rows of one piece after those of the other.
    provenance : str
        Kept in the metadata of the file.

    Raises
    ------
    ConfigurationError
        When pyarrow is not installed.
    RecordingError
        When the file cannot be written.
    """
    arrow = _pyarrow('pyarrow', path)
    writer_of = _pyarrow('pyarrow.parquet', path).ParquetWriter
    text = arrow.dictionary(arrow.int32(), arrow.string())
    kinds = {
        'int32': arrow.int32(),
        'int64': arrow.int64(),
        'float64': arrow.float64(),
        'bool': arrow.bool_(),
        'string': text,
    }
    schema = arrow.schema(
        [
            arrow.field(
                column.name,
                kinds[column.kind],
                metadata={'unit': column.unit, 'description': column.doc},
            )
            for column in columns
        ],
        metadata={'provenance': provenance},
    )
    with atomic_file(path) as part, writer_of(part, schema, compression='zstd') as writer:
        for piece in _groups(columns, pieces):
            arrays = [_array(arrow, piece[column.name], kinds[column.kind]) for column in columns]
            writer.write_table(arrow.Table.from_arrays(arrays, schema=schema))


def read_parquet(path: Path) -> Any:
    """The table of a file, as of pyarrow.

    Raises
    ------
    ConfigurationError
        When pyarrow is not installed.
    OSError, ValueError
        When the file cannot be read.
    """
    return _pyarrow('pyarrow.parquet', path).read_table(path)


def read_parquet_schema(path: Path) -> Any:
    """The columns of a file and what is told of them, as of pyarrow; raises as `read_parquet`."""
    return _pyarrow('pyarrow.parquet', path).read_schema(path)


def _groups(
    columns: Sequence[Column], pieces: Iterable[Mapping[str, NDArray[Any]]]
) -> Iterator[dict[str, NDArray[Any]]]:
    """The pieces, joined until they are worth a group of rows: each group costs a kilobyte."""
    waiting: list[Mapping[str, NDArray[Any]]] = []
    rows = 0
    for piece in pieces:
        waiting.append(piece)
        rows += piece[columns[0].name].size
        if rows >= _GROUP_ROWS:
            yield _joined(columns, waiting)
            waiting, rows = [], 0
    if waiting:
        yield _joined(columns, waiting)


def _joined(
    columns: Sequence[Column], pieces: Sequence[Mapping[str, NDArray[Any]]]
) -> dict[str, NDArray[Any]]:
    return {
        column.name: np.concatenate([piece[column.name] for piece in pieces]) for column in columns
    }


def _array(arrow: Any, values: NDArray[Any], kind: Any) -> Any:
    if values.dtype.kind == 'U':
        return arrow.array(values).dictionary_encode()
    return arrow.array(values, type=kind)


def _pyarrow(name: str, path: Path) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise ConfigurationError(
            str(path),
            'needs pyarrow, which is not installed',
            "choose another ending, or run: pip install 'nanorocks_ros[parquet]'",
        ) from error
