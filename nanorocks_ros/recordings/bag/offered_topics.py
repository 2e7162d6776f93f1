"""Topics of a recording: type, message definition and quality of service.

Tested by ``test/recordings/bag/test_writer.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from nanorocks_ros.recordings.offered_qos import OfferedQos


@dataclass(frozen=True, slots=True, kw_only=True)
class OfferedTopic:
    """A topic that a `BagWriter` can write.

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
        Serialization format of the messages.
    verbatim : bool
        Copy the definition without parsing it.
    """

    msgtype: str
    qos: OfferedQos
    definition: str = ''
    definition_format: str = 'ros2msg'
    encoding: str = 'cdr'
    verbatim: bool = False


class Topic(Protocol):
    """The properties of a topic that its recording needs."""

    @property
    def type(self) -> str:
        """Message type."""

    @property
    def latched(self) -> bool:
        """Whether late subscribers get the last message."""

    @property
    def depth(self) -> int:
        """Depth of the queue."""


def offered_topic(topic: Topic) -> OfferedTopic:
    """Type and quality of service of a topic, for a `BagWriter`."""
    return OfferedTopic(
        msgtype=topic.type,
        qos=OfferedQos(reliable=True, transient_local=topic.latched, depth=topic.depth),
    )
