"""The interface of storage files (MCAP, SQLite) and the values they return.

Tested by ``test/recordings/bag/test_reader.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path

    from nanorocks_ros.recordings.offered_qos import OfferedQos

# ROS time stamps end on 2038-01-19, with 32 bits of seconds; any later one is damaged, [ns].
LAST_NS = 2**31 * 10**9 - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicInfo:
    """A topic of a recording.

    Parameters
    ----------
    name : str
    type : str
        For example ``sensor_msgs/msg/Image``.
    count : int
        Number of messages, as far as the storage knows before they are read.
    encoding : str
        Serialization format of the messages; only ``cdr`` can be deserialized.
    definition : str
        Text of the message definition in the recording; empty if there is none.
    definition_format : str
        ``ros2msg`` or ``ros2idl``.
    qos : OfferedQos or None
        Quality of service that the publisher offered; None if the recording does not state it.
    """

    name: str
    type: str
    count: int
    encoding: str = 'cdr'
    definition: str = ''
    definition_format: str = 'ros2msg'
    qos: OfferedQos | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class BagMessage:
    """A message as it was recorded.

    Parameters
    ----------
    topic, type : str
    log_time_ns : int, [ns]
        When it was recorded; the time of measurement is in the header of the message.
    cdr : bytes
    """

    topic: str
    type: str
    log_time_ns: int
    cdr: bytes


class StorageFile(Protocol):
    """One open file of a recording.

    Attributes
    ----------
    path : Path
    topics : dict of str to TopicInfo
    start_ns, end_ns : int, [ns]
        Log times of the first and last message; both 0 when there is none.
    recorder_notes : str
        Copy of ``metadata.yaml`` that some recorders store in the file; empty if there is none.
    complete : bool
        No data loss has been found so far.
    notices : tuple of str
        Damage and recovery found so far, in sentences.
    messages_lost : int
        Number of lost messages found so far.
    """

    path: Path
    topics: dict[str, TopicInfo]
    start_ns: int
    end_ns: int
    recorder_notes: str

    @property
    def complete(self) -> bool:
        """Whether no data loss has been found so far."""

    @property
    def notices(self) -> tuple[str, ...]:
        """Damage and recovery found so far, in sentences."""

    @property
    def messages_lost(self) -> int:
        """Number of lost messages found so far."""

    def messages(
        self,
        topics: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[BagMessage]:
        """Messages of the given topics and time range, in order of log time."""
