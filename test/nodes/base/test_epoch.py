"""The epoch is set by the first frame, and latched."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

from builtin_interfaces.msg import Time
from rclpy.qos import DurabilityPolicy, QoSProfile

from nanorocks_ros.wire import topics

from ..camera import Camera


def test_the_epoch_reaches_late_subscribers(graph):
    camera = Camera(graph)
    process = graph.start('preprocessor')
    camera.publish_until_seen(3)
    epochs = []
    qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    graph.node.create_subscription(Time, topics.EPOCH.name, epochs.append, qos)
    graph.until(lambda: epochs)
    # That of the first frame that arrived: earlier ones are lost until the preprocessor listens.
    assert 1 <= epochs[0].sec <= camera.trays[0].header.stamp.sec
    assert graph.interrupt(process).code == 0
