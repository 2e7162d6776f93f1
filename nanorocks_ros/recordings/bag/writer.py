"""Writing recordings: rosbag2 folders with MCAP storage.

Messages are written in chunks that are compressed separately, so that viewers can seek. If the
process is killed, the open chunk is lost: at most one second of recorded time or 1 MiB, whichever
is less, and the last message; `flush` closes the chunk earlier. A killed recording has neither
index nor ``metadata.yaml``; `reader.open_bag` can still read it. Ctrl-C waits for the end of each
write. Only `sync` forces data to the disk: otherwise a power cut loses what the operating system
has not written yet.
"""

from __future__ import annotations

import os
import struct
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import zstandard
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2.errors import WriterError
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.serde import SerdeError

from nanorocks_ros.errors import RecordingError, UnwritableError
from nanorocks_ros.recordings.bag.connections import add_connection
from nanorocks_ros.recordings.bag.metadata_writer import MetadataWriter
from nanorocks_ros.recordings.bag.uninterrupted import uninterrupted
from nanorocks_ros.recordings.mcap.mcap_checksum import add_summary_checksum
from nanorocks_ros.recordings.messages.message_types import standard_types
from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import TracebackType
    from typing import Literal, Self

    from rosbags.interfaces import Connection

    from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic

# Longest recorded time in a chunk.
_CHUNK_NS = NS
# Images are compressed already: a higher level takes time and saves nothing.
_LEVEL = 1
_SERIALIZE_ERRORS = (
    SerdeError,
    struct.error,
    AttributeError,
    TypeError,
    ValueError,
    LookupError,
    AssertionError,
)
# A ROS time stamp counts seconds in a signed 32-bit integer.
_END_OF_TIME_NS = 2**31 * NS


class BagWriter:
    """Write a new recording; use it in a ``with`` statement.

    A topic is added to the recording with its first message. After an exception inside the
    ``with`` the recording is closed properly: all written messages are readable.

    Parameters
    ----------
    path : str or Path
        Folder to create, with its parents; must not exist.
    topics : mapping of str to OfferedTopic
        By absolute name.
    metadata : mapping of str to str
        Provenance, stored as ``custom_data`` of the recording.

    Raises
    ------
    RecordingError
        On entering the ``with``, if the path exists or cannot be created.
    """

    def __init__(
        self,
        path: str | Path,
        topics: Mapping[str, OfferedTopic],
        *,
        metadata: Mapping[str, str],
    ) -> None:
        self.path = Path(path)
        self._topics = dict(topics)
        self._metadata = dict(metadata)
        self._store = standard_types()
        self._connections: dict[str, Connection] = {}
        self._folder_is_synced = False

    def __enter__(self) -> Self:
        if self.path.exists():
            raise self._exists()
        try:
            self._writer = MetadataWriter(self.path, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            for key, value in self._metadata.items():
                self._writer.set_custom_data(key, _encodable(value))
            self._writer.open()
        except WriterError as error:
            raise self._exists() from error
        except OSError as error:
            raise self._unwritable(error) from error
        storage = self._writer.storage
        assert isinstance(storage, McapWriter)
        self._storage = storage
        # A checksum in each frame reveals flipped bits; rosbags writes none.
        compressor = zstandard.ZstdCompressor(level=_LEVEL, write_checksum=True)
        self._storage.compressor = compressor.compress
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> Literal[False]:
        try:
            with uninterrupted():
                self._writer.close()
                add_summary_checksum(self._storage.path)
        except OSError as failure:
            with suppress(OSError):
                self._writer.abort()
            if error is None:
                raise self._unwritable(failure) from failure
        return False

    def set_metadata(self, key: str, value: str) -> None:
        """Add or replace an entry of the provenance."""
        self._writer.set_custom_data(key, _encodable(value))

    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        """Serialize and write a message.

        Parameters
        ----------
        topic : str
            One of the topics given to the constructor.
        stamp_ns : int, [ns], >= 0
            Log time.
        message : object
            As made by `recordings.messages`, or with the same attributes.

        Raises
        ------
        RecordingError
            If the topic was not declared, the message does not fit its type, a time stamp does
            not fit a ROS time, or the disk is full.
        """
        connection = self._connection(topic)
        try:
            cdr = self._store.serialize_cdr(message, connection.msgtype)
        except _SERIALIZE_ERRORS as error:
            if isinstance(error, struct.error) and stamp_ns >= _END_OF_TIME_NS:
                raise self._too_late(topic) from error
            raise RecordingError(
                f'{self.path}: {topic}',
                f'{type(message).__name__} is not a valid {connection.msgtype} ({error})',
                'write a message of the declared type',
            ) from error
        self._append(connection, stamp_ns, cdr)

    def write_raw(self, topic: str, stamp_ns: int, cdr: bytes | memoryview) -> None:
        """Write a serialized message (CDR).

        Parameters
        ----------
        topic : str
            One of the topics given to the constructor.
        stamp_ns : int, [ns], >= 0
            Log time.
        cdr : bytes

        Raises
        ------
        RecordingError
            If the topic was not declared or the disk is full.
        """
        self._append(self._connection(topic), stamp_ns, cdr)

    def flush(self) -> None:
        """Pass all written messages to the operating system: they survive a killed process."""
        try:
            with uninterrupted():
                if self._storage.chunk.bio.tell():
                    self._storage.close_chunk()
                self._storage.bio.flush()
        except OSError as error:
            raise self._unwritable(error) from error

    def sync(self) -> None:
        """Force all written messages to the disk: they survive a power cut.

        Raises
        ------
        RecordingError
            If the disk is full or fails.
        """
        self.flush()
        try:
            os.fsync(self._storage.bio.fileno())
            if not self._folder_is_synced:
                for folder in (self.path, self.path.parent):
                    _sync_folder(folder)
                self._folder_is_synced = True
        except OSError as error:
            raise self._unwritable(error) from error

    def abort(self) -> None:
        """Close the files without an index, after an error; written messages stay readable."""
        with suppress(OSError):
            self._writer.abort()

    def _append(self, connection: Connection, stamp_ns: int, cdr: bytes | memoryview) -> None:
        if stamp_ns < 0:
            raise RecordingError(
                f'{self.path}: {connection.topic}',
                f'stamp {stamp_ns} ns is before 1970',
                'give stamps of 0 or more',
            )
        try:
            with uninterrupted():
                self._writer.write(connection, stamp_ns, cdr)
        except OSError as error:
            raise self._unwritable(error) from error
        if stamp_ns - self._storage.chunk.message_start_time >= _CHUNK_NS:
            self.flush()

    def _connection(self, topic: str) -> Connection:
        connection = self._connections.get(topic)
        if connection is not None:
            return connection
        offered = self._topics.get(topic)
        if offered is None:
            raise RecordingError(
                str(self.path),
                f"topic '{topic}' was not declared ({', '.join(sorted(self._topics))})",
                'add it to the topics of the writer',
            )
        with uninterrupted():
            connection = add_connection(self._writer, self._store, topic, offered)
            self._connections[topic] = connection
        return connection

    def _too_late(self, topic: str) -> RecordingError:
        return RecordingError(
            f'{self.path}: {topic}',
            'a time stamp is after 2038-01-19, where the 32-bit seconds of ROS end',
            'pass an earlier --start, or the true --rate',
        )

    def _exists(self) -> RecordingError:
        return RecordingError(
            str(self.path), 'exists already and is not overwritten', 'pass another path'
        )

    def _unwritable(self, error: OSError) -> UnwritableError:
        return UnwritableError(
            str(self.path),
            f'cannot be written ({error.strerror})',
            'pass another path, or make room there',
        )


def _sync_folder(path: Path) -> None:
    """Force the entries of a folder to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _encodable(text: str) -> str:
    """Escape characters that UTF-8 cannot encode, as in file names of another encoding."""
    return text.encode('utf-8', 'backslashreplace').decode('utf-8')
