"""Import, salvage, opening and seeking, against decoding, copying and the `rosbags` library.

Import: a film of a moving 1080p image with noise, as Motion JPEG and as H.264, on all cores.
Opening and seeking: a bag of 10 GB, or of NANOROCKS_BENCHMARK_GB.
"""

from __future__ import annotations

import os
import shutil
import statistics
import tempfile
import time
from functools import partial
from pathlib import Path

import av
import cv2
import numpy as np
from rosbags.rosbag2 import Reader

from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.salvage import salvage
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import compressed_image_message
from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
from nanorocks_ros.studies.film_import.import_film import import_films
from nanorocks_ros.wire import topics

_WIDTH, _HEIGHT, _FRAMES = 1920, 1080, 300
_ROUNDS = 3
_NS = 1_000_000_000
_STEP_NS = _NS // 30
_PICTURE_BYTES = 500_000
_GB = float(os.environ.get('NANOROCKS_BENCHMARK_GB', '10'))
_SEEKS = 20
_CAMERA = topics.RAW_COMPRESSED


def _timed(work) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def _film(path: Path, codec: str, form: str, options: dict[str, str]) -> None:
    noise = np.random.default_rng(1)
    scene = cv2.GaussianBlur(noise.integers(0, 255, (_HEIGHT, 2 * _WIDTH, 3), np.uint8), (9, 9), 3)
    grain = noise.integers(0, 12, (8, _HEIGHT, _WIDTH, 3), dtype=np.uint8)
    with av.open(str(path), 'w') as container:
        stream = container.add_stream(codec, rate=30, options=options)
        stream.width, stream.height, stream.pix_fmt = _WIDTH, _HEIGHT, form
        for number in range(_FRAMES):
            image = cv2.add(scene[:, 6 * number : 6 * number + _WIDTH], grain[number % 8])
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format='bgr24')))
        container.mux(stream.encode())


def _decode(path: Path) -> None:
    with av.open(str(path)) as container:
        container.streams.video[0].thread_type = 'AUTO'
        for _ in container.decode(video=0):
            pass


def _import(path: Path, bag: Path) -> None:
    shutil.rmtree(bag, ignore_errors=True)
    import_films([path], bag, ImportSettings(start_ns=_NS), lambda _: None)


def _imports(folder: Path) -> None:
    for label, name, codec, form, options in (
        (
            'remux, MJPEG',
            'a.avi',
            'mjpeg',
            'yuvj420p',
            {'flags': '+qscale', 'global_quality': '590'},
        ),
        ('recompress, H.264', 'a.mp4', 'libx264', 'yuv420p', {'crf': '20', 'preset': 'fast'}),
    ):
        path = folder / name
        _film(path, codec, form, options)
        pairs = [
            (
                _timed(lambda path=path: _decode(path)),
                _timed(lambda path=path: _import(path, folder / 'bag')),
            )
            for _ in range(_ROUNDS)
        ]
        decode, total = (min(column) for column in zip(*pairs, strict=True))
        print(
            f'| import, {label} | {_FRAMES / total:.0f} frames/s '
            f'| decoding alone: {_FRAMES / decode:.0f} | {decode / total:.2f} |'
        )


def _bag(path: Path, size: float) -> int:
    """Write a bag of incompressible images, and return their number."""
    count = int(size / _PICTURE_BYTES)
    pool = [np.random.default_rng(k).bytes(_PICTURE_BYTES) for k in range(8)]
    name = _CAMERA.absolute()
    with BagWriter(path, {name: offered_topic(_CAMERA)}, metadata={}) as bag:
        for number in range(count):
            stamp_ns = _NS + number * _STEP_NS
            message = compressed_image_message(stamp_ns, 'camera', 'jpeg', pool[number % 8])
            bag.write(name, stamp_ns, message)
    return count


def _copy(source: Path, target: Path) -> None:
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(source, target)


def _salvage(source: Path, target: Path) -> None:
    shutil.rmtree(target, ignore_errors=True)
    salvage(source, target, lambda *_: None)


def _salvages(folder: Path) -> None:
    source = folder / 'cut'
    _bag(source, 5e8)
    (source / 'metadata.yaml').unlink()
    file = source / 'cut.mcap'
    os.truncate(file, file.stat().st_size - 1000)
    pairs = [
        (
            _timed(lambda: _copy(source, folder / 'copy')),
            _timed(lambda: _salvage(source, folder / 'new')),
        )
        for _ in range(_ROUNDS)
    ]
    copy, salvaged = (min(column) for column in zip(*pairs, strict=True))
    size = file.stat().st_size / 1e6
    print(
        f'| salvage, cut short | {size / salvaged:.0f} MB/s | plain copy: {size / copy:.0f} MB/s '
        f'| {copy / salvaged:.2f} |'
    )
    for name in ('cut', 'copy', 'new'):
        shutil.rmtree(folder / name)


def _first_of_ours(path: Path, stamp_ns: int) -> None:
    assert next(open_bag(path).messages(start_ns=stamp_ns)).log_time_ns >= stamp_ns


def _first_of_rosbags(path: Path, stamp_ns: int) -> None:
    with Reader(path) as reader:
        assert next(reader.messages(start=stamp_ns))[1] >= stamp_ns


def _opening(folder: Path) -> None:
    path = folder / 'long'
    count = _bag(path, _GB * 1e9)
    places = np.random.default_rng(0).integers(0, count - 1, _SEEKS)
    stamps = [_NS + int(place) * _STEP_NS for place in places]
    reader = open_bag(path)

    def seek(stamp_ns: int) -> None:
        next(reader.messages(start_ns=stamp_ns))

    with Reader(path) as rosbags_reader:
        calls = {
            'open': (lambda _: open_bag(path), lambda _: Reader(path).open()),
            'seek, opened': (
                seek,
                lambda stamp_ns: next(rosbags_reader.messages(start=stamp_ns)),
            ),
            'open and seek': (
                partial(_first_of_ours, path),
                partial(_first_of_rosbags, path),
            ),
        }
        rows = {
            label: [[_timed(partial(call, stamp)) for stamp in stamps] for call in pair]
            for label, pair in calls.items()
        }
    for label, columns in rows.items():
        ours, rosbags = (statistics.median(column) for column in columns)
        print(
            f'| {_GB:g} GB, {label} | {1e3 * ours:.1f} ms | `rosbags`: {1e3 * rosbags:.1f} ms '
            f'| {rosbags / ours:.2f} |'
        )


def report() -> None:
    """Print the table."""
    print('| what | measured | beside | ratio |\n| --- | --- | --- | --- |')
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _imports(folder)
        _salvages(folder)
        _opening(folder)
