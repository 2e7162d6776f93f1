"""The publishers for the topics of a bag: which are played, their names, their QoS.

Tested by ``test/nodes/test_bag_player.py``.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from rclpy.exceptions import NameValidationException
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from nanorocks_ros.errors import FrameError
from nanorocks_ros.nodes.base.communication.result_topics import RESULT_TOPICS
from nanorocks_ros.nodes.base.communication.ros_messages import message_class, qos_of
from nanorocks_ros.records import NS
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from rclpy.publisher import Publisher

    from nanorocks_ros.nodes.base.node import NanorocksNode
    from nanorocks_ros.recordings.bag.reader import BagMessage, BagReader
    from nanorocks_ros.recordings.offered_qos import OfferedQos
    from nanorocks_ros.recordings.storage import TopicInfo

_MAX_DEPTH = 1000
_TRAYS = range(1, 9)
_OWN_TOPICS = {
    topic.absolute(tray): topic
    for topic in topics.TOPICS
    if topic is not topics.TAKEN
    for tray in _TRAYS
}
_RESULTS = {topic.absolute(tray) for topic in RESULT_TOPICS for tray in _TRAYS}
# The stamp of a message that begins with a header, after 4 bytes that tell the byte order.
_STAMP, _STAMP_OFFSET = '{}iI', 4


class BagPublishers:
    """Publishes the messages of a bag.

    Topics under ``/nanorocks`` move with the namespace of the node, others keep their names. They
    are offered with the QoS that was recorded; those of the graph at least with the QoS that its
    nodes request.

    Parameters
    ----------
    node : NanorocksNode
    reader : BagReader
    with_results : bool
        Whether to play the results that were recorded, too.

    Attributes
    ----------
    names : list of str
        Of the topics that are played, as in the bag.
    latched : list of str
        Those of them that keep their last message for late subscribers.
    results : list of str
        Those of them that are results, as they are published.
    """

    def __init__(self, node: NanorocksNode, reader: BagReader, *, with_results: bool) -> None:
        self._node = node
        self._publishers: dict[str, Publisher] = {}
        self.latched: list[str] = []
        self.results: list[str] = []
        for name, info in sorted(reader.topics.items()):
            # The player publishes a clock of its own.
            if name != '/clock' and (with_results or name not in _RESULTS):
                self._offer(name, info)
        self.names = list(self._publishers)

    def _offer(self, name: str, info: TopicInfo) -> None:
        own = _OWN_TOPICS.get(name)
        if own is not None and own.type != info.type:
            own = None
        try:
            message_type = message_class(info.type)
        except (ImportError, AttributeError, ValueError):
            self._node.get_logger().warning(
                f'{name}: message type {info.type} is not installed; the topic is not played'
            )
            return
        qos = qos_of(own) if own is not None else QoSProfile(depth=10)
        if info.qos is not None:
            _apply_recorded(qos, info.qos, at_least=own is not None)
        published = name.removeprefix(f'{topics.NAMESPACE}/')
        try:
            publisher = self._node.outputs.create_publisher(message_type, published, qos)
        except NameValidationException:
            self._node.get_logger().warning(
                f'{name}: not a valid ROS topic name; the topic is not played'
            )
            return
        self._publishers[name] = publisher
        if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            self.latched.append(name)
        if own in RESULT_TOPICS:
            self.results.append(published)

    def send(self, message: BagMessage) -> None:
        """Publish a message of the bag."""
        self._publishers[message.topic].publish(message.cdr)
        self._node.diagnostics.counts['published'] += 1


def _apply_recorded(qos: QoSProfile, recorded: OfferedQos, *, at_least: bool) -> None:
    """Change a QoS to what was recorded; with `at_least`, never to a weaker one."""
    latched = recorded.transient_local
    # With a history that keeps all messages the recorded depth may be any number.
    depth = min(recorded.depth, _MAX_DEPTH)
    if at_least:
        latched = latched or qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        qos.depth = max(qos.depth, depth)
    else:
        qos.depth = depth
        qos.reliability = (
            ReliabilityPolicy.RELIABLE if recorded.reliable else ReliabilityPolicy.BEST_EFFORT
        )
    qos.durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE


def stamp_in(message: BagMessage) -> int:
    """The stamp [ns] in the header that a message of a bag begins with.

    Raises
    ------
    FrameError
        When the message is too short to hold a header.
    """
    cdr = message.cdr
    try:
        order = '<' if cdr[1] & 1 else '>'
        seconds, nanoseconds = struct.unpack_from(_STAMP.format(order), cdr, _STAMP_OFFSET)
    except (IndexError, struct.error) as error:
        raise FrameError(
            message.topic,
            f'a message of {len(cdr)} bytes is not a valid {message.type}',
            'record it again or pass another bag',
        ) from error
    return int(seconds) * NS + int(nanoseconds)
