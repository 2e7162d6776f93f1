"""A live pipeline finds the diameters that its trays file leaves open, or says what to do."""

from __future__ import annotations

import cv2
import pytest

pytest.importorskip('rclpy')

from diagnostic_msgs.msg import DiagnosticArray
from drawn_discs import SIZE, disc_frames
from sensor_msgs.msg import Image

from nanorocks_ros.cli.main import main
from nanorocks_ros.nodes.base.communication.ros_messages import image_message, qos_of
from nanorocks_ros.wire import topics

SCALE, DIAMETER_PX = 8000.0, 20.0
FRAME_NS = 250_000_000
_PATIENCE_S = 120.0
TRAY = f"""\
film: {{pixels_per_metre: {SCALE:g}, region_px: [0, 0, {SIZE[0]}, {SIZE[1]}], container: assumed}}
trays:
  1:
    dimensions_mm: [{1e3 * SIZE[0] / SCALE:g}, {1e3 * SIZE[1] / SCALE:g}]
    species:
      - {{SPECIES}}
"""


@pytest.fixture(scope='module')
def frames():
    return disc_frames([(40, 40, 40)])


def trays_file(folder, species):
    path = folder / 'mine.yaml'
    path.write_text(TRAY.replace('SPECIES', species), encoding='utf-8')
    return path


def found_diameter(words):
    """The diameter in what was said, [m]."""
    return 1e-3 * float(words.split('diameter_mm: ')[1].split()[0])


class LiveCamera:
    """Publishes frames again and again, and keeps what the nodes say of themselves."""

    def __init__(self, graph, frames):
        self._frames, self._number = frames, 0
        self._publisher = graph.node.create_publisher(Image, topics.RAW.name, qos_of(topics.RAW))
        self.values = {}
        graph.node.create_subscription(DiagnosticArray, '/diagnostics', self._keep, 10)

    def _keep(self, message):
        for status in message.status:
            self.values.update({pair.key: pair.value for pair in status.values})

    def publish(self):
        self._number += 1
        pixels = self._frames[self._number % len(self._frames)]
        message = image_message(self._number * FRAME_NS, 'camera', pixels, 'bgr8')
        self._publisher.publish(message)


def test_a_camera_tells_the_diameter_in_its_first_seconds(graph, tmp_path, frames):
    camera = LiveCamera(graph, frames)
    path = trays_file(tmp_path, 'look: auto')
    process = graph.start('pipeline', 'source:=topic', f'trays_file:={path}', 'workers:=0')

    def measures():
        camera.publish()
        return 'tray 1 quality' in camera.values

    graph.until(measures, _PATIENCE_S)
    assert found_diameter(camera.values['diameters']) == pytest.approx(
        DIAMETER_PX / SCALE, rel=0.06
    )
    ended = graph.interrupt(process)
    assert ended.code == 0, ended.output
    assert 'diameters are found in the first 5 s of the camera' in ended.output
    assert camera.values['diameters'] in ended.output
    assert 'Traceback' not in ended.output


def test_a_bag_tells_it_before_it_is_played(graph, tmp_path, frames):
    images, bag = tmp_path / 'images', tmp_path / 'bag'
    images.mkdir()
    for number, frame in enumerate(frames):
        cv2.imwrite(str(images / f'{number:03d}.png'), frame)
    assert main(['import', str(images), '--rate', '30', '-o', str(bag)]) == 0
    path = trays_file(tmp_path, 'look: auto, diameter_mm: auto')
    process = graph.start(
        'pipeline', 'source:=bag', f'bag:={bag}', f'trays_file:={path}', 'rate:=0.0'
    )
    graph.until(lambda: process.poll() is not None, _PATIENCE_S)
    finished = graph.wait(process)
    assert finished.code == 0, finished.output
    assert found_diameter(finished.output) == pytest.approx(DIAMETER_PX / SCALE, rel=0.06)


@pytest.mark.parametrize(
    ('node', 'species', 'remedy'),
    [
        ('speed_estimator', 'look: auto', 'pipeline --ros-args -p source:=topic'),
        ('preprocessor', 'look: auto', 'pipeline --ros-args -p source:=topic'),
    ],
)
def test_where_it_cannot_be_found_the_node_says_what_to_do(graph, tmp_path, node, species, remedy):
    path = trays_file(tmp_path, species)
    process = graph.start(node, f'trays_file:={path}')
    graph.until(lambda: process.poll() is not None, _PATIENCE_S)
    finished = graph.wait(process)
    assert finished.code == 2, finished.output
    assert f'{path}:6: lacks diameter_mm' in finished.output
    assert remedy in finished.output
    assert 'Traceback' not in finished.output


@pytest.mark.parametrize(
    ('species', 'problem'),
    [
        # Of the flight: its look is not that of any film.
        ('material: acrylic, count: 15', 'lacks diameter_mm; add it, or "look: auto"'),
        ('look: auto, colour: sky', ":6: unknown colour 'sky'"),
    ],
)
def test_a_file_of_no_use_is_refused_before_the_camera_is_waited_for(
    graph, tmp_path, species, problem
):
    path = trays_file(tmp_path, species)
    text = path.read_text(encoding='utf-8')
    path.write_text(text.replace(f'{1e3 * SIZE[1] / SCALE:g}]', '30, 4]'), encoding='utf-8')
    process = graph.start('pipeline', 'source:=topic', f'trays_file:={path}')
    graph.until(lambda: process.poll() is not None, _PATIENCE_S)
    finished = graph.wait(process)
    assert finished.code == 2, finished.output
    assert f'pipeline: {path}:' in finished.output
    assert problem in finished.output
