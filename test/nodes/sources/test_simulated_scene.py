"""The simulator films the whole plate when asked to, with its lens and the truth of all trays."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Float32MultiArray

from nanorocks_ros.nodes.base.communication.ros_messages import qos_of, stamp_of
from nanorocks_ros.settings import SceneSettings, SimulationSettings
from nanorocks_ros.simulation.plate_scene.scene_geometry import scene_camera
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.bead_truth import beads_from_array

SMALL = ('width_px:=640', 'height_px:=480', 'scene.pixels_per_metre:=5600.0')
SCENE = ('whole_scene:=true', 'scene.trays:=[1, 4]', 'first_shake:=0.1')


def test_the_simulator_films_the_whole_plate(graph):
    seen = defaultdict(list)
    kinds = {topics.RAW: Image, topics.CAMERA_INFO: CameraInfo}
    for topic, kind in kinds.items():
        graph.node.create_subscription(kind, topic.name, seen[topic.name].append, qos_of(topic))
    names = [topic.of(tray) for tray in (1, 4) for topic in (topics.TRUTH, topics.BEADS)]
    for name in names:
        graph.node.create_subscription(
            Float32MultiArray, name, seen[name].append, qos_of(topics.BEADS)
        )
    process = graph.start('simulator', *SCENE, *SMALL, 'listeners:=1', 'duration:=2.0')
    ended = graph.wait(process)
    assert ended.code == 0, ended.output
    graph.until(lambda: all(seen[name] for name in (*names, topics.RAW.name)))
    info = seen[topics.CAMERA_INFO.name][0]
    camera = scene_camera(SimulationSettings(width_px=640, height_px=480), SceneSettings())
    np.testing.assert_array_equal(np.reshape(info.k, (3, 3)), camera.matrix)
    assert info.distortion_model == 'equidistant'
    image = seen[topics.RAW.name][-1]
    assert (image.width, image.height, image.encoding) == (640, 480, 'bgr8')
    message = seen[topics.BEADS.of(4)][-1]
    assert message.layout.dim[1].size == 80
    epoch_ns = stamp_of(info.header.stamp)
    beads = beads_from_array(message.data, tray=4, epoch_ns=epoch_ns, where='test')
    assert beads.cycle == 1
    assert np.hypot(*beads.displacement) > 0.0


def test_a_scene_that_cannot_be_filmed_is_refused_in_one_line(graph):
    ended = graph.wait(graph.start('simulator', 'whole_scene:=true', 'scene.trays:=[1, 1]'))
    assert ended.code == 2
    assert 'Traceback' not in ended.output
    assert 'is empty or has duplicates' in ended.output
