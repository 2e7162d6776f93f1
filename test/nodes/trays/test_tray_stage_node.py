"""Nodes behind the tray images refuse unusable images and continue."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('rclpy')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image

from nanorocks_ros.nodes.base.communication.ros_messages import image_message, qos_of
from nanorocks_ros.wire import topics

NS = 1_000_000_000


@pytest.mark.parametrize('name', ['speed_estimator', 'cluster_autocorrelator'])
def test_a_stage_refuses_crops_that_it_cannot_use_and_goes_on(graph, name):
    crops = graph.node.create_publisher(Image, topics.GRAY.of(1), qos_of(topics.GRAY))
    epoch = graph.node.create_publisher(Time, topics.EPOCH.name, qos_of(topics.EPOCH))
    epoch.publish(Time(sec=1))
    counts = {}
    graph.node.create_subscription(
        DiagnosticArray,
        '/diagnostics',
        lambda message: counts.update(
            {pair.key: pair.value for status in message.status for pair in status.values}
        ),
        10,
    )
    process = graph.start(name)
    graph.until(lambda: crops.get_subscription_count() == 1)
    random = np.random.default_rng(1)
    shapes = [(200, 200)] * 4 + [(200, 200, 3), (206, 200)] * 3 + [(200, 200)] * 4
    # The publisher was given another scale.
    shapes += [(206, 200)] * 12
    for k, shape in enumerate(shapes):
        pixels = random.integers(0, 255, shape).astype(np.uint8)
        crops.publish(image_message(NS + k * NS // 30, 'x', pixels))
    graph.until(lambda: counts.get('received') and int(counts['received']) >= len(shapes))
    graph.until(lambda: counts.get('refused') == '15')
    finished = graph.interrupt(process)
    assert finished.code == 0
    assert "image_gray: encoding 'bgr8' where gray is expected" in finished.output
    assert 'the size changed from 200x200 px to 200x206 px' in finished.output
    assert 'image_gray: the image size changed; the stage of the tray was reset' in finished.output
    assert 'Traceback' not in finished.output
