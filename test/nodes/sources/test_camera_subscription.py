"""Frames and camera_info over DDS: used, refused, missing."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('rclpy')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Float32MultiArray

from nanorocks_ros.experiment.lens import Camera as CameraModel
from nanorocks_ros.nodes.base.communication.ros_messages import (
    camera_info_message,
    image_message,
    qos_of,
)
from nanorocks_ros.records import NS
from nanorocks_ros.wire import topics

from ..camera import Camera

SIZE = 240
CAMERA = CameraModel(width=SIZE, height=SIZE, focal=(110.0, 110.0), centre=(120.0, 120.0))


class FilmedTray:
    """A camera over tray 1 with camera_info, and what the preprocessor makes of its frames."""

    def __init__(self, graph, latched):
        self._graph = graph
        self._camera = graph.node.create_publisher(Image, topics.RAW.name, qos_of(topics.RAW))
        qos = qos_of(topics.CAMERA_INFO) if latched else QoSProfile(depth=5)
        self._lens = graph.node.create_publisher(CameraInfo, topics.CAMERA_INFO.name, qos)
        self.trays = []
        graph.node.create_subscription(
            Image, topics.GRAY.of(1), self.trays.append, qos_of(topics.GRAY)
        )
        # A cross through the middle stays, the grid around it is bent by the lens.
        pixels = np.full((SIZE, SIZE, 3), 120, np.uint8)
        pixels[::12] = 60
        pixels[:, ::12] = 60
        self.picture = pixels
        self._second = 0

    def send_camera_info(self, model='equidistant', frame_id='camera'):
        message = camera_info_message(0, frame_id, CAMERA)
        message.distortion_model = model
        self._lens.publish(message)

    def film(self):
        self._second += 1
        self._graph.until(lambda: self._camera.get_subscription_count() == 1)
        stamp_ns = self._second * 1_000_000_000
        pixels = self.picture + np.uint8(self._second % 5)
        self._camera.publish(image_message(stamp_ns, 'camera', pixels))

    def film_until(self, condition):
        def came_true():
            self.film()
            return condition()

        self._graph.until(came_true)

    def crops(self):
        return [np.frombuffer(tray.data, np.uint8).reshape(tray.height, -1) for tray in self.trays]


def straight(gray):
    """Whether the lines of the grid are straight: each column is dark all along, or nowhere."""
    dark = (gray < 95).mean(axis=0)
    return float(((dark > 0.9) | (dark < 0.25)).mean()) > 0.95


@pytest.mark.parametrize('latched', [True, False], ids=['latched', 'with each frame'])
def test_camera_info_straightens_the_trays(graph, latched):
    camera = FilmedTray(graph, latched)
    if latched:
        camera.send_camera_info()
    process = graph.start('preprocessor')
    graph.until(lambda: camera._lens.get_subscription_count() >= 1)

    def bent():
        if not latched:
            camera.send_camera_info()
        # The grid is straight in the frame: what the lens straightens, it bends.
        return bool(camera.trays) and not straight(camera.crops()[-1])

    camera.film_until(bent)
    assert graph.interrupt(process).code == 0


def test_an_unknown_distortion_model_is_refused_with_the_remedy(graph):
    camera = FilmedTray(graph, latched=True)
    camera.send_camera_info('fov')
    process = graph.start('preprocessor')
    error = "/nanorocks/camera/camera_info: distortion model 'fov' is not supported; calibrate for"
    camera.film_until(lambda: error in graph.output(process))
    assert 'or set preprocess.calibration' in graph.output(process)
    assert not camera.trays
    ended = graph.interrupt(process)
    assert ended.code == 0
    assert 'Traceback' not in ended.output


def test_a_camera_without_camera_info_is_assumed_to_be_undistorted(graph):
    camera = FilmedTray(graph, latched=True)
    graph.node.destroy_publisher(camera._lens)
    process = graph.start('preprocessor')
    camera.film_until(lambda: camera.trays)
    graph.until(lambda: 'the image is assumed to be undistorted' in graph.output(process))
    assert straight(camera.crops()[-1])
    assert graph.interrupt(process).code == 0


@pytest.mark.parametrize(
    ('bad', 'message'),
    [
        ({'encoding': 'bayer_rggb16'}, "encoding 'bayer_rggb16' is not supported"),
        ({'size': 300}, 'the frame size changed from 240x240 to 300x300 px'),
    ],
)
def test_a_frame_that_cannot_be_used_is_refused_and_the_next_one_is_not(graph, bad, message):
    camera = Camera(graph)
    process = graph.start('preprocessor')
    camera.publish_until_seen(1)
    camera.publish(**bad)
    graph.until(lambda: message in graph.output(process))
    camera.publish_until_seen(2)
    (line,) = (line for line in graph.output(process).splitlines() if message in line)
    assert '/nanorocks/camera/image_raw: ' in line
    graph.until(lambda: DiagnosticStatus.ERROR in camera.levels)
    ended = graph.interrupt(process)
    assert ended.code == 0
    assert 'Traceback' not in ended.output


def test_missing_frames_are_reported_and_counted(graph):
    camera = Camera(graph)
    process = graph.start('preprocessor')
    for second in (*range(1, 25), 28, 29):
        before = len(camera.trays)
        # Of other brightness, or they would be left out as the same frame again.
        camera.publish(second=second, level=60 + 2 * second)
        graph.until(lambda before=before: len(camera.trays) > before)
    warning = '/nanorocks/camera/image_raw: 3 frames missing so far (gaps between the time stamps)'
    graph.until(lambda: warning in graph.output(process))
    graph.until(lambda: camera.values.get('frames missing') == '3')
    assert graph.interrupt(process).code == 0


@pytest.mark.parametrize(
    ('node', 'away'),
    [
        (['preprocessor'], 2_000_000_000),
        (['pipeline', 'source:=topic'], 2_000_000_000),
        (['pipeline', 'source:=topic'], -3600),
    ],
    ids=['preprocessor, in 63 years', 'pipeline, in 63 years', 'pipeline, 1 hour ago'],
)
def test_a_lone_far_stamp_is_told_and_dropped(graph, node, away):
    camera, epochs, states = Camera(graph), [], []
    graph.node.create_subscription(Time, topics.EPOCH.name, epochs.append, qos_of(topics.EPOCH))
    graph.node.create_subscription(
        Float32MultiArray, topics.STATE.of(1), states.append, qos_of(topics.STATE)
    )
    process = graph.start(*node)
    start = 10_000
    far = start + 6 + away
    if away > 0:
        # Nor must it become the epoch.
        camera.publish(second=far)
    for count, second in enumerate(range(start, start + 12), 1):
        if count == 6:
            camera.publish(second=far)
        camera.publish(second=second, level=60 + 3 * count)
        graph.until(lambda count=count: count == 1 or len(states) >= count)
    assert {epoch.sec for epoch in epochs} == {start}
    assert [round(state.data[0]) for state in states] == list(range(12))
    graph.until(lambda: camera.values.get('refused') == ('2' if away > 0 else '1'))
    output = graph.output(process)
    assert f'impossible time stamp {far * NS} ns' in output
    for word in ('missing', 'went back', 'afresh', 'Traceback'):
        assert word not in output
    assert graph.interrupt(process).code == 0


def test_the_camera_info_of_another_camera_is_told(graph):
    statuses = []
    graph.node.create_subscription(
        DiagnosticArray, '/diagnostics', lambda message: statuses.extend(message.status), 10
    )
    camera = FilmedTray(graph, latched=True)
    camera.send_camera_info(frame_id='left')
    process = graph.start('preprocessor')
    camera.film_until(lambda: camera.trays)
    lens = "frame_id 'left', but the images"
    camera.film_until(lambda: statuses and lens in statuses[-1].message)
    assert statuses[-1].level == DiagnosticStatus.WARN
    assert graph.interrupt(process).code == 0
