"""CPU time of recording, in the thread that hands over frames and in the writer thread."""

from __future__ import annotations

import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np

from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.recorder import Recorder
from nanorocks_ros.recordings.messages.image_messages import encode_jpeg
from nanorocks_ros.recordings.messages.message_builders import compressed_image_message
from nanorocks_ros.wire import topics

_FRAMES = 300
_RATE = 30.0
_QUALITY = 95
_CAMERA = topics.RAW_COMPRESSED.absolute()
_FORMAT = 'bgr8; jpeg compressed bgr8'


def report() -> None:
    """Record ten seconds of compressed and of raw 1080p frames, and print the costs."""
    picture = _picture()
    jpeg = encode_jpeg(picture, _QUALITY)
    print(f'{_FRAMES} frames of 1080p, JPEG quality {_QUALITY}: {len(jpeg) / 1e3:.0f} kB each')
    print('| frames come | hand over [ms] | write [ms] | share of a core at 30 Hz | MB/s |')
    print('| --- | --- | --- | --- | --- |')
    _print('compressed', *_run(partial(_message, jpeg), len(jpeg)), len(jpeg))
    _print('raw', *_run(partial(_encoded, picture), picture.nbytes), len(jpeg))


def _picture() -> np.ndarray:
    """Noise over a gradient, with the compression of a film of the plate."""
    rng = np.random.default_rng(1)
    gradient = np.linspace(60, 180, 1920)[None, :, None]
    noise = rng.normal(0.0, 3.0, (1080, 1920, 3))
    return np.clip(gradient + noise, 0, 255).astype(np.uint8)


def _message(jpeg: bytes, stamp_ns: int) -> object:
    return compressed_image_message(stamp_ns, 'camera', _FORMAT, jpeg)


def _encoded(picture: np.ndarray, stamp_ns: int) -> object:
    return _message(encode_jpeg(picture, _QUALITY), stamp_ns)


def _run(make, size: int) -> tuple[float, float, float]:
    """CPU time of handing over and of writing, and time until all is on disk, [s]."""
    table = {_CAMERA: offered_topic(topics.RAW_COMPRESSED)}
    with tempfile.TemporaryDirectory() as folder:
        start, process = time.monotonic(), time.process_time()
        thread = time.thread_time()
        recorder = Recorder(Path(folder) / 'bag', table, metadata={})
        for number in range(_FRAMES):
            stamp_ns = round(number * 1e9 / _RATE)
            recorder.advance(stamp_ns)
            recorder.put(_CAMERA, partial(make, stamp_ns), size=size, wait=True)
        handover = time.thread_time() - thread
        recorder.close()
        writing = time.process_time() - process - handover
        return handover, writing, time.monotonic() - start


def _print(name: str, handover: float, writing: float, seconds: float, size: int) -> None:
    share = (handover + writing) / _FRAMES * _RATE
    print(
        f'| {name} | {1e3 * handover / _FRAMES:.3f} | {1e3 * writing / _FRAMES:.2f} '
        f'| {share:.3f} | {1e-6 * _FRAMES * size / seconds:.0f} |'
    )
