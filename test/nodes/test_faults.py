"""Nodes that are killed, and cameras and publishers that are not as expected, over real DDS.

``python -m pytest -q test/nodes/test_faults.py`` prints the table of docs/reference/nodes.md.
"""

from __future__ import annotations

import time

import numpy as np
import pytest
from camera_pictures import ENCODINGS

pytest.importorskip('rclpy')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import Image
from std_msgs.msg import Float32MultiArray

from nanorocks_ros.nodes.base.communication.ros_messages import image_message, qos_of
from nanorocks_ros.records import NS
from nanorocks_ros.wire import topics

SMALL = ('width_px:=240', 'height_px:=240', 'first_shake:=0.5', 'frame_rate:=10.0')
SIZE = 240
SEPARATE = (
    'simulator',
    'preprocessor',
    'speed_estimator',
    'cluster_autocorrelator',
    'haff_fitter',
)
# Nodes compile and start on any machine.
_PATIENCE_S = 150.0
_QUIET_S = 3.0


class Heard:
    """Counts the messages of each result of tray 1."""

    def __init__(self, graph, watched):
        self._graph = graph
        self.messages = {topic: [] for topic in watched}
        for topic, messages in self.messages.items():
            graph.node.create_subscription(
                Float32MultiArray, topic.of(1), messages.append, qos_of(topic)
            )

    def drain(self):
        """Wait until no more results come: those of a source that is gone."""
        seen, since = -1, time.monotonic()
        while time.monotonic() - since < _QUIET_S:
            if seen != (seen := sum(map(len, self.messages.values()))):
                since = time.monotonic()
            self._graph.executor.spin_once(timeout_sec=0.05)

    def after(self, action, *awaited):
        """Do something; the time until new messages come of all topics, [s]."""
        action()
        start = time.monotonic()
        for messages in self.messages.values():
            messages.clear()
        self._graph.until(lambda: all(self.messages[topic] for topic in awaited), _PATIENCE_S)
        return time.monotonic() - start


def kill(graph, process):
    """Kill a node, and let the graph take in what it had sent."""
    process.kill()
    process.wait()
    end = time.monotonic() + 0.5
    graph.until(lambda: time.monotonic() > end)


def test_pipeline_and_its_camera_survive_the_loss_of_the_other(graph, fault_table):
    heard = Heard(graph, [topics.SPEED])
    running = {}

    def start(name):
        parameters = SMALL if name == 'simulator' else ('source:=topic',)
        running[name] = graph.start(name, *parameters)

    start('pipeline')
    image = graph.node.resolve_topic_name(topics.RAW.name)
    graph.until(lambda: graph.node.count_subscribers(image) == 1, _PATIENCE_S)
    heard.after(lambda: start('simulator'), topics.SPEED)
    for name, told in {'pipeline': 'its results', 'simulator': 'the results'}.items():
        kill(graph, running[name])
        heard.drain()
        seconds = heard.after(lambda name=name: start(name), topics.SPEED)
        other = ' of a `pipeline`' if name == 'simulator' else ''
        fault_table(f'`{name}`{other} killed and started again', f'{told} come again', seconds)
    for process in running.values():
        assert graph.interrupt(process).code == 0


def test_separate_nodes_start_in_any_order_and_each_may_be_killed(graph, fault_table):
    results = topics.SPEED, topics.CLUSTER, topics.COR
    heard = Heard(graph, results)
    running = {}

    def start(name):
        # Cycles that are short, so that a node that starts anew sees a whole one soon.
        parameters = (*SMALL, 'shake_period:=12.0') if name == 'simulator' else ()
        running[name] = graph.start(name, *parameters)

    def start_from_the_last_to_the_first():
        for name in reversed(SEPARATE):
            start(name)
            graph.until(lambda name=name: name in graph.node.get_node_names(), _PATIENCE_S)

    seconds = heard.after(start_from_the_last_to_the_first, *results)
    fault_table('separate nodes started in reversed order', 'all results come', seconds)
    for name in SEPARATE:
        kill(graph, running[name])
        seconds = heard.after(lambda name=name: start(name), *results)
        fault_table(f'separate `{name}` killed and started again', 'all results come', seconds)
    for process in running.values():
        ended = graph.interrupt(process)
        assert ended.code == 0, ended.output
        assert 'Traceback' not in ended.output


def test_every_encoding_gives_the_same_tray_image_and_silence_is_told(graph, fault_table):
    statuses = []
    graph.node.create_subscription(
        DiagnosticArray, '/diagnostics', lambda message: statuses.extend(message.status), 10
    )
    camera = graph.node.create_publisher(Image, topics.RAW.name, qos_of(topics.RAW))
    grays = []
    graph.node.create_subscription(Image, topics.GRAY.of(1), grays.append, qos_of(topics.GRAY))
    number = 0
    for kind in ('bgr8', 'rgb8', 'mono8'):
        # Another kind of picture, when the camera was set while it ran, is refused.
        process = graph.start('preprocessor')
        graph.until(lambda: camera.get_subscription_count() == 1)
        grays.clear()
        sending = [name for name, (_, frame) in ENCODINGS.items() if frame == kind]
        for count, encoding in enumerate(sending, 1):
            # Another brightness each, or the frame would be left out as the same one again.
            number += 1
            level = 60 + 8 * number
            pixels = ENCODINGS[encoding][0](np.full((SIZE, SIZE, 3), level, np.uint8))
            message = image_message(number * NS, 'camera', np.ascontiguousarray(pixels), encoding)
            camera.publish(message)
            graph.until(lambda count=count: len(grays) >= count)
            gray = np.frombuffer(grays[-1].data, np.uint8)
            # YUV has rounding.
            assert np.abs(gray.astype(int) - level).max() <= 2, encoding
            assert grays[-1].header.stamp == Time(sec=number)
        if kind != 'mono8':
            assert graph.interrupt(process).code == 0
            graph.until(lambda: camera.get_subscription_count() == 0)
    fault_table(f'a camera that sends {", ".join(ENCODINGS)}', 'the same tray image', None)
    # The camera stops, but its publisher is there.
    silent = '/nanorocks/camera/image_raw: no frame for'
    stopped = time.monotonic()
    for level in ('WARN', 'ERROR'):
        graph.until(
            lambda level=level: (
                statuses[-1].level == getattr(DiagnosticStatus, level)
                and statuses[-1].message.startswith(silent)
            )
        )
        fault_table('a silent camera that has a publisher', level, time.monotonic() - stopped)
    pixels = np.zeros((SIZE, SIZE), np.uint16)
    camera.publish(image_message(99 * NS, 'camera', pixels, 'bayer_rggb16'))
    graph.until(lambda: 'image_proc debayer_node' in statuses[-1].message)
    assert statuses[-1].level == DiagnosticStatus.ERROR
    fault_table('a camera of another encoding', 'ERROR, with the node that converts it', None)
    assert graph.interrupt(process).code == 0


def test_a_publisher_of_another_type_is_told_as_an_error_until_it_is_gone(graph, fault_table):
    statuses = []

    def receive(message):
        statuses.extend(status for status in message.status if status.name.endswith('haff_fitter'))

    graph.node.create_subscription(DiagnosticArray, '/diagnostics', receive, 10)
    other = graph.node.create_publisher(Image, topics.SPEED.of(1), 1)
    process = graph.start('haff_fitter')
    graph.until(lambda: statuses and statuses[-1].level == DiagnosticStatus.ERROR)
    text = statuses[-1].message
    assert 'listener publishes sensor_msgs/msg/Image, this node takes std_msgs/msg/Float' in text
    assert '-r /nanorocks/tray_1/speed:=/OTHER' in text
    assert text in graph.output(process)
    graph.node.destroy_publisher(other)
    graph.until(lambda: statuses[-1].level == DiagnosticStatus.WARN)
    fault_table('a publisher of another type', 'ERROR while it lasts', None)
    assert graph.interrupt(process).code == 0


def test_two_pipelines_with_the_same_results_are_told(graph, fault_table):
    for _ in range(2):
        last = graph.start('haff_fitter')
    graph.until(lambda: 'tray_1/cor: published by' in graph.output(last))
    assert '-r __ns:=/NAME' in graph.output(last)
    fault_table('two nodes with the same results', 'WARN, with both names', None)
