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

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import CompressedImage, Image

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.nodes.base.communication.ros_messages import (
    compressed_message,
    qos_of,
    stamp_of,
)
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.messages.image_messages import encode_jpeg
from nanorocks_ros.records import ClusterEstimate
from nanorocks_ros.settings import SimulationSettings, with_values
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.synthetic.film_bag import film_into_bag
from nanorocks_ros.wire import topics

from .result_arrays import SAMPLE, ResultArrays, assert_same_numbers

OWN_TRAY = """\
trays:
  3:
    dimensions_mm: [48, 15, 3.5]
    species:
      - {material: acrylic, diameter_mm: 2, count: 21}
"""


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


def crowded_statuses(graph, rate):
    """A pipeline that gets frames faster than it measures, and what it says meanwhile."""
    texts = []

    def keep(message):
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            if int(values.get('frames waiting for the trays', '0')) > 11:
                texts.append(' '.join((status.message, *values.values())))

    graph.node.create_subscription(DiagnosticArray, '/diagnostics', keep, 10)
    options = f'bag:={SAMPLE}', 'loop:=true', 'workers:=0'
    return graph.start('pipeline', 'source:=bag', f'rate:={rate}', *options), texts


def test_as_fast_as_possible_waiting_frames_are_no_problem(graph):
    process, texts = crowded_statuses(graph, rate=0.0)
    graph.until(lambda: len(texts) >= 2)
    assert [text for text in texts if 'too slow' in text] == []
    assert graph.interrupt(process).code == 0


def test_a_pace_that_the_pipeline_cannot_keep_is_a_problem(graph):
    process, texts = crowded_statuses(graph, rate=100.0)
    graph.until(lambda: any('frames wait for the trays' in text for text in texts))
    assert graph.interrupt(process).code == 0


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
    # Clusters wait a second longer than bodies.
    options = 'transport:=compressed', 'bodies.delay:=1.0'
    process = graph.start('pipeline', 'source:=topic', *options)
    name = graph.node.resolve_topic_name(topics.RAW_COMPRESSED.name)
    publisher = graph.node.create_publisher(
        CompressedImage, topics.RAW_COMPRESSED.name, qos_of(topics.RAW_COMPRESSED)
    )
    graph.until(lambda: graph.node.count_subscribers(name) == 1)
    graph.until(lambda: publisher.get_subscription_count() == 1)
    for frame in itertools.islice(BagFrames(SAMPLE).frames(), 120):
        jpeg = encode_jpeg(frame.image, 90)
        publisher.publish(compressed_message(frame.stamp_ns, 'camera', jpeg))
        # Slower than a camera, for a queue of ten pictures must not overflow.
        time.sleep(0.05)
    graph.until(lambda: len(arrays.messages[ClusterEstimate]) == 10)
    times = [message.data[0] for message in arrays.messages[ClusterEstimate]]
    assert times == pytest.approx([0.2 * k for k in range(10)], abs=0.04)
    assert graph.interrupt(process).code == 0


def test_a_played_bag_says_its_tray_and_so_does_the_recording_of_it(graph, tmp_path):
    bag, record = tmp_path / 'tray_3', tmp_path / 'recorded'
    trays_file = tmp_path / 'mine.yaml'
    trays_file.write_text(OWN_TRAY)
    settings = with_values(
        SimulationSettings(),
        {
            'tray': 3,
            'frame_rate': 10.0,
            'pixels_per_metre': 9000.0,
            'width_px': 480,
            'height_px': 176,
        },
        'test',
    )
    film_into_bag(
        bag,
        settings,
        duration=1.0,
        quality=90,
        progress=lambda *_: None,
        tray=load_trays(trays_file)[3],
        trays_file=str(trays_file),
    )
    trays_file.unlink()
    # A topic of tray 3 has a publisher only where the node knows the tray.
    process = graph.start(
        'pipeline',
        'source:=bag',
        f'bag:={bag}',
        'rate:=0.0',
        f'record:={record}',
        'workers:=0',
        'cooling.relation:=paper',
    )
    finished = graph.wait(process)
    assert finished.code == 0, finished.output
    assert 'is assumed' not in finished.output
    metadata = open_bag(record).metadata
    assert metadata['experiment.trays'] == '3'
    assert metadata['experiment.pixels_per_metre'] == '9000.0'
    assert metadata['experiment.trays_file'] == OWN_TRAY
    assert load_trays(metadata['experiment.trays_file'])[3].count == 21
    assert topics.SPEED.absolute(3) in open_bag(record).topics


def test_what_is_told_to_the_pipeline_replaces_what_the_bag_says(graph):
    process = graph.start(
        'pipeline', 'source:=bag', f'bag:={SAMPLE}', 'rate:=0.0', 'duration:=0.5',
        'preprocess.pixels_per_metre:=13400.0', 'workers:=0',
    )  # fmt: skip
    finished = graph.wait(process)
    assert finished.code == 0, finished.output
    assert finished.output.count('preprocess.pixels_per_metre 13400.0 is given and used') == 1
