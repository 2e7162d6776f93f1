"""Topics as a bag offers them: with the type and quality of service of the live graph."""

from __future__ import annotations

from typing import Protocol

from nanorocks_ros.recordings.bag.writer import OfferedQos, OfferedTopic


class Topic(Protocol):
    """What a bag has to know of a topic."""

    @property
    def type(self) -> str:
        """Message type."""

    @property
    def latched(self) -> bool:
        """Whether late subscribers get the last message."""

    @property
    def depth(self) -> int:
        """Depth of the queue."""


def offered(topic: Topic) -> OfferedTopic:
    """Type and quality of service of a topic, for the bag's metadata."""
    return OfferedTopic(
        msgtype=topic.type,
        qos=OfferedQos(reliable=True, transient_local=topic.latched, depth=topic.depth),
    )
