"""Find the readable rows of a damaged SQLite file.

Tested by ``test/recordings/bag/test_reader.py``.
"""

from __future__ import annotations

import sqlite3
from array import array
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.recordings.storage import LAST_NS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

# Column types of an intact row; a row with other types is damaged.
VALID_ROW = (
    f"typeof(timestamp) = 'integer' AND timestamp BETWEEN 0 AND {LAST_NS} "
    "AND typeof(topic_id) = 'integer' AND typeof(data) = 'blob'"
)
_ROWS = f'SELECT timestamp, id, topic_id FROM messages WHERE id BETWEEN ? AND ? AND {VALID_ROW}'
# Reads the content, too, so that a row with a missing end is not found.
_ROWS_WITH_CONTENT = f"{_ROWS} AND length(data || x'') >= 0"
_NEXT = 'SELECT id FROM messages WHERE id > ? ORDER BY id LIMIT 1'
_LAST = 'SELECT max(id) FROM messages'
# Rows per query, and number of empty queries that end the search if the last id is not known.
_BATCH, _MAX_EMPTY = 256, 8
# Smallest size of a row, [bytes]: a larger row id than the file has room for is damaged.
_MIN_ROW_BYTES = 8


def readable_rows(database: sqlite3.Connection, size: int, *, whole: bool) -> NDArray[np.int64]:
    """Find the rows that can be read.

    Parameters
    ----------
    database : sqlite3.Connection
    size : int, [bytes]
        Of the file.
    whole : bool
        Return only rows whose content can be read; this reads all content.

    Returns
    -------
    ndarray of int64, (n_rows, 3)
        Log time in ns, row id and topic id of each row, in order of time.
    """
    values = array('q')
    for row in _scan_rows(database, size, _ROWS_WITH_CONTENT if whole else _ROWS):
        values.extend(row)
    rows = np.array(values, dtype=np.int64).reshape(-1, 3)
    return rows[np.lexsort((rows[:, 1], rows[:, 0]))]


def _scan_rows(
    database: sqlite3.Connection, size: int, query: str
) -> Iterator[tuple[int, int, int]]:
    last = _last_row(database, size)
    start, empty = 1, 0
    while start <= last if last else empty < _MAX_EMPTY:
        rows = _rows_between(database, query, start, start + _BATCH - 1)
        yield from rows
        start += _BATCH
        empty = 0 if rows else empty + 1
        if not rows:
            start = _next_row(database, start)


def _last_row(database: sqlite3.Connection, size: int) -> int:
    """Id of the last row; 0 if it cannot be read or is impossible."""
    try:
        (number,) = database.execute(_LAST).fetchone()
    except sqlite3.Error:
        return 0
    return number if isinstance(number, int) and 0 < number <= size // _MIN_ROW_BYTES else 0


def _next_row(database: sqlite3.Connection, start: int) -> int:
    """Id of the first row with at least this id; `start` itself if it cannot be read."""
    try:
        row = database.execute(_NEXT, (start - 1,)).fetchone()
    except sqlite3.Error:
        return start
    return int(row[0]) if row else start


def _rows_between(
    database: sqlite3.Connection, query: str, first: int, last: int
) -> list[tuple[int, int, int]]:
    try:
        return database.execute(query, (first, last)).fetchall()
    except sqlite3.Error:
        if first == last:
            return []
        middle = (first + last) // 2
        return [
            *_rows_between(database, query, first, middle),
            *_rows_between(database, query, middle + 1, last),
        ]
