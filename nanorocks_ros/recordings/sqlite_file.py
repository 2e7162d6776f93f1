"""One SQLite file of a rosbag2 recording."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.storage import BagMessage, TopicInfo

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path

MAGIC = b'SQLite format 3\x00'
# SQLite's integers have 64 bits, one of them for the sign.
_FOREVER = 2**63 - 1


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

    Raises
    ------
    RecordingError
        When it cannot be read or lacks the tables of a recording.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._damage = ''
        try:
            with closing(self._connect()) as database:
                self._numbers, self.topics = _topics(database)
                first, last = database.execute(
                    'SELECT min(timestamp), max(timestamp) FROM messages'
                ).fetchone()
        except sqlite3.Error as error:
            raise RecordingError(
                str(path),
                f'cannot be read as a recording ({error})',
                'pass another bag, or recover it with `sqlite3 FILE .recover`',
            ) from error
        self.start_ns: int = first or 0
        self.end_ns: int = last or 0

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
        """Always 0: SQLite does not tell how much lies behind the damage."""
        return 0

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
        marks = ','.join('?' * len(wanted))
        query = (
            'SELECT topic_id, timestamp, data FROM messages '
            f'WHERE topic_id IN ({marks}) AND timestamp BETWEEN ? AND ? ORDER BY timestamp, id'
        )
        span = (
            -_FOREVER if start_ns is None else max(start_ns, -_FOREVER),
            _FOREVER if end_ns is None else min(end_ns, _FOREVER),
        )
        try:
            with closing(self._connect()) as database:
                for number, log_time_ns, data in database.execute(query, (*wanted, *span)):
                    info = self.topics[wanted[number]]
                    yield BagMessage(
                        topic=info.name, type=info.type, log_time_ns=log_time_ns, cdr=data
                    )
        except sqlite3.Error as error:
            self._damage = f'damaged, what follows is lost ({error})'


def _topics(database: sqlite3.Connection) -> tuple[dict[int, str], dict[str, TopicInfo]]:
    definitions: dict[str, tuple[str, str]] = {}
    tables = database.execute("SELECT name FROM sqlite_master WHERE type='table'")
    # Older recordings keep no definitions.
    if ('message_definitions',) in tables.fetchall():
        rows = database.execute(
            'SELECT topic_type, encoding, encoded_message_definition FROM message_definitions'
        )
        definitions = {name: (encoding, text) for name, encoding, text in rows}
    counts = dict(database.execute('SELECT topic_id, count(*) FROM messages GROUP BY topic_id'))
    numbers: dict[int, str] = {}
    topics: dict[str, TopicInfo] = {}
    columns = {row[1] for row in database.execute('PRAGMA table_info(topics)')}
    # The first version of the format did not keep it.
    qos = 'offered_qos_profiles' if 'offered_qos_profiles' in columns else "''"
    for number, name, kind, encoding, offered in database.execute(
        f'SELECT id, name, type, serialization_format, {qos} FROM topics ORDER BY id'
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
            offered_qos=offered or '',
        )
    return numbers, topics
