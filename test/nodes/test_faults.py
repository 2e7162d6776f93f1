"""Cameras and publishers that are not as a node expects them, over real DDS.

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

from nanorocks_ros.nodes.base.ros_messages import image_message, qos_of
from nanorocks_ros.records import NS
from nanorocks_ros.wire import topics

SIZE = 240


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
