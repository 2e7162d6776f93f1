"""A bag on its way to the topics: what is played, under which names and how offered."""

from __future__ import annotations

import struct

from rclpy.exceptions import NameValidationException
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from nanorocks_ros.errors import FrameError
from nanorocks_ros.nodes._node import RESULT_TOPICS
from nanorocks_ros.nodes._shell import message_class, qos_of
from nanorocks_ros.wire import topics

NS = 1_000_000_000
_DEEPEST = 1000
_TRAYS = range(1, 9)
_OURS = {
    topic.absolute(tray): topic
    for topic in topics.TOPICS
    if topic is not topics.TAKEN
    for tray in _TRAYS
}
_WORKED_OUT = tuple(topic for topic in RESULT_TOPICS if topic is not topics.TRUTH)
_RESULTS = {topic.absolute(tray) for topic in _WORKED_OUT for tray in _TRAYS}
# Of a message that begins with a header: after 4 bytes that tell the order of bytes.
_STAMP = '{}iI'


class Playback:
    """The publishers for the topics of a bag.

    Topics under ``/nanorocks`` move with the namespace of the node, others keep their names. They
    are offered as they were when they were recorded; those of the graph at least as well as its
    nodes ask for.

    Parameters
    ----------
    node : NanorocksNode
    reader : BagReader
    with_results : bool

    Attributes
    ----------
    names : list of str
        Of the topics that are played, as the bag has them.
    latched : list of str
        Those of them that keep their last message for who comes late.
    results : list of str
        Those of them that are results, as they are named now.
    """

    def __init__(self, node, reader, with_results):
        self._node = node
        self._publishers = {}
        self.latched = []
        self.results = []
        for name, info in sorted(reader.topics.items()):
            # The clock is that of the player.
            if name != '/clock' and (with_results or name not in _RESULTS):
                self._offer(name, info)
        self.names = list(self._publishers)

    def _offer(self, name, info):
        ours = _OURS.get(name)
        if ours is not None and ours.type != info.type:
            ours = None
        try:
            kind = message_class(info.type)
        except (ImportError, AttributeError, ValueError):
            self._node.get_logger().warning(
                f'{name}: type {info.type} is not installed here; it is not played'
            )
            return
        qos = qos_of(ours) if ours is not None else QoSProfile(depth=10)
        if info.qos is not None:
            _adapt(qos, info.qos, at_least=ours is not None)
        published = name.removeprefix(f'{topics.NAMESPACE}/')
        try:
            self._publishers[name] = self._node.publisher(kind, published, qos)
        except NameValidationException:
            self._node.get_logger().warning(
                f'{name}: not a name that ROS allows; it is not played'
            )
            return
        if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            self.latched.append(name)
        if ours in _WORKED_OUT:
            self.results.append(published)

    def send(self, message):
        """Publish a message of the bag."""
        self._publishers[message.topic].publish(message.cdr)
        self._node.counts['published'] += 1


def _adapt(qos, recorded, at_least):
    """Make a quality of service what it was, or, of a topic of the graph, at least that."""
    latched = recorded.transient_local
    # Whoever kept all says any number.
    depth = min(recorded.depth, _DEEPEST)
    if at_least:
        latched = latched or qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        qos.depth = max(qos.depth, depth)
    else:
        qos.depth = depth
        best = ReliabilityPolicy.RELIABLE if recorded.reliable else ReliabilityPolicy.BEST_EFFORT
        qos.reliability = best
    qos.durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE


def stamp_in(message):
    """The stamp [ns] in the header with which a message of a bag begins.

    Raises
    ------
    FrameError
        When it is too short for one.
    """
    cdr = message.cdr
    try:
        order = '<' if cdr[1] & 1 else '>'
        seconds, nanoseconds = struct.unpack_from(_STAMP.format(order), cdr, 4)
    except (IndexError, struct.error) as error:
        raise FrameError(
            message.topic,
            f'a message of {len(cdr)} bytes is no {message.type}',
            'record it again or pass another bag',
        ) from error
    return seconds * NS + nanoseconds
