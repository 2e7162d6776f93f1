"""The pipeline over real DDS: from a bag and from a camera, with the numbers of an analysis."""

from __future__ import annotations

import itertools
import os
import signal
import time
from collections import defaultdict

import numpy as np
import pytest

pytest.importorskip('rclpy')

from sensor_msgs.msg import CompressedImage, Image

from nanorocks_ros.nodes.base.ros_messages import compressed_message, qos_of, stamp_of
from nanorocks_ros.recordings.messages.image_messages import encode_jpeg
from nanorocks_ros.records import ClusterEstimate
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.wire import topics

from .result_arrays import SAMPLE, ResultArrays, assert_same_numbers


@pytest.mark.parametrize('workers', [0, 1])
def test_a_bag_through_the_pipeline_gives_the_same_numbers_live_as_offline(graph, workers):
    arrays = ResultArrays(graph.node)
    process = graph.start(
        'pipeline', 'source:=bag', f'bag:={SAMPLE}', 'rate:=4.0', f'workers:={workers}'
    )
    finished = graph.wait(process)
    assert finished.code == 0, finished.output
    assert 'Traceback' not in finished.output
    assert_same_numbers(arrays, rounding=0.0)


def test_ctrl_c_ends_the_pipeline_and_its_processes(graph):
    process = graph.start('pipeline', 'source:=topic', 'workers:=2', 'trays:=[1,2]',
                          'preprocess.layout:=plate')  # fmt: skip
    graph.until(lambda: graph.node.count_subscribers('/nanorocks/camera/image_raw') > 0)
    with open(f'/proc/{process.pid}/task/{process.pid}/children', encoding='utf-8') as listed:
        children = [int(pid) for pid in listed.read().split()]
    assert len(children) >= 2
    # As a terminal does.
    for pid in children:
        os.kill(pid, signal.SIGINT)
    finished = graph.interrupt(process)
    assert finished.code == 0, finished.output
    assert 'Traceback' not in finished.output
    graph.until(lambda: not any(os.path.exists(f'/proc/{pid}') for pid in children))


def test_images_are_published_when_somebody_subscribes(graph):
    seen = defaultdict(list)
    wanted = (
        topics.RAW,
        topics.GRAY,
        topics.RECTIFIED,
        topics.MOTION,
        topics.TRACKS,
        topics.AUTOCORRELATION,
    )
    for topic in wanted:
        graph.node.create_subscription(Image, topic.of(1), seen[topic.name].append, qos_of(topic))
    process = graph.start('pipeline', 'source:=bag', f'bag:={SAMPLE}', 'loop:=true')
    graph.until(lambda: all(seen[topic.name] for topic in wanted))
    assert graph.interrupt(process).code == 0
    encodings = {name: messages[0].encoding for name, messages in seen.items()}
    assert encodings == {
        topics.RAW.name: 'bgr8',
        topics.GRAY.name: 'mono8',
        topics.RECTIFIED.name: 'bgr8',
        topics.MOTION.name: 'mono8',
        topics.TRACKS.name: 'bgr8',
        topics.AUTOCORRELATION.name: '32FC1',
    }
    for messages in seen.values():
        image = messages[0]
        assert len(image.data) == image.step * image.height
        assert stamp_of(image.header.stamp) > 0
    mask = np.frombuffer(seen[topics.MOTION.name][0].data, np.uint8)
    assert set(np.unique(mask)) <= {0, 255}
    picture = seen[topics.AUTOCORRELATION.name][0]
    values = np.frombuffer(picture.data, np.float32).reshape(picture.height, picture.width)
    assert values[picture.height // 2, picture.width // 2] == pytest.approx(1.0)


def test_a_namespace_moves_the_whole_graph(graph):
    arguments = ('-r', '__ns:=/lab')
    process = graph.start('pipeline', 'source:=bag', f'bag:={SAMPLE}', arguments=arguments)
    names = lambda: {name for name, _ in graph.node.get_topic_names_and_types()}  # noqa: E731
    graph.until(lambda: '/lab/tray_1/speed' in names())
    assert not any(name.startswith('/nanorocks/tray') for name in names())
    assert graph.interrupt(process).code == 0


def test_the_pipeline_takes_a_camera_topic_and_sets_the_epoch_itself(graph):
    arrays = ResultArrays(graph.node)
    process = graph.start('pipeline', 'source:=topic', 'transport:=compressed')
    name = graph.node.resolve_topic_name(topics.RAW_COMPRESSED.name)
    publisher = graph.node.create_publisher(
        CompressedImage, topics.RAW_COMPRESSED.name, qos_of(topics.RAW_COMPRESSED)
    )
    graph.until(lambda: graph.node.count_subscribers(name) == 1)
    graph.until(lambda: publisher.get_subscription_count() == 1)
    # Those of clusters are held back for two seconds.
    for frame in itertools.islice(BagFrames(SAMPLE).frames(), 120):
        jpeg = encode_jpeg(frame.image, 90)
        publisher.publish(compressed_message(frame.stamp_ns, 'camera', jpeg))
        # Slower than a camera, for a queue of ten pictures must not overflow.
        time.sleep(0.05)
    graph.until(lambda: len(arrays.messages[ClusterEstimate]) == 10)
    times = [message.data[0] for message in arrays.messages[ClusterEstimate]]
    assert times == pytest.approx([0.2 * k for k in range(10)], abs=0.04)
    assert graph.interrupt(process).code == 0
