"""The rows of a damaged SQLite file, one by one, as far as they can be read."""

from __future__ import annotations

import sqlite3
from array import array
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

# Of a row in which types are not those that were written, nothing tells what it was.
FIT = (
    "typeof(timestamp) = 'integer' AND timestamp >= 0 "
    "AND typeof(topic_id) = 'integer' AND typeof(data) = 'blob'"
)
_ROWS = f'SELECT timestamp, id, topic_id FROM messages WHERE id BETWEEN ? AND ? AND {FIT}'
# All of a row, so that one that lost its end is not taken for whole.
_WHOLE = f"{_ROWS} AND length(data || x'') >= 0"
_NEXT = 'SELECT id FROM messages WHERE id > ? ORDER BY id LIMIT 1'
_LAST = 'SELECT max(id) FROM messages'
# Rows that are asked for together, and how often there may be none where nobody knows the last.
_BATCH, _MISSES = 256, 8
# A row takes this many bytes at least: a number beyond what the file has room for is damaged.
_SHORTEST = 8


def readable_rows(database: sqlite3.Connection, size: int, *, whole: bool) -> NDArray[np.int64]:
    """Find the rows that can be read.

    Parameters
    ----------
    database : sqlite3.Connection
    size : int, [bytes]
        Of the file.
    whole : bool
        Only those whose content can be read, too; it is gone through for that.

    Returns
    -------
    ndarray of int64, (n_rows, 3)
        Log time in ns, number and topic of each, in order of time.
    """
    found = array('q')
    for row in _found(database, size, _WHOLE if whole else _ROWS):
        found.extend(row)
    rows = np.array(found, dtype=np.int64).reshape(-1, 3)
    return rows[np.lexsort((rows[:, 1], rows[:, 0]))]


def _found(database: sqlite3.Connection, size: int, query: str) -> Iterator[tuple[int, int, int]]:
    last = _last(database, size)
    start, misses = 1, 0
    while start <= last if last else misses < _MISSES:
        found = _between(database, query, start, start + _BATCH - 1)
        yield from found
        start += _BATCH
        misses = 0 if found else misses + 1
        if not found:
            start = _next(database, start)


def _last(database: sqlite3.Connection, size: int) -> int:
    """Number of the last row; 0 where it cannot be read, or cannot be."""
    try:
        (number,) = database.execute(_LAST).fetchone()
    except sqlite3.Error:
        return 0
    return number if isinstance(number, int) and 0 < number <= size // _SHORTEST else 0


def _next(database: sqlite3.Connection, start: int) -> int:
    """Number of the first row from a number on; that number itself where it cannot be read."""
    try:
        found = database.execute(_NEXT, (start - 1,)).fetchone()
    except sqlite3.Error:
        return start
    return int(found[0]) if found else start


def _between(
    database: sqlite3.Connection, query: str, first: int, last: int
) -> list[tuple[int, int, int]]:
    try:
        return database.execute(query, (first, last)).fetchall()
    except sqlite3.Error:
        if first == last:
            return []
        middle = (first + last) // 2
        return [
            *_between(database, query, first, middle),
            *_between(database, query, middle + 1, last),
        ]
