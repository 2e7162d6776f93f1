"""How our topics are offered in a bag: as the live graph offers them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.recordings.writer import OfferedQos, OfferedTopic

if TYPE_CHECKING:
    from nanorocks_ros.wire.topics import Topic


def offered(topic: Topic) -> OfferedTopic:
    """Type and quality of service of a topic, for the bag's metadata."""
    return OfferedTopic(
        msgtype=topic.type,
        qos=OfferedQos(reliable=True, transient_local=topic.latched, depth=topic.depth),
    )
