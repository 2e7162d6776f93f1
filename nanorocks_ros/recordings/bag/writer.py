"""Writing recordings: rosbag2 folders with MCAP storage.

How much a crash can cost: messages reach the file in chunks, compressed one by one so that
viewers can seek. The chunk that is open when the process is killed is lost, which is at most
one second of recorded time or 1 MiB, whichever is less, and the last message; `flush` shortens
that. A killed recording has neither index nor ``metadata.yaml``; `reader.open_bag` reads it all
the same. Only `sync` forces anything to the disk: otherwise a power cut costs what the system had
not yet written.
"""

from __future__ import annotations

import os
import struct
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import zstandard
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.errors import WriterError
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.serde import SerdeError
from rosbags.typesys import TypesysError

from nanorocks_ros.errors import RecordingError, UnwritableError
from nanorocks_ros.recordings.messages.message_types import register, standard_types
from nanorocks_ros.recordings.offered_qos import OfferedQos

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import TracebackType
    from typing import Literal, Self

    from rosbags.interfaces import Connection

__all__ = ['BagWriter', 'OfferedQos', 'OfferedTopic']

_CHUNK_NS = 1_000_000_000
# Pictures are compressed already: a higher level takes time and saves nothing.
_LEVEL = 1
# Of a type whose definition is not understood.
_UNKNOWN_DIGEST = f'RIHS01_{"0" * 64}'
_UNFIT = (
    SerdeError,
    struct.error,
    AttributeError,
    TypeError,
    ValueError,
    LookupError,
    AssertionError,
)
# A ROS time counts seconds with 32 bits, one of them for the sign.
_END_OF_TIME_NS = 2**31 * 1_000_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class OfferedTopic:
    """What a topic carries, and how.

    Parameters
    ----------
    msgtype : str
        For example ``sensor_msgs/msg/Image``.
    qos : OfferedQos
    definition : str
        Text of the message definition, for types that are not part of ROS 2 Jazzy.
    definition_format : str
        ``ros2msg`` or ``ros2idl``.
    encoding : str
        Of its messages.
    verbatim : bool
        The definition is kept as it is, understood or not: for copies.
    """

    msgtype: str
    qos: OfferedQos
    definition: str = ''
    definition_format: str = 'ros2msg'
    encoding: str = 'cdr'
    verbatim: bool = False


class BagWriter:
    """Writes a new recording; to be used in a ``with`` statement.

    Topics appear in the recording with their first message. An exception inside the ``with``
    still closes the recording properly: what was written stays readable.

    Parameters
    ----------
    path : str or Path
        Folder to create, with its parents; must not exist.
    topics : mapping of str to OfferedTopic
        By absolute name.
    metadata : mapping of str to str
        Provenance, kept as the recording's ``custom_data``.

    Raises
    ------
    RecordingError
        On entering, when the path exists or cannot be created.
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
        self._folder_is_safe = False

    def __enter__(self) -> Self:
        if self.path.exists():
            raise self._exists()
        try:
            self._writer = Writer(self.path, version=9, storage_plugin=StoragePlugin.MCAP)
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
        # With a checksum in each frame a flipped bit is noticed; rosbags writes none.
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
            self._writer.close()
        except OSError as failure:
            with suppress(OSError):
                self._writer.abort()
            if error is None:
                raise self._unwritable(failure) from failure
        return False

    def remark(self, key: str, value: str) -> None:
        """Add to the provenance what was not known at the start, or replace what was."""
        self._writer.set_custom_data(key, _encodable(value))

    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        """Write a message given as an object.

        Parameters
        ----------
        topic : str
            One of the topics given at the start.
        stamp_ns : int, [ns], >= 0
            Log time.
        message : object
            As made by `recordings.messages`, or with the same attributes.

        Raises
        ------
        RecordingError
            When the topic was not announced, the message does not fit it, its stamp no ROS
            time, or the disk is full.
        """
        connection = self._connection(topic)
        try:
            cdr = self._store.serialize_cdr(message, connection.msgtype)
        except _UNFIT as error:
            if isinstance(error, struct.error) and stamp_ns >= _END_OF_TIME_NS:
                raise self._too_late(topic) from error
            raise RecordingError(
                f'{self.path}: {topic}',
                f'{type(message).__name__} is no {connection.msgtype} ({error})',
                'write a message of the announced type',
            ) from error
        self._append(connection, stamp_ns, cdr)

    def write_raw(self, topic: str, stamp_ns: int, cdr: bytes | memoryview) -> None:
        """Write a message that is serialised already, as CDR.

        Parameters
        ----------
        topic : str
            One of the topics given at the start.
        stamp_ns : int, [ns], >= 0
            Log time.
        cdr : bytes

        Raises
        ------
        RecordingError
            When the topic was not announced or the disk is full.
        """
        self._append(self._connection(topic), stamp_ns, cdr)

    def flush(self) -> None:
        """Hand everything written so far to the system, so that it survives this process."""
        try:
            if self._storage.chunk.bio.tell():
                self._storage.close_chunk()
            self._storage.bio.flush()
        except OSError as error:
            raise self._unwritable(error) from error

    def sync(self) -> None:
        """Hand everything written so far to the disk, so that it survives a power cut.

        Raises
        ------
        RecordingError
            When the disk is full or fails.
        """
        self.flush()
        try:
            os.fsync(self._storage.bio.fileno())
            if not self._folder_is_safe:
                for folder in (self.path, self.path.parent):
                    _sync_folder(folder)
                self._folder_is_safe = True
        except OSError as error:
            raise self._unwritable(error) from error

    def abandon(self) -> None:
        """End without an index, after a failure: what reached the file before stays readable."""
        with suppress(OSError):
            self._writer.abort()

    def _append(self, connection: Connection, stamp_ns: int, cdr: bytes | memoryview) -> None:
        if stamp_ns < 0:
            raise RecordingError(
                f'{self.path}: {connection.topic}',
                f'stamp {stamp_ns} ns lies before 1970',
                'give stamps of 0 or more',
            )
        try:
            self._writer.write(connection, stamp_ns, cdr)
        except OSError as error:
            raise self._unwritable(error) from error
        if stamp_ns - self._storage.chunk.message_start_time >= _CHUNK_NS:
            self.flush()

    def _connection(self, topic: str) -> Connection:
        known = self._connections.get(topic)
        if known is not None:
            return known
        offered = self._topics.get(topic)
        if offered is None:
            raise RecordingError(
                str(self.path),
                f"topic '{topic}' was not announced ({', '.join(sorted(self._topics))})",
                'add it to the topics of the writer',
            )
        connection = self._new_connection(topic, offered)
        self._connections[topic] = connection
        return connection

    def _new_connection(self, topic: str, offered: OfferedTopic) -> Connection:
        kind, text = offered.msgtype, offered.definition
        if offered.verbatim:
            return self._copied_connection(topic, offered)
        try:
            if text:
                register(self._store, kind, text, offered.definition_format)
            return self._writer.add_connection(
                topic, kind, typestore=self._store, offered_qos_profiles=[offered.qos.profile()]
            )
        except (TypesysError, LookupError, ValueError) as error:
            raise RecordingError(
                f'{self.path}: {topic}',
                f"type '{kind}' is not part of ROS 2 Jazzy and has no usable definition",
                'give its definition',
            ) from error

    def _copied_connection(self, topic: str, offered: OfferedTopic) -> Connection:
        """As it was recorded; only a definition that is missing is looked up."""
        kind, text, digest = offered.msgtype, offered.definition, _UNKNOWN_DIGEST
        if kind in self._store.fielddefs:
            digest = self._store.hash_rihs01(kind)
            text = text or self._store.generate_msgdef(kind, ros_version=2)[0]
        return self._writer.add_connection(
            topic,
            kind,
            msgdef=text,
            rihs01=digest,
            serialization_format=offered.encoding,
            offered_qos_profiles=[offered.qos.profile()],
        )

    def _too_late(self, topic: str) -> RecordingError:
        return RecordingError(
            f'{self.path}: {topic}',
            'a stamp lies beyond what a ROS time holds, which ends on 2038-01-19',
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
    """Make the entries of a folder survive a power cut, not only what stands in its files."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def _encodable(text: str) -> str:
    """The text without what UTF-8 cannot hold, as in names of files of another encoding."""
    return text.encode('utf-8', 'backslashreplace').decode('utf-8')
