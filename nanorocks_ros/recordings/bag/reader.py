"""Read recordings, also truncated and damaged ones, in order of time, in bounded memory."""

from __future__ import annotations

import heapq
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any

import zstandard
from rosbags.serde import SerdeError
from rosbags.typesys import TypesysError

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.limits import CHUNK_BYTES
from nanorocks_ros.recordings.bag.bag_folder import BagContents, open_contents
from nanorocks_ros.recordings.bag.provenance import Interruption, interruptions
from nanorocks_ros.recordings.messages.message_types import register_type, standard_types
from nanorocks_ros.recordings.storage import BagMessage, StorageFile, TopicInfo

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from rosbags.typesys.store import Typestore

__all__ = ['BagMessage', 'BagReader', 'TopicInfo', 'open_bag']

_DESERIALIZE_ERRORS = (
    SerdeError,
    struct.error,
    ValueError,
    LookupError,
    AssertionError,
    MemoryError,
)


def open_bag(path: str | Path, *, salvaging: bool = False) -> BagReader:
    """Open a recording.

    Parameters
    ----------
    path : str or Path
        A rosbag2 folder (MCAP or SQLite storage) or a storage file.
    salvaging : bool
        Read MCAP files whose first bytes are damaged, too.

    Returns
    -------
    BagReader

    Raises
    ------
    RecordingError
        If nothing exists at the path, or it is not a recording.
    """
    return BagReader(Path(path), salvaging=salvaging)


class BagReader:
    """A recording.

    An intact MCAP file is opened by its index; a truncated one is scanned once to build the index.
    Damage inside a chunk is found only when the chunk is read: `complete`, `notices` and
    `messages_lost` are final after `messages` has been exhausted.

    Parameters
    ----------
    path : Path
    salvaging : bool
        Read files whose first bytes are damaged, too.

    Attributes
    ----------
    path : Path
    topics : dict of str to TopicInfo
    start_ns, end_ns : int, [ns]
        Log times of the first and last message; both 0 in an empty bag.
    metadata : dict of str to str
        Provenance, as given to `BagWriter`.
    expected : int or None
        Number of messages according to the recorder; None if it is not stated.
    """

    def __init__(self, path: Path, *, salvaging: bool = False) -> None:
        self.path = path
        self._contents: BagContents = open_contents(path, salvaging=salvaging)
        self.metadata = self._contents.metadata
        self.expected = self._contents.expected
        self.topics = _merged_topics(self._contents.files)
        used = [file for file in self._contents.files if _count(file)]
        self.start_ns = min((file.start_ns for file in used), default=0)
        self.end_ns = max((file.end_ns for file in used), default=0)
        self._undecompressed = 0
        self._store: Typestore | None = None

    @property
    def files(self) -> tuple[Path, ...]:
        """The storage files of the recording."""
        return tuple(file.path for file in self._contents.files)

    @property
    def complete(self) -> bool:
        """Whether no data loss has been found so far."""
        return (
            all(file.complete for file in self._contents.files)
            and self._contents.complete
            and not self._undecompressed
            and not self._miscount
            and not self.interruptions
        )

    @property
    def _miscount(self) -> str:
        """How the count in ``metadata.yaml`` differs from that of the files; empty if it agrees.

        Where messages were found to be lost, that is told already.
        """
        present = sum(map(_count, self._contents.files))
        if self.expected is None or present + self.messages_lost == self.expected:
            return ''
        if self.messages_lost and present <= self.expected <= present + self.messages_lost:
            return ''
        return f'metadata.yaml counts {self.expected} messages, the files hold {present}'

    @property
    def interruptions(self) -> tuple[Interruption, ...]:
        """Interrupted import or salvage by which the recording was made."""
        return interruptions(self.metadata)

    @property
    def notices(self) -> tuple[str, ...]:
        """Interruptions, damage and recovery found so far, in sentences."""
        interrupted = (f'{self.path}: {interruption.what}' for interruption in self.interruptions)
        return (*interrupted, *self.damage)

    @property
    def damage(self) -> tuple[str, ...]:
        """Damage and recovery found so far, in sentences."""
        notices = [*self._contents.notices]
        for file in self._contents.files:
            notices += file.notices
        if self._miscount:
            notices.append(f'{self.path}: {self._miscount}')
        if self._undecompressed:
            notices.append(
                f'{self.path}: {self._undecompressed} messages could not be decompressed'
            )
        return tuple(notices)

    @property
    def messages_lost(self) -> int:
        """Number of lost messages found so far; those behind a truncation are not known."""
        return self._undecompressed + sum(file.messages_lost for file in self._contents.files)

    def messages(
        self,
        topics: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[BagMessage]:
        """Messages of the given topics, or all, in order of log time.

        Parameters
        ----------
        topics : collection of str, optional
        start_ns, end_ns : int, optional, [ns]
            First and last log time; chunks outside this range are not read.

        Yields
        ------
        BagMessage
        """
        files = self._contents.files
        streams = [file.messages(topics, start_ns, end_ns) for file in files]
        messages = _merged_by_time(files, streams)
        return self._decompressed(messages) if self._contents.compressed_messages else messages

    def _decompressed(self, messages: Iterator[BagMessage]) -> Iterator[BagMessage]:
        self._undecompressed = 0
        for message in messages:
            try:
                cdr = zstandard.decompress(message.cdr, max_output_size=CHUNK_BYTES.value)
            except (zstandard.ZstdError, MemoryError):
                self._undecompressed += 1
                continue
            yield BagMessage(
                topic=message.topic, type=message.type, log_time_ns=message.log_time_ns, cdr=cdr
            )

    def deserialize(self, message: BagMessage) -> Any:
        """Deserialize a message to an object with the attributes of its type.

        Parameters
        ----------
        message : BagMessage

        Raises
        ------
        RecordingError
            If its type is unknown or its bytes do not fit its type.
        """
        store = self._typestore_for(message)
        try:
            return store.deserialize_cdr(message.cdr, message.type)
        except _DESERIALIZE_ERRORS as error:
            raise RecordingError(
                f'{self.path}: {message.topic}',
                f'the message at {message.log_time_ns} ns is not a valid {message.type} '
                f'({_single_line(error)})',
                'record it again or pass another bag',
            ) from error

    def _typestore_for(self, message: BagMessage) -> Typestore:
        if self._store is None:
            self._store = standard_types()
        info = self.topics.get(message.topic)
        where = f'{self.path}: {message.topic}'
        if info is not None and info.encoding != 'cdr':
            raise RecordingError(
                where, f"is encoded as '{info.encoding}', not cdr", 'record it with ROS 2'
            )
        if message.type in self._store.fielddefs:
            return self._store
        try:
            if info is None or not info.definition:
                raise TypesysError('the bag holds no definition')
            register_type(self._store, message.type, info.definition, info.definition_format)
        except (TypesysError, ValueError, LookupError) as error:
            raise RecordingError(
                where,
                f"type '{message.type}' is unknown ({_single_line(error)})",
                'omit this topic, or record it with its definition (MCAP storage)',
            ) from error
        return self._store

    def require_topic(self, candidates: Sequence[str]) -> str:
        """The first of several topics that has messages in the recording.

        Parameters
        ----------
        candidates : sequence of str, at least one
            In order of preference.

        Returns
        -------
        str

        Raises
        ------
        RecordingError
            If none of them has a message.
        """
        present = [info for info in self.topics.values() if info.count]
        if not present:
            raise RecordingError(
                str(self.path), 'holds no messages', 'record it again or pass another bag'
            )
        names = {info.name for info in present}
        for name in candidates:
            if name in names:
                return name
        missing = ' or '.join(f"'{name}'" for name in candidates)
        available = ', '.join(f"'{info.name}' [{info.type}]" for info in present)
        raise RecordingError(
            str(self.path), f'no topic {missing} (found {available})', 'pass --image-topic'
        )


def _single_line(error: Exception) -> str:
    return ' '.join(str(error).split())


def _count(file: StorageFile) -> int:
    return sum(info.count for info in file.topics.values())


def _merged_topics(files: Sequence[StorageFile]) -> dict[str, TopicInfo]:
    merged: dict[str, TopicInfo] = {}
    for file in files:
        for name, info in file.topics.items():
            before = merged.get(name, info)
            count = info.count + (before.count if name in merged else 0)
            merged[name] = TopicInfo(
                name=name,
                type=before.type,
                count=count,
                encoding=before.encoding,
                definition=before.definition or info.definition,
                definition_format=before.definition_format,
                qos=before.qos or info.qos,
            )
    return merged


def _merged_by_time(
    files: Sequence[StorageFile], streams: Sequence[Iterator[BagMessage]]
) -> Iterator[BagMessage]:
    """Merge the messages of all files by log time; a file is opened at its first message."""
    queue: list[tuple[int, int, BagMessage | None]] = [
        (file.start_ns, number, None) for number, file in enumerate(files) if _count(file)
    ]
    heapq.heapify(queue)
    while queue:
        _, number, message = heapq.heappop(queue)
        if message is not None:
            yield message
        following = next(streams[number], None)
        if following is not None:
            heapq.heappush(queue, (following.log_time_ns, number, following))
