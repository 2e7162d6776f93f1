"""Diameters that the trays file of a node leaves open, found in what its camera or bag shows.

Tested by ``test/nodes/test_open_diameters.py``.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from nanorocks_ros.experiment.unknown_diameters import unknown_diameters
from nanorocks_ros.nodes.base.told_settings import told_settings
from nanorocks_ros.nodes.sources.bag_source import path_of_bag
from nanorocks_ros.recordings.messages.image_messages import (
    frame_from_compressed,
    frame_from_image,
)
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.studies.measure.found_diameters import (
    require_looks,
    with_diameters_in_view,
    with_found_diameters,
)
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from sensor_msgs.msg import CompressedImage, Image

    from nanorocks_ros.nodes.base.node import NanorocksNode
    from nanorocks_ros.records import Frame
    from nanorocks_ros.settings import BagSettings, CameraSettings

TRAYS_FILE = 'trays_file'
"""Name of the parameter."""

# So many frames are looked at, this far apart; and with fewer, if no more come, at least so many.
_FRAMES, _APART_NS, _FEW_FRAMES = 25, 200_000_000, 8
_NO_MORE_S = 3.0
_SPIN_S = 0.2


def find_open_diameters(
    node: NanorocksNode, source: str, bag: BagSettings, camera: CameraSettings
) -> None:
    """Find diameters that the trays file leaves open, before the node uses the file.

    The parameter then has the content of the file with what is found, as recordings have.

    Parameters
    ----------
    node : NanorocksNode
    source : str
        ``simulator``, ``bag`` or ``topic``; a simulation cannot tell them.
    bag : BagSettings
    camera : CameraSettings

    Raises
    ------
    ConfigurationError
        When a diameter cannot be found, or what is told cannot be used.
    RecordingError
        When the bag cannot be read.
    FrameError
        When a frame of the camera cannot be used.
    """
    told = told_settings(node)
    if source == 'simulator' or not unknown_diameters(told.get(TRAYS_FILE, '')):
        return
    settings = with_values(PipelineSettings(), told, f'node {node.get_name()}')
    require_looks(settings)
    if source == 'bag':
        found = with_found_diameters(settings, told.keys(), Path(path_of_bag(bag)))
    else:
        topic = topics.RAW_COMPRESSED if camera.transport == 'compressed' else topics.RAW
        name = node.resolve_topic_name(topic.name)
        frames = _first_frames(node, topic, name)
        found = with_diameters_in_view(settings, told.keys(), name, frames)
    for notice in found.notices:
        node.get_logger().info(notice)
    node.diagnostics.values['diameters'] = '; '.join(found.notices)
    node._parameter_overrides[TRAYS_FILE] = Parameter(
        TRAYS_FILE, Parameter.Type.STRING, found.settings.trays_file
    )


def _first_frames(node: NanorocksNode, topic: topics.Topic, name: str) -> list[Frame]:
    """Frames of the first seconds of a camera; waits for them."""
    frames: list[Frame] = []
    read = frame_from_compressed if topic is topics.RAW_COMPRESSED else frame_from_image
    heard_at = time.monotonic()

    def receive(message: Image | CompressedImage) -> None:
        nonlocal heard_at
        heard_at = time.monotonic()
        frame = read(message, name)
        if not frames or abs(frame.stamp_ns - frames[-1].stamp_ns) >= _APART_NS:
            frames.append(frame)

    seconds = 1e-9 * _FRAMES * _APART_NS
    node.tell_progress(f'{name}: diameters are found in the first {seconds:g} s of the camera')
    subscription = node.listen(topic, receive)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while len(frames) < _FRAMES:
            executor.spin_once(timeout_sec=_SPIN_S)
            no_more = time.monotonic() - heard_at > _NO_MORE_S
            if no_more and len(frames) >= _FEW_FRAMES:
                break
    finally:
        executor.remove_node(node)
        executor.shutdown()
        node.destroy_subscription(subscription)
    return frames
