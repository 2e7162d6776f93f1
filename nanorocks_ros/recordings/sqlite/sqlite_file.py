"""One SQLite file of a rosbag2 recording."""

from __future__ import annotations

import sqlite3
from array import array
from collections import Counter
from contextlib import closing
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.offered_qos import recorded_qos
from nanorocks_ros.recordings.sqlite.sqlite_open import ReadOnly
from nanorocks_ros.recordings.sqlite.sqlite_rows import FIT, readable_rows
from nanorocks_ros.recordings.storage import LAST_NS, BagMessage, TopicInfo

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

MAGIC = b'SQLite format 3\x00'
_IN_ORDER = (
    'SELECT id, topic_id, timestamp, data FROM messages '
    'WHERE topic_id IN ({}) AND timestamp BETWEEN ? AND ? ORDER BY timestamp, id'
)
# In front of the grouping, which would copy the content to sort it.
_BY_TOPIC = (
    'SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages '
    f'WHERE {FIT} GROUP BY topic_id'
)
_ODD = f'SELECT id FROM messages WHERE NOT ({FIT})'
_ONE = 'SELECT data FROM messages WHERE id = ?'


class SqliteFile:
    """A ``.db3`` file; rows are streamed, never held.

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
        When it cannot be read or lacks the tables of a recording.
    """

    recorder_notes = ''

    def __init__(self, path: Path) -> None:
        self.path = path
        self._damage = ''
        self._rows: NDArray[np.int64] | None = None
        # Rows that cannot have been written so, rows that were counted and are not found any
        # more, and numbers of those found in vain.
        self._odd = self._missing = 0
        self._odd_rows: frozenset[int] = frozenset()
        self._unreadable: set[int] = set()
        self._file = ReadOnly(path)
        try:
            with closing(self._file.connect()) as database:
                try:
                    self._read(database)
                except sqlite3.Error as error:
                    # Without this SQLite reads nothing of a file that was cut short.
                    database.execute('PRAGMA writable_schema=ON')
                    self._read_damaged(database, error)
        except sqlite3.Error as error:
            raise RecordingError(
                str(path),
                f'cannot be read as a recording ({error})',
                'pass another bag, or recover it with `sqlite3 FILE .recover`',
            ) from error

    def _read(self, database: sqlite3.Connection) -> None:
        found = database.execute(_BY_TOPIC).fetchall()
        self._numbers, self.topics = _topics(database, {row[0]: row[1] for row in found})
        known = [row for row in found if row[0] in self._numbers]
        self.start_ns: int = min((first for _, _, first, _ in known), default=0)
        self.end_ns: int = max((last for *_, last in known), default=0)
        self._odd_rows = frozenset(number for (number,) in database.execute(_ODD))
        nameless = sum(row[1] for row in found) - sum(row[1] for row in known)
        self._odd = len(self._odd_rows) + nameless

    def _known(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Those on a topic that has a name."""
        return rows[np.isin(rows[:, 2], np.array([*self._numbers], dtype=np.int64))]

    def _read_damaged(self, database: sqlite3.Connection, error: sqlite3.Error) -> None:
        """Note which rows can still be read, in order of time."""
        rows = readable_rows(database, self._file.size, whole=True)
        self._numbers, _ = _topics(database, {})
        self._rows = rows = self._known(rows)
        if not rows.size:
            raise error
        _, self.topics = _topics(database, Counter(rows[:, 2].tolist()))
        self.start_ns, self.end_ns = int(rows[0, 0]), int(rows[-1, 0])
        # Rows are counted from 1.
        self._missing = int(rows[:, 1].max()) - len(rows)
        self._damage = f'damaged, {len(rows)} messages can still be read ({error})'

    @property
    def complete(self) -> bool:
        """Nothing is known to be missing, so far."""
        return not self._damage and not self._odd

    @property
    def notices(self) -> tuple[str, ...]:
        """What is lost, so far."""
        odd = 'messages have a time, topic or content that cannot be and were left out'
        said = (
            (self._damage, self._damage),
            (self._odd, f'{self._odd} {odd}'),
            (self._unreadable, f'{len(self._unreadable)} messages could not be read'),
        )
        return tuple(f'{self.path}: {text}' for there, text in said if there)

    @property
    def messages_lost(self) -> int:
        """Messages between others that are lost; how many lie behind the damage is not known."""
        return self._odd + self._missing + len(self._unreadable)

    def messages(
        self,
        topics: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[BagMessage]:
        """The messages of some topics, or all, in order of log time, but those that are damaged.

        Parameters
        ----------
        topics : collection of str, optional
        start_ns, end_ns : int, optional, [ns]
            Log times of the first and last message wanted; what lies wholly outside is not read.

        Yields
        ------
        BagMessage
        """
        wanted = {
            number: name
            for number, name in self._numbers.items()
            if topics is None or name in topics
        }
        span = (
            0 if start_ns is None else min(max(start_ns, 0), LAST_NS),
            LAST_NS if end_ns is None else min(max(end_ns, -1), LAST_NS),
        )
        for number, log_time_ns, data in self._given(tuple(wanted), span):
            info = self.topics[wanted[number]]
            yield BagMessage(topic=info.name, type=info.type, log_time_ns=log_time_ns, cdr=data)

    def _given(
        self, wanted: tuple[int, ...], span: tuple[int, int]
    ) -> Iterator[tuple[int, int, bytes]]:
        """Topic, log time and content of each message."""
        with closing(self._file.connect()) as database:
            given = array('q')
            if self._rows is None:
                query = _IN_ORDER.format(','.join('?' * len(wanted)))
                try:
                    for number, topic, stamp, content in database.execute(query, (*wanted, *span)):
                        given.append(number)
                        # The index may hold a time as it was before the row was damaged.
                        if number not in self._odd_rows:
                            yield topic, stamp, content
                    return
                except sqlite3.Error as error:
                    self._turn_to_rows(database, error)
            yield from self._row_by_row(database, wanted, span, given)

    def _turn_to_rows(self, database: sqlite3.Connection, error: sqlite3.Error) -> None:
        """From here on by single rows: SQLite goes no further than to the first damage."""
        database.execute('PRAGMA writable_schema=ON')
        self._rows = self._known(readable_rows(database, self._file.size, whole=False))
        held = sum(info.count for info in self.topics.values())
        self._missing = max(0, held - len(self._rows))
        self._damage = f'damaged, what can be read is read row by row ({error})'

    def _row_by_row(
        self,
        database: sqlite3.Connection,
        wanted: tuple[int, ...],
        span: tuple[int, int],
        given: array[int],
    ) -> Iterator[tuple[int, int, bytes]]:
        """Those of the rows that can be read and were not given yet."""
        assert self._rows is not None
        stamps, numbers, kinds = self._rows.T
        due = (
            (stamps >= span[0])
            & (stamps <= span[1])
            & np.isin(kinds, np.array(wanted, dtype=np.int64))
            & ~np.isin(numbers, np.array(given, dtype=np.int64))
        )
        database.execute('PRAGMA writable_schema=ON')
        for place in np.flatnonzero(due):
            stamp, number, topic = self._rows[place].tolist()
            try:
                found = database.execute(_ONE, (number,)).fetchone()
            except sqlite3.Error:
                found = None
            if found is None or not isinstance(found[0], bytes):
                self._unreadable.add(number)
            else:
                yield topic, stamp, found[0]


def _topics(
    database: sqlite3.Connection, counts: Mapping[int, int]
) -> tuple[dict[int, str], dict[str, TopicInfo]]:
    definitions = _definitions(database)
    numbers: dict[int, str] = {}
    topics: dict[str, TopicInfo] = {}
    columns = {row[1] for row in database.execute('PRAGMA table_info(topics)')}
    qos_column = 'offered_qos_profiles' if 'offered_qos_profiles' in columns else "''"
    for number, name, kind, encoding, qos in database.execute(
        f'SELECT id, name, type, serialization_format, {qos_column} FROM topics ORDER BY id'
    ):
        name, kind, encoding, qos = (_text(one) for one in (name, kind, encoding, qos))
        numbers[number] = name
        before = topics.get(name)
        form, text = definitions.get(kind, ('ros2msg', ''))
        topics[name] = TopicInfo(
            name=name,
            type=before.type if before else kind,
            count=counts.get(number, 0) + (before.count if before else 0),
            encoding=encoding,
            definition=text,
            definition_format=form,
            qos=recorded_qos(qos),
        )
    return numbers, topics


def _definitions(database: sqlite3.Connection) -> dict[str, tuple[str, str]]:
    """Format and text of the definition of each type; empty where they are lost."""
    tables = database.execute("SELECT name FROM sqlite_master WHERE type='table'")
    # Older recordings keep no definitions.
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
    """What stands where a text was written."""
    return value if isinstance(value, str) else ''
