"""Small videos whose pictures carry their number, so that each can be told from every other."""

from __future__ import annotations

import os
from fractions import Fraction

import av
import cv2
import numpy as np

from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
from nanorocks_ros.studies.film_import.import_film import import_films

WIDTH, HEIGHT = 96, 64
_BITS = 8
_BLOCK = 8
TICKS = 1000
STEP = 40
NS = 1_000_000_000
START_NS = 1_700_000_000 * NS
STARTED = ImportSettings(start_ns=START_NS)

CALIBRATION = f"""
camera_info:
  width: {WIDTH}
  height: {HEIGHT}
  distortion_model: equidistant
  d: [0.01, 0.002, 0.0, 0.0]
  k: [80.0, 0, 47.5, 0, 80.0, 31.5, 0, 0, 1]
  p: [81.0, 0, 47.5, 0, 0, 81.0, 31.5, 0, 0, 0, 1, 0]
pixels_per_metre: 1000.0
trays:
  1: [8, 8, 40, 40]
"""


def picture(number, width=WIDTH, height=HEIGHT):
    """A disc that moves, and the number in black and white blocks at the top."""
    image = np.full((height, width, 3), (90, 110, 60), dtype=np.uint8)
    cv2.circle(image, (12 + 5 * number % (width - 24), height - 20), 10, (40, 160, 230), -1)
    for bit in range(_BITS):
        level = 235 if number >> bit & 1 else 20
        image[:_BLOCK, bit * _BLOCK : (bit + 1) * _BLOCK] = level
    return image


def number_of(image):
    """The number in a picture."""
    gray = image if image.ndim == 2 else image.mean(axis=2)
    blocks = gray[2 : _BLOCK - 2, : _BITS * _BLOCK].reshape(_BLOCK - 4, _BITS, _BLOCK)
    return sum(1 << bit for bit, level in enumerate(blocks.mean(axis=(0, 2))) if level > 128)


def write_video(path, numbers, *, codec='mjpeg', times=None, tags=None, **options):
    """A video of the pictures with these numbers, shown at these times [1/1000 s]."""
    times = [STEP * place for place in range(len(numbers))] if times is None else times
    form = options.pop('form', 'yuvj420p' if codec == 'mjpeg' else 'yuv420p')
    with av.open(str(path), 'w') as container:
        container.metadata.update(tags or {})
        stream = container.add_stream(codec, rate=TICKS // STEP, options=options)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, form
        stream.time_base = stream.codec_context.time_base = Fraction(1, TICKS)
        packets = []
        for place, number in enumerate(numbers):
            frame = av.VideoFrame.from_ndarray(picture(number), format='bgr24')
            frame.pts, frame.time_base = STEP * place, Fraction(1, TICKS)
            packets += stream.encode(frame)
        packets += stream.encode()
        for place, packet in enumerate(packets):
            if codec in ('mjpeg', 'mpeg4', 'ffv1'):
                # Containers want these to rise, not the times at which pictures are shown.
                packet.pts, packet.dts = times[place], STEP * place - 10 * TICKS
            container.mux(packet)
    return path


def packets_of(path):
    """The compressed pictures of a video."""
    with av.open(str(path)) as container:
        return [bytes(packet) for packet in container.demux(video=0) if packet.size]


_UPRIGHT = np.array([1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30], dtype='>i4').tobytes()


def turn_video(path, a, b, c, d):
    """Set the display matrix of an mp4 or mov."""
    matrix = np.array([a, b, 0, c, d, 0, 0, 0, 1 << 14], dtype='>i4') * (1 << 16)
    content = path.read_bytes()
    place = content.index(_UPRIGHT, content.index(b'tkhd'))
    path.write_bytes(content[:place] + matrix.astype('>i4').tobytes() + content[place + 36 :])
    return path


def write_images(folder, names):
    """A folder of the pictures 0, 1, ... under these names."""
    folder.mkdir()
    for number, name in enumerate(names):
        cv2.imwrite(str(folder / name), picture(number))
    return folder


def imported(paths, bag, settings=STARTED):
    """What became of films, the numbers of the pictures in the bag, and their times [1/1000 s]."""
    shares = []
    found = import_films([paths] if isinstance(paths, os.PathLike) else paths, bag, settings,
                         shares.append)  # fmt: skip
    assert shares == sorted(shares)
    assert shares[-1] <= 1.0
    frames = list(BagFrames(bag).frames())
    assert len(frames) == found.frames
    times = [(frame.stamp_ns - START_NS) / 1e6 for frame in frames]
    return found, [number_of(frame.image) for frame in frames], times
