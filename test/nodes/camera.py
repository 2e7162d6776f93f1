"""A camera over tray 1 for tests, and what the preprocessor makes of its frames."""

from __future__ import annotations

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image

from nanorocks_ros.nodes.base.communication.ros_messages import image_message, qos_of
from nanorocks_ros.wire import topics


class Camera:
    """Publishes frames, and keeps the tray images and diagnostics of the preprocessor."""

    def __init__(self, graph):
        self._graph = graph
        self._publisher = graph.node.create_publisher(Image, topics.RAW.name, qos_of(topics.RAW))
        self.trays = []
        self.levels = []
        self.values = {}
        graph.node.create_subscription(
            Image, topics.GRAY.of(1), self.trays.append, qos_of(topics.GRAY)
        )
        graph.node.create_subscription(DiagnosticArray, '/diagnostics', self._diagnostics, 10)
        self._second = 0

    def _diagnostics(self, message):
        self.levels += [status.level for status in message.status]
        self.values.update(
            {pair.key: pair.value for status in message.status for pair in status.values}
        )

    def publish(self, encoding=None, size=240, second=None, level=90):
        self._graph.until(lambda: self._publisher.get_subscription_count() == 1)
        self._second = self._second + 1 if second is None else second
        pixels = np.full((size, size, 3), level, np.uint8)
        stamp_ns = self._second * 1_000_000_000
        self._publisher.publish(image_message(stamp_ns, 'camera', pixels, encoding))

    def publish_until_seen(self, count):
        def seen():
            self.publish()
            return len(self.trays) >= count

        self._graph.until(seen)
