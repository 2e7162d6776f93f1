"""Results go to their topics; images only while somebody subscribes."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('rclpy')

from sensor_msgs.msg import Image
from std_msgs.msg import Float32MultiArray

from nanorocks_ros.nodes.base.communication.ros_messages import qos_of
from nanorocks_ros.records import TrayImage, TrayState
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array

NS = 1_000_000_000


def tray_image(second):
    return TrayImage(stamp_ns=second * NS, tray=3, gray=np.full((4, 6), second, np.uint8))


def test_a_tray_image_is_published_as_state_and_as_image(own_node):
    node, spin_until = own_node
    states, grays = [], []
    node.create_subscription(
        Float32MultiArray, topics.STATE.of(3), states.append, qos_of(topics.STATE)
    )
    node.outputs.publish_result(tray_image(1), epoch_ns=0)
    assert node.diagnostics.counts['published'] == 1
    node.create_subscription(Image, topics.GRAY.of(3), grays.append, qos_of(topics.GRAY))
    spin_until(lambda: node.outputs.has_subscribers(topics.GRAY, 3))
    node.outputs.publish_result(tray_image(2), epoch_ns=0)
    node.outputs.publishes_images = False
    node.outputs.publish_result(tray_image(3), epoch_ns=0)
    assert node.diagnostics.counts['published'] == 4

    def last_state():
        return from_array(TrayState, states[-1].data, tray=3, epoch_ns=0, where='test')

    # The last image was published as a state alone.
    spin_until(lambda: bool(states) and last_state().stamp_ns == 3 * NS and bool(grays))
    assert [bytes(gray.data) for gray in grays] == [bytes([2] * 24)]


def test_a_topic_is_offered_once_and_others_are_seen(own_node):
    node, spin_until = own_node
    node.outputs.offer((topics.EPOCH,))
    node.outputs.offer((topics.EPOCH,))
    assert node.outputs.is_offered(topics.EPOCH)
    spin_until(lambda: node.count_publishers(topics.EPOCH.name) == 1)
    assert not node.outputs.is_offered_by_others(topics.EPOCH)
    assert not node.outputs.is_offered(topics.TAKEN)


def test_what_is_published_is_recorded(own_node):
    class Recorder:
        def __init__(self):
            self.results = []

        def record_result(self, topic, message, tray):
            self.results.append((topic, tray))

    node, _ = own_node
    node.outputs.recorder = Recorder()
    node.outputs.publish_result(tray_image(1), epoch_ns=0)
    assert node.outputs.recorder.results == [(topics.STATE, 3)]
