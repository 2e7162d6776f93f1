"""Read the columns of what a command wrote: JSON, CSV, NPZ and bags, by their public formats.

A column is a one-dimensional array of float64 or int64, or a list of words. NaN is "not known",
as is ``null`` in JSON.
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
from collections import Counter
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

Column: TypeAlias = 'np.ndarray | list[str]'
Summary: TypeAlias = dict[str, Any]

# Keys and arrays that hold no result: times of the processor, versions, settings, file names, and
# sentences for people.
_NO_RESULT = frozenset(
    ('bag', 'cpu_seconds', 'files', 'notices', 'output', 'provenance', 'question', 'settings')
) | {'version'}
_ARRAY = 'std_msgs/msg/Float32MultiArray'
# Columns of words with at most so many different words list them.
_MOST_WORDS = 8
_DIGITS = 10


def read_outputs(folder: Path) -> dict[str, dict[str, Column]]:
    """The columns of every file and bag below a folder.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    dict
        File relative to `folder`, of bags with the topic -> name of the column -> column.
    """
    outputs: dict[str, dict[str, Column]] = {}
    for path in _result_files(folder):
        name = path.relative_to(folder).as_posix()
        if path.is_dir():
            outputs |= {f'{name} {topic}': table for topic, table in _bag_columns(path).items()}
        else:
            outputs[name] = _file_columns(path)
    return outputs


def _file_columns(path: Path) -> dict[str, Column]:
    if path.suffix == '.csv':
        return _csv_columns(path)
    if path.suffix == '.npz':
        return _npz_columns(path)
    return _json_columns(json.loads(path.read_text(encoding='utf-8')))


def summarise(column: Column) -> Summary:
    """Number of rows, digest of the exact values, and statistics that tell the size of a change.

    Returns
    -------
    dict
        ``rows`` and ``digest``; of numbers ``nan`` if some are, ``mean``, ``min`` and ``max`` of
        those that are finite; of words ``words``, how often each occurs, if they are few.
    """
    if isinstance(column, list):
        summary: Summary = {'rows': len(column), 'digest': digest_of(column)}
        counts = Counter(column)
        if len(counts) <= _MOST_WORDS:
            summary['words'] = dict(sorted(counts.items()))
        return summary
    summary = {'rows': len(column)}
    if missing := int(np.isnan(column).sum()):
        summary['nan'] = missing
    summary['digest'] = digest_of(column)
    finite = column[np.isfinite(column)]
    if len(finite):
        summary['mean'] = math.fsum(finite.tolist()) / len(finite)
        summary['min'], summary['max'] = finite.min().item(), finite.max().item()
    return summary


def digest_of(column: Column) -> str:
    """First digits of the SHA-256 of the exact values.

    Numbers enter as little-endian 64-bit values with one NaN, words as lines of UTF-8.
    """
    if isinstance(column, list):
        content = '\n'.join(column).encode()
    elif column.dtype.kind == 'i':
        content = column.astype('<i8').tobytes()
    else:
        content = np.where(np.isnan(column), np.nan, column).astype('<f8').tobytes()
    return _digest(content)


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:_DIGITS]


def _result_files(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.iterdir()):
        if path.is_dir() and not (path / 'metadata.yaml').exists():
            yield from _result_files(path)
        elif path.is_dir() or path.suffix in {'.csv', '.npz', '.json'}:
            yield path


def _column(values: Iterable[Any]) -> Column:
    """An array if all values are numbers or not known, words otherwise."""
    values = list(values)
    if any(isinstance(value, (bool, str)) for value in values):
        return [str(value) for value in values]
    return np.array([math.nan if value is None else value for value in values], dtype=float)


def _csv_columns(path: Path) -> dict[str, Column]:
    with path.open(encoding='utf-8', newline='') as file:
        names, *rows = csv.reader(file)
    columns: dict[str, Column] = {}
    for index, name in enumerate(names):
        cells = [row[index] for row in rows]
        try:
            # An empty cell is a number that is not known.
            columns[name] = np.array([float(cell or 'nan') for cell in cells])
        except ValueError:
            columns[name] = cells
    return columns


def _npz_columns(path: Path) -> dict[str, Column]:
    columns: dict[str, Column] = {}
    with np.load(path, allow_pickle=False) as arrays:
        for name in arrays.files:
            if name in _NO_RESULT:
                continue
            array = arrays[name]
            title = f'{name} {list(array.shape)}'
            if array.dtype.kind == 'U':
                columns[title] = array.ravel().tolist()
            else:
                columns[title] = array.ravel().astype('i8' if array.dtype.kind in 'iu' else 'f8')
    return columns


def _json_columns(document: Any) -> dict[str, Column]:
    leaves: dict[str, list[Any]] = {}
    _gather(document, '', leaves)
    return {name: _column(values) for name, values in leaves.items()}


def _gather(value: Any, path: str, leaves: dict[str, list[Any]]) -> None:
    """Append the leaves of a document to the column of their path.

    A list adds ``[]`` to the path. Lists in lists give their lengths as well, as ``[] length``.
    """
    if isinstance(value, dict):
        for key, child in value.items():
            if key not in _NO_RESULT:
                _gather(child, f'{path}.{key}' if path else key, leaves)
    elif isinstance(value, list):
        if path.endswith('[]') or not value:
            leaves.setdefault(f'{path} length', []).append(len(value))
        for child in value:
            _gather(child, f'{path}[]', leaves)
    else:
        leaves.setdefault(path, []).append(value)


def _bag_columns(path: Path) -> dict[str, dict[str, Column]]:
    """Topic -> elements of its messages, and their instants.

    Of messages that are no arrays: their sizes and the digests of their bytes.
    """
    topics: dict[str, dict[str, Column]] = {}
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection in sorted(reader.connections, key=lambda row: row.topic):
            stamps, contents = [], []
            for _, stamp_ns, content in reader.messages([connection]):
                stamps.append(stamp_ns)
                contents.append(content)
            columns: dict[str, Column] = {'stamp [ns]': np.array(stamps, dtype='i8')}
            if connection.msgtype == _ARRAY:
                columns |= _elements([reader.deserialize(message, _ARRAY) for message in contents])
            else:
                columns['size [bytes]'] = np.array(list(map(len, contents)), dtype='i8')
                columns['content'] = [_digest(content) for content in contents]
            topics[connection.topic] = columns
    return topics


def _elements(messages: list[Any]) -> Mapping[str, Column]:
    """Elements of array messages; those of a table of beads, tracks, ... as ``ROW.ELEMENT``."""
    columns: dict[str, list[float]] = {}
    for message in messages:
        first, *table = message.layout.dim
        data = message.data.astype(float)
        for name, value in zip(first.label.split(','), data, strict=False):
            columns.setdefault(name, []).append(value)
        if table:
            rows, names = table
            columns.setdefault(f'{rows.label} length', []).append(rows.size)
            cells = data[first.size :].reshape(rows.size, names.size)
            for index, name in enumerate(names.label.split(',')):
                columns.setdefault(f'{rows.label}.{name}', []).extend(cells[:, index].tolist())
    return {name: np.array(values) for name, values in columns.items()}
