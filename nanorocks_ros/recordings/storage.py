"""What every kind of storage file offers, and the values it hands out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path

    from nanorocks_ros.recordings.offered_qos import OfferedQos

# Recordings count signed nanoseconds since 1970; what is earlier or later was damaged.
LAST_NS = 2**63 - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicInfo:
    """A topic of a recording.

    Parameters
    ----------
    name : str
    type : str
        For example ``sensor_msgs/msg/Image``.
    count : int
        Messages, as far as the storage knows before they are read.
    encoding : str
        Of the messages; only ``cdr`` can be deserialised.
    definition : str
        Text of the message definition kept in the recording; empty where there is none.
    definition_format : str
        ``ros2msg`` or ``ros2idl``.
    qos : OfferedQos or None
        How it was offered; None where the recording does not say.
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
        When it was recorded; the instant that was measured stands in the message's header.
    cdr : bytes
    """

    topic: str
    type: str
    log_time_ns: int
    cdr: bytes


class StorageFile(Protocol):
    """One file of a recording, opened.

    Attributes
    ----------
    path : Path
    topics : dict of str to TopicInfo
    start_ns, end_ns : int, [ns]
        Log times of the first and last message; both 0 when there is none.
    recorder_notes : str
        A copy of ``metadata.yaml`` that some recorders keep in the file; empty without one.
    complete : bool
        Nothing is known to be missing, so far.
    notices : tuple of str
        What was salvaged and what is lost, so far.
    messages_lost : int
        Messages known to be lost, so far.
    """

    path: Path
    topics: dict[str, TopicInfo]
    start_ns: int
    end_ns: int
    recorder_notes: str

    @property
    def complete(self) -> bool:
        """Nothing is known to be missing, so far."""

    @property
    def notices(self) -> tuple[str, ...]:
        """What was salvaged and what is lost, so far."""

    @property
    def messages_lost(self) -> int:
        """Messages known to be lost, so far."""

    def messages(
        self,
        topics: Collection[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Iterator[BagMessage]:
        """The messages of some topics and of some time, or all, in order of log time."""
