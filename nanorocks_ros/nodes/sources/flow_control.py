"""Keeps a player from sending frames faster than the nodes process them.

A message that has arrived need not have been processed: a subscription keeps the last few and
drops others without notice. So the nodes of the graph acknowledge on `camera/taken` each frame
that they have processed, as long as somebody subscribes to that topic.
"""

from __future__ import annotations

import time
from collections import deque
from typing import TYPE_CHECKING

from std_msgs.msg import Header

from nanorocks_ros.nodes.base.communication.ros_messages import node_name_of, qos_of, stamp_of
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from rclpy.subscription import Subscription

    from nanorocks_ros.nodes.base.node import NanorocksNode

# Fewer than the frames that a subscription to the camera keeps.
_MAX_IN_FLIGHT = 4
_PATIENCE_S = 5.0
_PROBE_S = 0.2
_DISCOVERY_S = 0.1
_MAX_REMEMBERED = 1000


class FlowControl:
    """Knows the nodes that process the camera, and which frame each has processed last.

    Parameters
    ----------
    node : NanorocksNode
        That sends the frames.
    """

    def __init__(self, node: NanorocksNode) -> None:
        self._node = node
        self._sent: deque[tuple[int, int]] = deque(maxlen=_MAX_REMEMBERED)
        self._last_number = 0
        self._processed: dict[str, int] = {}
        self._acknowledging: set[str] = set()
        self._unresponsive: set[str] = set()
        self._waiting_since = self._probed_at = 0.0
        self._discovered_at = self._counted_at = -_DISCOVERY_S
        self._listener_count = 0
        self._subscription: Subscription | None = None

    def start(self) -> None:
        """Subscribe to the acknowledgements."""
        if self._subscription is None:
            self._subscription = self._node.create_subscription(
                Header, topics.TAKEN.name, self._receive, qos_of(topics.TAKEN)
            )

    def listener_count(self) -> int:
        """How many nodes process the camera, or the tray images made from it."""
        now = time.monotonic()
        if now - self._counted_at >= _DISCOVERY_S:
            self._counted_at = now
            cameras = (topics.RAW, topics.RAW_COMPRESSED)
            subscriptions = sum(
                self._node.outputs.publisher(topic).get_subscription_count() for topic in cameras
            )
            subscribers = {
                node_name_of(endpoint)
                for topic in cameras
                for endpoint in self._node.get_subscriptions_info_by_topic(
                    self._node.resolve_topic_name(topic.name)
                )
            }
            self._listener_count = subscriptions + len(self._discovered() - subscribers)
        return self._listener_count

    def note_sent(self, stamp_ns: int) -> None:
        """Note a frame that was sent."""
        self._last_number += 1
        self._sent.append((stamp_ns, self._last_number))

    def is_ready(self) -> bool:
        """Whether the slowest node has processed enough frames to be sent another one."""
        now = time.monotonic()
        self._discover(now)
        slow = {
            name
            for name, number in self._processed.items()
            if self._last_number - number >= _MAX_IN_FLIGHT and name not in self._unresponsive
        }
        if not slow:
            self._waiting_since = self._probed_at = now
            return True
        if now - self._waiting_since > _PATIENCE_S:
            self._unresponsive |= slow
            self._node.get_logger().warning(
                f'{" and ".join(sorted(slow))}: no frame acknowledged for {_PATIENCE_S:g} s; '
                'playback continues without waiting until the next acknowledgement'
            )
        elif not slow & self._acknowledging and now - self._probed_at > _PROBE_S:
            # The node may have processed all frames before it discovered our subscription.
            self._probed_at = now
            return True
        return False

    def _discover(self, now: float) -> None:
        if now - self._discovered_at < _DISCOVERY_S:
            return
        self._discovered_at = now
        names = self._discovered()
        # A new node has missed what was sent before.
        self._processed = {name: self._processed.get(name, self._last_number) for name in names}
        self._acknowledging &= names
        self._unresponsive &= names

    def _discovered(self) -> set[str]:
        """Names of the nodes that acknowledge frames."""
        topic = self._node.resolve_topic_name(topics.TAKEN.name)
        endpoints = self._node.get_publishers_info_by_topic(topic)
        own_name = self._node.get_fully_qualified_name()
        return {node_name_of(endpoint) for endpoint in endpoints} - {own_name}

    def _receive(self, message: Header) -> None:
        stamp_ns = stamp_of(message.stamp)
        number = next((k for stamp, k in reversed(self._sent) if stamp == stamp_ns), None)
        if number is not None:
            self._processed[message.frame_id] = number
            self._acknowledging.add(message.frame_id)
            self._unresponsive.discard(message.frame_id)
            self._waiting_since = time.monotonic()
