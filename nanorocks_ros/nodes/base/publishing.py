"""The publishers of a node: made once per topic, counted, and recorded."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Protocol

from rclpy.duration import Duration
from rclpy.qos import QoSPolicyKind
from rclpy.qos_overriding_options import QoSOverridingOptions

from nanorocks_ros.nodes.base.communication.result_topics import IMAGE_TOPICS
from nanorocks_ros.nodes.base.communication.ros_messages import (
    array_message,
    image_message,
    message_class,
    qos_of,
)
from nanorocks_ros.nodes.base.communication.typed_messages import typed_message, typed_problem
from nanorocks_ros.records import Notice, TrayImage
from nanorocks_ros.wire.products import ARRAY_TOPICS, TYPED_TOPICS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rclpy.callback_groups import CallbackGroup
    from rclpy.node import Node
    from rclpy.publisher import Publisher
    from rclpy.qos import QoSProfile

    from nanorocks_ros.nodes.base.diagnostics import Diagnostics
    from nanorocks_ros.records import ArrayRecord
    from nanorocks_ros.wire.topics import Topic

QOS_OVERRIDES = QoSOverridingOptions(
    policy_kinds=(
        QoSPolicyKind.HISTORY,
        QoSPolicyKind.DEPTH,
        QoSPolicyKind.RELIABILITY,
        QoSPolicyKind.DURABILITY,
    )
)
"""The policies of every publisher and subscription that parameters can override."""

# Acknowledgements come with heartbeats, every 3 s.
_ACKNOWLEDGED_WITHIN_S = 3.5


_TYPED_BESIDE = {
    array.name: TYPED_TOPICS[record_type] for record_type, array in ARRAY_TOPICS.items()
}


class ResultRecorder(Protocol):
    """Keeps the results that a node publishes."""

    def record_result(self, topic: Topic, message: Any, tray: int) -> None:
        """Keep a result."""


class Outputs:
    """The publishers of a node.

    Parameters
    ----------
    node : rclpy.node.Node
    diagnostics : Diagnostics
        Counts what is published.
    events : CallbackGroup
        Of the events of the publishers.

    Attributes
    ----------
    recorder : ResultRecorder or None
        Gets everything that is published, too.
    publishes_images : bool
        Whether `publish_result` publishes images, too.
    untyped : str
        Why arrays are offered without typed messages beside them; empty if they are not.
    """

    def __init__(self, node: Node, diagnostics: Diagnostics, events: CallbackGroup) -> None:
        self._node, self._diagnostics, self._events = node, diagnostics, events
        self._by_name: dict[str, Publisher] = {}
        self.recorder: ResultRecorder | None = None
        self.publishes_images = True
        self.untyped = ''

    def publisher(self, topic: Topic, tray: int = 0) -> Publisher:
        """The publisher of a topic, made once."""
        name = topic.of(tray)
        if name not in self._by_name:
            self.create_publisher(message_class(topic.type), name, qos_of(topic))
        return self._by_name[name]

    def create_publisher(self, message_type: Any, name: str, qos: QoSProfile) -> Publisher:
        """Make the publisher of a topic of any name, type and quality of service."""
        self._by_name[name] = self._node.create_publisher(
            message_type,
            name,
            qos,
            callback_group=self._events,
            qos_overriding_options=QOS_OVERRIDES,
        )
        return self._by_name[name]

    def offer(self, offered: Iterable[Topic], tray: int = 0) -> None:
        """Make the publishers of some topics, and of the typed messages beside their arrays."""
        for topic in offered:
            self.publisher(topic, tray)
            typed = _TYPED_BESIDE.get(topic.name)
            if typed is None:
                continue
            self.untyped = typed_problem()
            if not self.untyped:
                self.publisher(typed, tray)

    def is_offered(self, topic: Topic) -> bool:
        """Whether this node publishes a topic."""
        return topic.name in self._by_name

    def is_offered_by_others(self, topic: Topic) -> bool:
        """Whether another node publishes a topic."""
        return bool(self._node.count_publishers(topic.name) > int(self.is_offered(topic)))

    def has_subscribers(self, topic: Topic, tray: int = 0) -> bool:
        """Whether anybody subscribes to a topic; images are not even built otherwise."""
        return bool(self.publisher(topic, tray).get_subscription_count() > 0)

    def send(self, topic: Topic, message: Any, tray: int = 0) -> None:
        """Publish, count and record a message."""
        self.publisher(topic, tray).publish(message)
        self._diagnostics.counts['published'] += 1
        if self.recorder is not None:
            self.recorder.record_result(topic, message, tray)

    def publish_result(self, record: Any, epoch_ns: int) -> None:
        """Publish a result of a stage on its topics; a Notice is logged.

        Parameters
        ----------
        record : Notice, or any record of `ARRAY_TOPICS` or `IMAGE_TOPICS`
        epoch_ns : int, [ns]
            What times in arrays count from.
        """
        if isinstance(record, Notice):
            self._node.get_logger().warning(record.text)
        elif type(record) in ARRAY_TOPICS:
            self._publish_array(record, epoch_ns)
        else:
            if isinstance(record, TrayImage):
                self._publish_array(record.state(), epoch_ns)
            self._publish_images(record)
        self._diagnostics.note_result(record)

    def _publish_array(self, record: ArrayRecord, epoch_ns: int) -> None:
        """Publish a record as an array and, if it is offered and of use, as a typed message."""
        tray = record.tray
        self.send(ARRAY_TOPICS[type(record)], array_message(record, epoch_ns), tray)
        typed = TYPED_TOPICS[type(record)]
        publisher = self._by_name.get(typed.of(tray))
        if publisher and (typed.latched or publisher.get_subscription_count() > 0):
            publisher.publish(typed_message(record, epoch_ns))

    def _publish_images(self, record: Any) -> None:
        """Publish the images of a record that somebody subscribes to."""
        for topic, field in IMAGE_TOPICS[type(record)]:
            pixels = getattr(record, field)
            if (
                pixels is not None
                and self.publishes_images
                and self.has_subscribers(topic, record.tray)
            ):
                frame_id = f'tray_{record.tray}'
                self.send(topic, image_message(record.stamp_ns, frame_id, pixels), record.tray)

    def wait_until_acknowledged(self) -> None:
        """Wait until every subscription has what was published last, at most 3.5 s."""
        end = time.monotonic() + _ACKNOWLEDGED_WITHIN_S
        for publisher in self._by_name.values():
            if publisher.get_subscription_count() > 0:
                left = max(0.0, end - time.monotonic())
                publisher.wait_for_all_acked(Duration(nanoseconds=int(1e9 * left)))
