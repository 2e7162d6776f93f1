"""The fitter as a node: arrays that it cannot use."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

from std_msgs.msg import Float32MultiArray

from nanorocks_ros.nodes.base.communication.ros_messages import qos_of
from nanorocks_ros.wire import topics


def test_an_array_of_another_release_is_refused(graph):
    publisher = graph.node.create_publisher(
        Float32MultiArray, topics.SPEED.of(1), qos_of(topics.SPEED)
    )
    process = graph.start('haff_fitter')
    graph.until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(Float32MultiArray(data=[1.0, 2.0]))
    graph.until(lambda: '2 elements where SpeedEstimate has 15' in graph.output(process))
    assert graph.interrupt(process).code == 0
