"""Images for the live page: subscribed to while a browser views them, at a limited rate."""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING, Any

from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from nanorocks_ros.dashboard.tray_pictures import encoded
from nanorocks_ros.nodes.base.communication.ros_messages import message_class
from nanorocks_ros.nodes.trays.tray_image_messages import gray_frame, gray_or_bgr_frame
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Callable, Set

    from rclpy.subscription import Subscription
    from sensor_msgs.msg import Image

    from nanorocks_ros.nodes.base.node import NanorocksNode
    from nanorocks_ros.wire.topics import Topic

View = tuple[int, str]
"""What a browser views: number of a tray and name of a layer."""

_TOPICS = {'tray': topics.RECTIFIED, 'tracks': topics.TRACKS, 'motion': topics.MOTION}
# Without a colour image for so long, the camera is a gray one.
_GRAY_AFTER_S = 2.0
# A larger age means a recording.
_MAX_AGE_S = 60.0
_LAST_ONLY = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.RELIABLE
)


class ViewedImages:
    """Subscribes to the images that are viewed, and passes them on encoded.

    Parameters
    ----------
    node : NanorocksNode
    show : callable
        Takes a view and the image as a browser needs it.
    pause_s : float, [s]
        Between two images of a view.
    """

    def __init__(
        self, node: NanorocksNode, show: Callable[[View, bytes], None], pause_s: float
    ) -> None:
        self._node, self._show, self._pause_s = node, show, pause_s
        self._subscriptions: dict[View, list[Subscription]] = {}
        self._received_at: dict[View, float] = {}

    def follow(self, wanted: Set[View]) -> None:
        """Subscribe to the images of these views, and to no others."""
        for view in self._subscriptions.keys() - wanted:
            for subscription in self._subscriptions.pop(view):
                self._node.destroy_subscription(subscription)
        for view in wanted - self._subscriptions.keys():
            self._received_at[view] = time.monotonic()
            self._subscriptions[view] = [self._subscribe(view, _TOPICS[view[1]])]
        for view, subscriptions in self._subscriptions.items():
            missing = time.monotonic() - self._received_at[view] > _GRAY_AFTER_S
            if view[1] == 'tray' and missing and len(subscriptions) == 1:
                subscriptions.append(self._subscribe(view, topics.GRAY))

    def _subscribe(self, view: View, topic: Topic) -> Subscription:
        where = self._node.resolve_topic_name(topic.of(view[0]))
        return self.subscribe_throttled(
            topic, view[0], partial(self._receive, view, where), self._pause_s
        )

    def _receive(self, view: View, where: str, message: Image) -> None:
        self._received_at[view] = time.monotonic()
        # A motion mask has no colours.
        read = gray_frame if view[1] == 'motion' else gray_or_bgr_frame
        frame = read(message, where)
        self._show(view, encoded(view[1], frame.image))
        age_s = 1e-9 * (self._node.get_clock().now().nanoseconds - frame.stamp_ns)
        if 0.0 <= age_s < _MAX_AGE_S:
            age = f'{1e3 * age_s:.0f}'
            self._node.diagnostics.values['picture, since the camera took it [ms]'] = age

    def subscribe_throttled(
        self, topic: Topic, tray: int, callback: Callable[[Any], None], pause_s: float
    ) -> Subscription:
        """Subscribe; messages within the pause after another are not even deserialized."""
        message_type = message_class(topic.type)
        due_s = 0.0

        def receive(content: bytes) -> None:
            nonlocal due_s
            now = time.monotonic()
            if now >= due_s:
                due_s = now + pause_s
                message = deserialize_message(content, message_type)
                self._node.diagnostics.process(callback, message)

        return self._node.create_subscription(
            message_type, topic.of(tray), receive, _LAST_ONLY, raw=True
        )
