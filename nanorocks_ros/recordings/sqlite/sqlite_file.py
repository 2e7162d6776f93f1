"""One SQLite file of a rosbag2 recording.

Tested by ``test/recordings/bag/test_reader.py``.
"""

from __future__ import annotations

import sqlite3
from array import array
from collections import Counter
from contextlib import closing
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.offered_qos import recorded_qos
from nanorocks_ros.recordings.sqlite.sqlite_open import ReadOnlyDatabase
from nanorocks_ros.recordings.sqlite.sqlite_rows import VALID_ROW, readable_rows
from nanorocks_ros.recordings.storage import LAST_NS, BagMessage, TopicInfo

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

MAGIC = b'SQLite format 3\x00'
_BY_TIME = (
    'SELECT id, topic_id, timestamp, data FROM messages '
    'WHERE topic_id IN ({}) AND timestamp BETWEEN ? AND ? ORDER BY timestamp, id'
)
# The condition comes before the grouping, which would otherwise copy the content to sort it.
_BY_TOPIC = (
    'SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages '
    f'WHERE {VALID_ROW} GROUP BY topic_id'
)
_NO_TABLES = (
    "SELECT name, CASE type WHEN 'table' THEN 'virtual table' ELSE type END FROM sqlite_master "
    "WHERE lower(name) IN ('messages', 'topics', 'message_definitions') AND "
    "(type <> 'table' OR sql LIKE 'CREATE VIRTUAL%')"
)
_INVALID_ROWS = f'SELECT id FROM messages WHERE NOT ({VALID_ROW})'
_CONTENT_OF_ROW = 'SELECT data FROM messages WHERE id = ?'


class SqliteFile:
    """A ``.db3`` file; rows are streamed and not kept in memory.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    path : Path
    topics : dict of str to TopicInfo
    start_ns, end_ns : int, [ns]
    recorder_notes : str
        Always empty.

    Raises
    ------
    RecordingError
        If it cannot be read or lacks the tables of a recording.
    """

    recorder_notes = ''

    def __init__(self, path: Path) -> None:
        self.path = path
        self._damage = ''
        # Readable rows of a damaged file: log time, id, topic id.
        self._rows: NDArray[np.int64] | None = None
        # Number of rows with invalid values, and of counted rows that cannot be found any more.
        self._invalid = self._missing = 0
        self._invalid_rows: frozenset[int] = frozenset()
        self._unreadable: set[int] = set()
        self._file = ReadOnlyDatabase(path)
        try:
            with closing(self._file.connect()) as database:
                self._refuse_views(database)
                try:
                    self._read(database)
                except sqlite3.Error as error:
                    # Without this SQLite does not read a truncated file at all.
                    database.execute('PRAGMA writable_schema=ON')
                    self._read_damaged(database, error)
        except sqlite3.Error as error:
            raise RecordingError(
                str(path),
                f'cannot be read as a recording ({error})',
                'pass another bag, or recover it with `sqlite3 FILE .recover`',
            ) from error

    def _refuse_views(self, database: sqlite3.Connection) -> None:
        """Raise unless messages and topics are tables: a view may count for ever."""
        try:
            names = database.execute(_NO_TABLES).fetchall()
        except sqlite3.Error:
            # Its schema is damaged: what can be read is read below.
            return
        if names:
            raise RecordingError(
                str(self.path),
                f"holds '{names[0][0]}' as a {names[0][1]}, not as a table",
                'pass a bag that a recorder wrote',
            )

    def _read(self, database: sqlite3.Connection) -> None:
        rows = database.execute(_BY_TOPIC).fetchall()
        self._topic_names, self.topics = _topics(database, {row[0]: row[1] for row in rows})
        named = [row for row in rows if row[0] in self._topic_names]
        self.start_ns: int = min((first for _, _, first, _ in named), default=0)
        self.end_ns: int = max((last for *_, last in named), default=0)
        self._invalid_rows = frozenset(number for (number,) in database.execute(_INVALID_ROWS))
        nameless = sum(row[1] for row in rows) - sum(row[1] for row in named)
        self._invalid = len(self._invalid_rows) + nameless

    def _with_known_topic(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows whose topic has a name."""
        return rows[np.isin(rows[:, 2], np.array([*self._topic_names], dtype=np.int64))]

    def _read_damaged(self, database: sqlite3.Connection, error: sqlite3.Error) -> None:
        """Find the rows that can still be read, in order of time."""
        rows = readable_rows(database, self._file.size, whole=True)
        self._topic_names, _ = _topics(database, {})
        self._rows = rows = self._with_known_topic(rows)
        if not rows.size:
            raise error
        _, self.topics = _topics(database, Counter(rows[:, 2].tolist()))
        self.start_ns, self.end_ns = int(rows[0, 0]), int(rows[-1, 0])
        # Row ids count from 1.
        self._missing = int(rows[:, 1].max()) - len(rows)
        self._damage = f'is damaged; {len(rows)} messages can still be read ({error})'

    @property
    def complete(self) -> bool:
        """Whether no data loss has been found so far."""
        return not self._damage and not self._invalid

    @property
    def notices(self) -> tuple[str, ...]:
        """Damage found so far, in sentences."""
        invalid = f'{self._invalid} messages with an invalid time, topic or content were skipped'
        notices = (
            (self._damage, self._damage),
            (self._invalid, invalid),
            (self._unreadable, f'{len(self._unreadable)} messages could not be read'),
        )
        return tuple(f'{self.path}: {text}' for applies, text in notices if applies)

    @property
    def messages_lost(self) -> int:
        """Number of lost messages found so far; those at the end of the file are not known."""
        return self._invalid + self._missing + len(self._unreadable)

    def messages(
        self,
        topics: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[BagMessage]:
        """Readable messages of the given topics, or all, in order of log time.

        Parameters
        ----------
        topics : collection of str, optional
        start_ns, end_ns : int, optional, [ns]
            First and last log time; rows outside this range are not read.

        Yields
        ------
        BagMessage
        """
        names = {
            topic_id: name
            for topic_id, name in self._topic_names.items()
            if topics is None or name in topics
        }
        span = (
            0 if start_ns is None else min(max(start_ns, 0), LAST_NS),
            LAST_NS if end_ns is None else min(max(end_ns, -1), LAST_NS),
        )
        for topic_id, log_time_ns, data in self._stored_messages(tuple(names), span):
            info = self.topics[names[topic_id]]
            yield BagMessage(topic=info.name, type=info.type, log_time_ns=log_time_ns, cdr=data)

    def _stored_messages(
        self, topic_ids: tuple[int, ...], span: tuple[int, int]
    ) -> Iterator[tuple[int, int, bytes]]:
        """Topic id, log time and content of each message."""
        with closing(self._file.connect()) as database:
            read_ids = array('q')
            if self._rows is None:
                query = _BY_TIME.format(','.join('?' * len(topic_ids)))
                try:
                    for row_id, topic_id, stamp, content in database.execute(
                        query, (*topic_ids, *span)
                    ):
                        read_ids.append(row_id)
                        # The index may hold the time from before the row was damaged.
                        if row_id not in self._invalid_rows:
                            yield topic_id, stamp, content
                    return
                except sqlite3.Error as error:
                    self._switch_to_row_by_row(database, error)
            yield from self._row_by_row(database, topic_ids, span, read_ids)

    def _switch_to_row_by_row(self, database: sqlite3.Connection, error: sqlite3.Error) -> None:
        """Read row by row from here on, because a query of SQLite ends at the first damage."""
        database.execute('PRAGMA writable_schema=ON')
        self._rows = self._with_known_topic(readable_rows(database, self._file.size, whole=False))
        counted = sum(info.count for info in self.topics.values())
        self._missing = max(0, counted - len(self._rows))
        self._damage = f'is damaged; readable messages are read row by row ({error})'

    def _row_by_row(
        self,
        database: sqlite3.Connection,
        wanted: tuple[int, ...],
        span: tuple[int, int],
        read_ids: array[int],
    ) -> Iterator[tuple[int, int, bytes]]:
        """Readable rows of the wanted topics whose ids are not in `read_ids`."""
        assert self._rows is not None
        stamps, ids, topic_ids = self._rows.T
        selected = (
            (stamps >= span[0])
            & (stamps <= span[1])
            & np.isin(topic_ids, np.array(wanted, dtype=np.int64))
            & ~np.isin(ids, np.array(read_ids, dtype=np.int64))
        )
        database.execute('PRAGMA writable_schema=ON')
        for index in np.flatnonzero(selected):
            stamp, row_id, topic_id = self._rows[index].tolist()
            try:
                row = database.execute(_CONTENT_OF_ROW, (row_id,)).fetchone()
            except sqlite3.Error:
                row = None
            if row is None or not isinstance(row[0], bytes):
                self._unreadable.add(row_id)
            else:
                yield topic_id, stamp, row[0]


def _topics(
    database: sqlite3.Connection, counts: Mapping[int, int]
) -> tuple[dict[int, str], dict[str, TopicInfo]]:
    """Name of each topic id, and each topic by name."""
    definitions = _definitions(database)
    names: dict[int, str] = {}
    topics: dict[str, TopicInfo] = {}
    columns = {row[1] for row in database.execute('PRAGMA table_info(topics)')}
    qos_column = 'offered_qos_profiles' if 'offered_qos_profiles' in columns else "''"
    for topic_id, name, kind, encoding, qos in database.execute(
        f'SELECT id, name, type, serialization_format, {qos_column} FROM topics ORDER BY id'
    ):
        name, kind, encoding, qos = (_text(value) for value in (name, kind, encoding, qos))
        names[topic_id] = name
        before = topics.get(name)
        form, text = definitions.get(kind, ('ros2msg', ''))
        topics[name] = TopicInfo(
            name=name,
            type=before.type if before else kind,
            count=counts.get(topic_id, 0) + (before.count if before else 0),
            encoding=encoding,
            definition=text,
            definition_format=form,
            qos=recorded_qos(qos),
        )
    return names, topics


def _definitions(database: sqlite3.Connection) -> dict[str, tuple[str, str]]:
    """Format and text of the definition of each type; empty if they cannot be read."""
    tables = database.execute("SELECT name FROM sqlite_master WHERE type='table'")
    # Older recordings have no definitions.
    if ('message_definitions',) not in tables.fetchall():
        return {}
    try:
        rows = database.execute(
            'SELECT topic_type, encoding, encoded_message_definition FROM message_definitions'
        ).fetchall()
    except sqlite3.Error:
        return {}
    return {_text(name): (_text(encoding), _text(text)) for name, encoding, text in rows}


def _text(value: object) -> str:
    """A value of a text column; empty if damage changed its type."""
    return value if isinstance(value, str) else ''
