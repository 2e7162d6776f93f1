"""Small videos whose frames contain their number."""

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
    """A moving disc, and the number in binary as black and white blocks at the top."""
    image = np.full((height, width, 3), (90, 110, 60), dtype=np.uint8)
    cv2.circle(image, (12 + 5 * number % (width - 24), height - 20), 10, (40, 160, 230), -1)
    for bit in range(_BITS):
        level = 235 if number >> bit & 1 else 20
        image[:_BLOCK, bit * _BLOCK : (bit + 1) * _BLOCK] = level
    return image


def number_of(image):
    """Read the number in a frame."""
    gray = image if image.ndim == 2 else image.mean(axis=2)
    blocks = gray[2 : _BLOCK - 2, : _BITS * _BLOCK].reshape(_BLOCK - 4, _BITS, _BLOCK)
    return sum(1 << bit for bit, level in enumerate(blocks.mean(axis=(0, 2))) if level > 128)


def write_video(path, numbers, *, codec='mjpeg', times=None, tags=None, **options):
    """Write a video of the frames with these numbers at these times, [1/1000 s]."""
    times = [STEP * index for index in range(len(numbers))] if times is None else times
    pixel_format = options.pop('pixel_format', 'yuvj420p' if codec == 'mjpeg' else 'yuv420p')
    with av.open(str(path), 'w') as container:
        container.metadata.update(tags or {})
        stream = container.add_stream(codec, rate=TICKS // STEP, options=options)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, pixel_format
        stream.time_base = stream.codec_context.time_base = Fraction(1, TICKS)
        packets = []
        for index, number in enumerate(numbers):
            frame = av.VideoFrame.from_ndarray(picture(number), format='bgr24')
            frame.pts, frame.time_base = STEP * index, Fraction(1, TICKS)
            packets += stream.encode(frame)
        packets += stream.encode()
        for index, packet in enumerate(packets):
            if codec in ('mjpeg', 'mpeg4', 'ffv1'):
                # Containers require rising decoding times; presentation times may be in any order.
                packet.pts, packet.dts = times[index], STEP * index - 10 * TICKS
            container.mux(packet)
    return path


def packets_of(path):
    """The compressed frames of a video."""
    with av.open(str(path)) as container:
        return [bytes(packet) for packet in container.demux(video=0) if packet.size]


_IDENTITY = np.array([1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30], dtype='>i4').tobytes()


def set_display_matrix(path, a, b, c, d):
    """Set the display matrix of an mp4 or mov."""
    matrix = np.array([a, b, 0, c, d, 0, 0, 0, 1 << 14], dtype='>i4') * (1 << 16)
    content = path.read_bytes()
    offset = content.index(_IDENTITY, content.index(b'tkhd'))
    path.write_bytes(content[:offset] + matrix.astype('>i4').tobytes() + content[offset + 36 :])
    return path


def write_images(folder, names):
    """Write a folder of the frames 0, 1, ... with these names."""
    folder.mkdir()
    for number, name in enumerate(names):
        cv2.imwrite(str(folder / name), picture(number))
    return folder


def imported(paths, bag, settings=STARTED):
    """Import films; returns the result, the frame numbers, and the times in [1/1000 s]."""
    progress = []
    films = [paths] if isinstance(paths, os.PathLike) else paths
    result = import_films(films, bag, settings, progress.append)
    assert progress == sorted(progress)
    assert progress[-1] <= 1.0
    frames = list(BagFrames(bag).frames())
    assert len(frames) == result.frames
    times = [(frame.stamp_ns - START_NS) / 1e6 for frame in frames]
    return result, [number_of(frame.image) for frame in frames], times
