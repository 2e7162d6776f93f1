"""The lens over DDS: latched or sent with each frame, known or refused."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('rclpy')

from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo, Image

from nanorocks_ros.experiment.lens import Camera
from nanorocks_ros.nodes._shell import image_message, lens_message, qos_of
from nanorocks_ros.wire import topics

SIZE = 240
LENS = Camera(width=SIZE, height=SIZE, focal=(110.0, 110.0), centre=(120.0, 120.0))


class FilmedTray:
    """A camera over tray 1 that tells its lens, and what the preprocessor makes of it."""

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

    def tell(self, model='equidistant'):
        message = lens_message(0, 'camera', LENS)
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
def test_a_lens_that_is_told_straightens_the_trays(graph, latched):
    camera = FilmedTray(graph, latched)
    if latched:
        camera.tell()
    process = graph.start('preprocessor')
    graph.until(lambda: camera._lens.get_subscription_count() >= 1)

    def bent():
        if not latched:
            camera.tell()
        # The grid is straight in the frame: what the lens straightens, it bends.
        return bool(camera.trays) and not straight(camera.crops()[-1])

    camera.film_until(bent)
    assert graph.interrupt(process).code == 0


def test_an_unknown_lens_is_refused_with_the_remedy(graph):
    camera = FilmedTray(graph, latched=True)
    camera.tell('fov')
    process = graph.start('preprocessor')
    said = "/nanorocks/camera/camera_info: distortion model 'fov' is not supported; calibrate for"
    camera.film_until(lambda: said in graph.output(process))
    assert 'or set preprocess.calibration' in graph.output(process)
    assert not camera.trays
    ended = graph.interrupt(process)
    assert ended.code == 0
    assert 'Traceback' not in ended.output


def test_a_camera_that_tells_nothing_is_taken_as_straight_and_that_is_said(graph):
    camera = FilmedTray(graph, latched=True)
    graph.node.destroy_publisher(camera._lens)
    process = graph.start('preprocessor')
    camera.film_until(lambda: camera.trays)
    graph.until(lambda: 'the picture is taken as straight' in graph.output(process))
    assert straight(camera.crops()[-1])
    assert graph.interrupt(process).code == 0
