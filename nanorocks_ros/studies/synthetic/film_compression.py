"""Compression of a simulated film: JPEG of given quality or size, or an H.264 stream.

Tested by ``test/studies/synthetic/test_film_scene.py``.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.recordings.film.pyav import pyav
from nanorocks_ros.recordings.messages.image_messages import encode_jpeg

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from nanorocks_ros.settings import CompressionSettings
    from nanorocks_ros.simulation.plate_scene.plate_film import SceneMoment

# Frames in the minute that the rate refers to.
_FRAMES_PER_MINUTE = 1800.0
_QUALITIES = 1, 100
# For the message without PyAV: what needs it, and the alternative.
_H264 = '--compression-codec h264', 'take jpeg'
_STREAMS = 'h264', 'h264_crf'
# Accumulated relative excess of the size at which the quality changes.
_TOLERANCE = 0.02


def compressed(
    moments: Iterable[SceneMoment],
    compression: CompressionSettings,
    *,
    quality: int,
    frame_rate: float,
) -> Iterator[tuple[SceneMoment, bytes]]:
    """Yield each moment as its compressed image shows it, with that image as a JPEG.

    Parameters
    ----------
    moments : iterable of SceneMoment
    compression : CompressionSettings
    quality : int, 1 to 100
        Of JPEGs without a given size, and of JPEGs that hold the decoded images of a stream.
    frame_rate : float, [1/s]

    Yields
    ------
    SceneMoment
        For H.264 with the decoded frame.
    bytes

    Raises
    ------
    ConfigurationError
        When PyAV, which makes H.264, is not installed.
    """
    if compression.codec in _STREAMS:
        yield from _h264_moments(moments, H264Stream(compression, frame_rate), quality)
        return
    quality_control = _QualityControl(compression.rate / _FRAMES_PER_MINUTE)
    for moment in moments:
        image = moment.frame.image
        sized = compression.codec == 'jpeg_rate'
        jpeg = quality_control.encode(image) if sized else encode_jpeg(image, quality)
        yield moment, jpeg


def check_codec(compression: CompressionSettings) -> None:
    """Raise for a codec that is not available.

    Raises
    ------
    ConfigurationError
        When PyAV is needed and not installed.
    """
    if compression.codec in _STREAMS:
        pyav(*_H264)


class _QualityControl:
    """Controls the quality of JPEGs so that they have a given mean size.

    Parameters
    ----------
    size : float, [bytes]
    """

    def __init__(self, size: float) -> None:
        self._size = size
        self._quality: int | None = None
        self._excess = 0.0

    def encode(self, image: NDArray[np.uint8]) -> bytes:
        """Encode the next image as a JPEG."""
        if self._quality is None:
            self._quality = self._largest_quality(image)
        content = encode_jpeg(image, self._quality)
        self._excess += len(content) / self._size - 1.0
        if abs(self._excess) > _TOLERANCE:
            step = -1 if self._excess > 0.0 else 1
            low, high = _QUALITIES
            self._quality = min(max(self._quality + step, low), high)
        return content

    def _largest_quality(self, image: NDArray[np.uint8]) -> int:
        """The largest quality at which the JPEG does not exceed the size."""
        low, high = _QUALITIES
        while low < high:
            middle = (low + high + 1) // 2
            if len(encode_jpeg(image, middle)) > self._size:
                high = middle - 1
            else:
                low = middle
        return low


def _h264_moments(
    moments: Iterable[SceneMoment], stream: H264Stream, quality: int
) -> Iterator[tuple[SceneMoment, bytes]]:
    waiting: deque[SceneMoment] = deque()
    for moment in moments:
        waiting.append(moment)
        for image in stream.push(moment.frame.image):
            yield _decoded_moment(waiting.popleft(), image, quality)
    for image in stream.finish():
        yield _decoded_moment(waiting.popleft(), image, quality)


def _decoded_moment(
    moment: SceneMoment, image: NDArray[np.uint8], quality: int
) -> tuple[SceneMoment, bytes]:
    frame = replace(moment.frame, image=image)
    return replace(moment, frame=frame), encode_jpeg(image, quality)


class H264Stream:
    """An H.264 encoder followed by a decoder.

    Parameters
    ----------
    compression : CompressionSettings
        `h264`: of its rate, without frames that need later ones, as from a camera; `h264_crf`:
        of its constant rate factor, as in a file.
    frame_rate : float, [1/s]

    Raises
    ------
    ConfigurationError
        When PyAV is not installed; at the first image, for an odd width or height.
    """

    def __init__(self, compression: CompressionSettings, frame_rate: float) -> None:
        self._compression = compression
        self._av = pyav(*_H264)
        self.bytes_written = 0
        self._rate = Fraction(frame_rate).limit_denominator(1000)
        size = compression.rate / _FRAMES_PER_MINUTE
        self._bits = round(8.0 * size * frame_rate)
        self._encoder: Any = None
        self._decoder = self._av.CodecContext.create('h264', 'r')
        self._decoder.thread_count = 1
        self._number = 0

    def push(self, image: NDArray[np.uint8]) -> Iterator[NDArray[np.uint8]]:
        """Encode an image; yield the images that can be decoded."""
        if self._encoder is None:
            self._encoder = self._new_encoder(image.shape)
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format='bgr24')
        frame.pts = self._number
        self._number += 1
        for packet in self._encoder.encode(frame):
            self.bytes_written += packet.size
            yield from self._decode(packet)

    def finish(self) -> Iterator[NDArray[np.uint8]]:
        """Yield the remaining images."""
        if self._encoder is not None:
            for packet in self._encoder.encode(None):
                self.bytes_written += packet.size
                yield from self._decode(packet)
            yield from self._decode(None)

    def _decode(self, packet: Any) -> Iterator[NDArray[np.uint8]]:
        for frame in self._decoder.decode(packet):
            yield np.asarray(frame.to_ndarray(format='bgr24'), dtype=np.uint8)

    def _new_encoder(self, shape: tuple[int, ...]) -> Any:
        height, width = shape[:2]
        if height % 2 or width % 2:
            raise ConfigurationError(
                '--compression-codec', f'h264 of {width} x {height} px', 'give even sides'
            )
        encoder = self._av.CodecContext.create('libx264', 'w')
        encoder.width, encoder.height, encoder.pix_fmt = width, height, 'yuv420p'
        encoder.framerate, encoder.time_base = self._rate, 1 / self._rate
        # One thread, so that the stream is the same on every machine.
        encoder.thread_count = 1
        if self._compression.codec == 'h264_crf':
            encoder.options = {'crf': f'{self._compression.crf:g}'}
            return encoder
        encoder.bit_rate = self._bits
        # No look-ahead, as in a camera.
        buffer = str(self._bits)
        encoder.options = {
            'preset': 'veryfast',
            'tune': 'zerolatency',
            'maxrate': buffer,
            'bufsize': buffer,
        }
        return encoder
