"""Records survive the way through a ROS message and back."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('rclpy')

from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message

from nanorocks_ros.experiment.lens import Camera
from nanorocks_ros.nodes.base.communication.ros_messages import (
    array_message,
    camera_info_message,
    compressed_message,
    image_message,
    message_class,
    qos_of,
    stamp_of,
    time_message,
)
from nanorocks_ros.recordings.messages.camera_info import view_from_message
from nanorocks_ros.recordings.messages.image_messages import (
    encode_jpeg,
    frame_from_compressed,
    frame_from_image,
)
from nanorocks_ros.records import Merge
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import layout, to_array

STAMP_NS = 1_700_000_000_123_456_789


def transported(message):
    return deserialize_message(serialize_message(message), type(message))


def test_a_stamp_keeps_its_nanoseconds():
    assert stamp_of(transported(time_message(STAMP_NS))) == STAMP_NS


@pytest.mark.parametrize(('shape', 'encoding'), [((6, 8, 3), 'bgr8'), ((6, 8), 'mono8')])
def test_an_image_keeps_its_pixels(shape, encoding):
    pixels = np.arange(np.prod(shape), dtype=np.uint8).reshape(shape)
    # Rows in another order in memory, as a crop or a transposed image has them.
    message = transported(image_message(STAMP_NS, 'camera', pixels[::-1]))
    frame = frame_from_image(message, 'test')
    assert (frame.stamp_ns, frame.encoding) == (STAMP_NS, encoding)
    np.testing.assert_array_equal(frame.image, pixels[::-1])


def test_an_autocorrelation_travels_as_float32():
    values = np.linspace(-1.0, 1.0, 12, dtype=np.float32).reshape(3, 4)
    message = transported(image_message(STAMP_NS, 'tray_1', values))
    assert (message.encoding, message.step) == ('32FC1', 16)
    np.testing.assert_array_equal(np.frombuffer(message.data, np.float32).reshape(3, 4), values)


def test_a_jpeg_is_decoded_again():
    pixels = np.full((16, 24, 3), 90, np.uint8)
    message = compressed_message(STAMP_NS, 'camera', encode_jpeg(pixels, 95))
    frame = frame_from_compressed(transported(message), 'test')
    assert frame.stamp_ns == STAMP_NS
    assert np.abs(frame.image.astype(int) - 90).max() <= 2


def test_a_record_survives_as_array():
    merge = Merge(
        stamp_ns=STAMP_NS + 10**9,
        known_ns=STAMP_NS + 2 * 10**9,
        tray=2,
        cycle=3,
        tracks=np.array([4, 5], dtype=np.int32),
        joins=True,
    )
    values = to_array(merge, STAMP_NS)
    message = transported(array_message(merge, STAMP_NS))
    assert message.layout.dim[0].label == layout(Merge).label
    assert message.layout.dim[0].size == len(values)
    np.testing.assert_allclose(message.data, values, rtol=1e-6)


def test_camera_info_gives_the_same_camera():
    camera = Camera(width=64, height=48, focal=(30.0, 31.0), centre=(32.5, 24.5))
    view = view_from_message(transported(camera_info_message(STAMP_NS, 'camera', camera)), 'test')
    np.testing.assert_allclose(view.camera.matrix, camera.matrix)
    assert (view.camera.width, view.camera.height) == (64, 48)


@pytest.mark.parametrize('topic', topics.TOPICS, ids=lambda topic: topic.name)
def test_every_topic_has_an_installed_type_and_a_reliable_qos(topic):
    package, _, name = topic.type.split('/')
    assert message_class(topic.type).__module__.startswith(f'{package}.msg')
    assert message_class(topic.type).__name__ == name
    qos = qos_of(topic)
    assert qos.reliability == ReliabilityPolicy.RELIABLE
    assert (qos.durability == DurabilityPolicy.TRANSIENT_LOCAL) is topic.latched
    assert qos.depth == topic.depth
