"""Small recordings to read back."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import (
    compressed_image_message,
    float_array_message,
    time_message,
)
from nanorocks_ros.recordings.offered_qos import OfferedQos

CAMERA = '/nanorocks/camera/image_raw/compressed'
SPEED = '/nanorocks/tray_3/speed'
EPOCH = '/nanorocks/epoch'
START_NS = 1_000_000_000_000_000_000
STEP_NS = 33_333_333

TOPICS = {
    CAMERA: OfferedTopic(
        msgtype='sensor_msgs/msg/CompressedImage', qos=OfferedQos(reliable=True, depth=5)
    ),
    SPEED: OfferedTopic(
        msgtype='std_msgs/msg/Float32MultiArray', qos=OfferedQos(reliable=False, depth=1000)
    ),
    EPOCH: OfferedTopic(
        msgtype='builtin_interfaces/msg/Time', qos=OfferedQos(transient_local=True, depth=1)
    ),
}


@pytest.fixture
def topics() -> dict[str, OfferedTopic]:
    """The topics of the recordings made here."""
    return dict(TOPICS)


@pytest.fixture
def record() -> Callable[..., Path]:
    """Write a recording of some frames of noise, with a speed beside each."""

    def write(path: Path, frames: int = 40, size: int = 20_000, first: int = 0) -> Path:
        noise = np.random.default_rng(first)
        with BagWriter(path, TOPICS, metadata={'nanorocks_ros': '0.0', 'tray': '3'}) as bag:
            if frames:
                bag.write(EPOCH, START_NS, time_message(START_NS))
            for number in range(first, first + frames):
                stamp_ns = START_NS + number * STEP_NS
                picture = compressed_image_message(stamp_ns, 'camera', 'jpeg', noise.bytes(size))
                bag.write(CAMERA, stamp_ns, picture)
                values = [number * 0.5, float('nan')]
                bag.write(SPEED, stamp_ns, float_array_message(['time', 'cycle'], values))
        return path

    return write
