"""One SQLite file of a rosbag2 recording."""

from __future__ import annotations

import sqlite3
from collections import Counter
from contextlib import closing
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.qos import recorded_qos
from nanorocks_ros.recordings.storage import BagMessage, TopicInfo

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping
    from pathlib import Path

MAGIC = b'SQLite format 3\x00'
# SQLite's integers have 64 bits, one of them for the sign.
_FOREVER = 2**63 - 1
_IN_ORDER = (
    'SELECT topic_id, timestamp, data FROM messages '
    'WHERE topic_id IN ({}) AND timestamp BETWEEN ? AND ? ORDER BY timestamp, id'
)
# All of a row, so that one that lost its end is not taken for whole.
_ROWS = (
    'SELECT id, timestamp, topic_id FROM messages '
    "WHERE id BETWEEN ? AND ? AND length(CAST(data AS BLOB) || x'') >= 0"
)
_ONE = 'SELECT data FROM messages WHERE id = ?'
# Rows of a damaged file that are asked for together, and how often there may be none.
_BATCH, _MISSES = 256, 8


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
        self._rows: list[tuple[int, int, int]] | None = None
        self._lost = 0
        try:
            with closing(self._connect()) as database:
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
        counts = dict(
            database.execute('SELECT topic_id, count(*) FROM messages GROUP BY topic_id')
        )
        self._numbers, self.topics = _topics(database, counts)
        first, last = database.execute(
            'SELECT min(timestamp), max(timestamp) FROM messages'
        ).fetchone()
        self.start_ns: int = first or 0
        self.end_ns: int = last or 0

    def _read_damaged(self, database: sqlite3.Connection, error: sqlite3.Error) -> None:
        """Note which rows can still be read, in order of time."""
        rows = sorted(
            (stamp, number, topic)
            for number, stamp, topic in _readable_rows(database)
            if isinstance(stamp, int) and isinstance(topic, int)
        )
        if not rows:
            raise error
        self._rows = rows
        self._numbers, self.topics = _topics(database, Counter(topic for _, _, topic in rows))
        self.start_ns, self.end_ns = rows[0][0], rows[-1][0]
        # Rows are counted from 1.
        self._lost = max(number for _, number, _ in rows) - len(rows)
        self._damage = f'damaged, {len(rows)} messages can still be read ({error})'

    def _connect(self) -> sqlite3.Connection:
        return sqlite3.connect(f'{self.path.resolve().as_uri()}?mode=ro', uri=True)

    @property
    def complete(self) -> bool:
        """Nothing is known to be missing, so far."""
        return not self._damage

    @property
    def notices(self) -> tuple[str, ...]:
        """What is lost, so far."""
        return (f'{self.path}: {self._damage}',) if self._damage else ()

    @property
    def messages_lost(self) -> int:
        """Messages between others that are lost; how many lie behind the damage is not known."""
        return self._lost

    def messages(
        self,
        topics: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[BagMessage]:
        """The messages of some topics, or all, in order of log time, up to any damage.

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
            -_FOREVER if start_ns is None else max(start_ns, -_FOREVER),
            _FOREVER if end_ns is None else min(end_ns, _FOREVER),
        )
        for number, log_time_ns, data in self._given(tuple(wanted), span):
            info = self.topics[wanted[number]]
            yield BagMessage(topic=info.name, type=info.type, log_time_ns=log_time_ns, cdr=data)

    def _given(
        self, wanted: tuple[int, ...], span: tuple[int, int]
    ) -> Iterator[tuple[int, int, bytes]]:
        """Topic, log time and content of each message."""
        with closing(self._connect()) as database:
            if self._rows is None:
                try:
                    yield from database.execute(
                        _IN_ORDER.format(','.join('?' * len(wanted))), (*wanted, *span)
                    )
                except sqlite3.Error as error:
                    self._damage = f'damaged, what follows is lost ({error})'
                return
            database.execute('PRAGMA writable_schema=ON')
            for stamp, row, topic in self._rows:
                if topic in wanted and span[0] <= stamp <= span[1]:
                    try:
                        content = database.execute(_ONE, (row,)).fetchone()
                    except sqlite3.Error:
                        self._lost += 1
                        continue
                    yield topic, stamp, content[0]


def _readable_rows(database: sqlite3.Connection) -> Iterator[tuple[int, int, int]]:
    """Number, log time and topic of every row of a damaged file that can be read."""
    start, misses = 1, 0
    while misses < _MISSES:
        found = list(_between(database, start, start + _BATCH - 1))
        yield from found
        misses = 0 if found else misses + 1
        start += _BATCH


def _between(
    database: sqlite3.Connection, first: int, last: int
) -> Iterator[tuple[int, int, int]]:
    try:
        yield from database.execute(_ROWS, (first, last)).fetchall()
    except sqlite3.Error:
        if first < last:
            middle = (first + last) // 2
            yield from _between(database, first, middle)
            yield from _between(database, middle + 1, last)


def _topics(
    database: sqlite3.Connection, counts: Mapping[int, int]
) -> tuple[dict[int, str], dict[str, TopicInfo]]:
    definitions: dict[str, tuple[str, str]] = {}
    tables = database.execute("SELECT name FROM sqlite_master WHERE type='table'")
    # Older recordings keep no definitions.
    if ('message_definitions',) in tables.fetchall():
        rows = database.execute(
            'SELECT topic_type, encoding, encoded_message_definition FROM message_definitions'
        )
        definitions = {name: (encoding, text) for name, encoding, text in rows}
    numbers: dict[int, str] = {}
    topics: dict[str, TopicInfo] = {}
    columns = {row[1] for row in database.execute('PRAGMA table_info(topics)')}
    qos_column = 'offered_qos_profiles' if 'offered_qos_profiles' in columns else "''"
    for number, name, kind, encoding, qos in database.execute(
        f'SELECT id, name, type, serialization_format, {qos_column} FROM topics ORDER BY id'
    ):
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
            qos=recorded_qos(qos or ''),
        )
    return numbers, topics
