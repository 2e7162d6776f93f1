"""What the killed jobs read, and what is compared of what they wrote."""

from __future__ import annotations

import hashlib
import re
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.outputs.npz_archive import read_archive
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import image_message, time_message
from nanorocks_ros.records import NS
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from pathlib import Path

_FRAMES = 150
# When it was made: the only thing in which two runs may differ.
_DATE = re.compile(rb'\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?')
_DATED = '.json', '.html'


def write_bag(path: Path, number: int) -> Path:
    """A bright square that moves over a gray tray."""
    table = {topic.absolute(): offered_topic(topic) for topic in (topics.EPOCH, topics.RAW)}
    start_ns = (1_500_000_000 + 100 * number) * NS
    with BagWriter(path, table, metadata={}) as bag:
        bag.write(topics.EPOCH.absolute(), start_ns, time_message(start_ns))
        for frame in range(60):
            pixels = np.full((210, 210), 120, np.uint8)
            pixels[50:70, 20 + frame : 40 + frame] = 200
            stamp_ns = start_ns + frame * NS // 30
            message = image_message(stamp_ns, 'camera', 'mono8', pixels)
            bag.write(topics.RAW.absolute(), stamp_ns, message)
    return path


def write_film(path: Path, seed: int, frames: int = _FRAMES) -> None:
    import av

    random = np.random.default_rng(seed)
    with av.open(str(path), 'w') as container:
        stream = container.add_stream('mjpeg', rate=30)
        stream.width, stream.height, stream.pix_fmt = 320, 240, 'yuvj420p'
        for number in range(frames):
            pixels = random.integers(0, 255, (240, 320, 3), dtype=np.uint8)
            frame = av.VideoFrame.from_ndarray(pixels, format='bgr24')
            frame.pts, frame.time_base = number, Fraction(1, 30)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def arrays_of(path: Path) -> str:
    digest = hashlib.sha256()
    for name, array in sorted(read_archive(path.with_suffix('.npz')).items()):
        digest.update(f'{name} {array.dtype} {array.shape}'.encode() + array.tobytes())
    return digest.hexdigest()


def results_of(path: Path) -> str:
    digest = hashlib.sha256()
    for table in sorted(path.rglob('*.csv')):
        digest.update(f'{table.relative_to(path)}'.encode() + table.read_bytes())
    for bag in sorted(path.rglob('results_bag')):
        for message in open_bag(bag).messages():
            digest.update(f'{message.topic} {message.log_time_ns}'.encode() + message.cdr)
    return digest.hexdigest()


def messages_of(path: Path) -> str:
    digest = hashlib.sha256()
    bags = [path] if list(path.glob('*.mcap')) else sorted(path.iterdir())
    for bag in bags:
        reader = open_bag(bag)
        for message in reader.messages():
            digest.update(f'{bag.name} {message.topic} {message.log_time_ns}'.encode())
            digest.update(message.cdr)
        digest.update(b'complete' if reader.complete else b'cut')
    return digest.hexdigest()


def whole_folder(path: Path) -> str:
    """Digest of all files of a folder, hidden ones too, without the date when they were made."""
    digest = hashlib.sha256()
    for file in sorted(file for file in path.rglob('*') if file.is_file()):
        content = file.read_bytes()
        if file.suffix in _DATED:
            content = _DATE.sub(b'', content)
        digest.update(f'{file.relative_to(path)} {len(content)}'.encode() + content)
    return digest.hexdigest()
