"""Small bags in every layout, and what is in them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import (
    compressed_image_message,
    time_message,
)
from nanorocks_ros.recordings.offered_qos import OfferedQos

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from typing import Any

_IMAGE, _TIME = 'sensor_msgs/msg/CompressedImage', 'builtin_interfaces/msg/Time'
_TOPICS = {'/camera': _IMAGE, '/epoch': _TIME}
_MESSAGES, _STEP_NS, _START_NS, _CHUNK_BYTES = 101, 33_333_333, 10**18, 6000
_OPTIONS: dict[str, dict[str, Any]] = {
    'zstd': {'compression': CompressionType.ZSTD},
    'lz4': {'compression': CompressionType.LZ4},
    'no compression': {'compression': CompressionType.NONE},
    'no chunks': {'use_chunking': False, 'enable_data_crcs': True},
    'no index': {'compression': CompressionType.ZSTD, 'index_types': IndexType.NONE},
    'no checksums': {'compression': CompressionType.NONE, 'enable_crcs': False},
}


class Layout(NamedTuple):
    """A way to store a bag.

    Parameters
    ----------
    name : str
    checksums : bool
        Whether the bytes of its messages are covered by checksums.
    """

    name: str
    checksums: bool


LAYOUTS = (Layout('ours', True), *(Layout(name, name != 'no checksums') for name in _OPTIONS))
"""MCAP layouts."""

SQLITE = Layout('SQLite', False)


def write_bag(path: Path, layout: Layout) -> Path:
    """Write a small bag of noise; its storage file."""
    if layout.name == 'ours':
        return _write_ours(path)
    if layout.name == 'SQLite':
        return _write_sqlite(path)
    return _write_mcap(path.with_suffix('.mcap'), _OPTIONS[layout.name])


def _messages() -> Iterator[tuple[str, int, Any]]:
    noise = np.random.default_rng(7)
    for number in range(_MESSAGES):
        stamp_ns = _START_NS + number * _STEP_NS
        if number % 10 == 0:
            yield '/epoch', stamp_ns, time_message(stamp_ns)
        else:
            content = noise.bytes(int(noise.integers(150, 600)))
            yield '/camera', stamp_ns, compressed_image_message(stamp_ns, 'c', 'jpeg', content)


def _write_ours(path: Path) -> Path:
    table = {name: OfferedTopic(msgtype=kind, qos=OfferedQos()) for name, kind in _TOPICS.items()}
    with BagWriter(path, table, metadata={'tray': '3'}) as bag:
        for topic, stamp_ns, message in _messages():
            bag.write(topic, stamp_ns, message)
    return path / f'{path.name}.mcap'


def _write_sqlite(path: Path) -> Path:
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connections = {
            name: writer.add_connection(name, kind, typestore=store)
            for name, kind in _TOPICS.items()
        }
        for topic, stamp_ns, message in _messages():
            cdr = store.serialize_cdr(message, _TOPICS[topic])
            writer.write(connections[topic], stamp_ns, cdr)
    return path / f'{path.name}.db3'


def _write_mcap(path: Path, options: dict[str, Any]) -> Path:
    store = get_typestore(Stores.ROS2_JAZZY)
    writer = McapWriter(str(path), chunk_size=_CHUNK_BYTES, **options)
    writer.start('ros2')
    channels = {}
    for name, kind in _TOPICS.items():
        text, _ = store.generate_msgdef(kind, ros_version=2)
        schema = writer.register_schema(kind, 'ros2msg', text.encode())
        channels[name] = writer.register_channel(name, 'cdr', schema)
    for topic, stamp_ns, message in _messages():
        cdr = bytes(store.serialize_cdr(message, _TOPICS[topic]))
        writer.add_message(channels[topic], stamp_ns, cdr, stamp_ns)
    writer.finish()
    return path
