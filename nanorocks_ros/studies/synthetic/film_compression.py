"""What compression does to a simulated film: JPEG by quality or by size, or a stream of H.264."""

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

# Frames of the minute that the rate is given for.
_FRAMES = 1800.0
_QUALITIES = 1, 100
# What needs PyAV, and what does without.
_H264 = '--compression-codec h264', 'take jpeg'
# The size of a frame may be off by this much before the quality is changed.
_TOLERANCE = 0.02


def compressed(
    moments: Iterable[SceneMoment],
    compression: CompressionSettings,
    *,
    quality: int,
    frame_rate: float,
) -> Iterator[tuple[SceneMoment, bytes]]:
    """Each moment as its compressed picture shows it, and that picture as a JPEG.

    Parameters
    ----------
    moments : iterable of SceneMoment
    compression : CompressionSettings
    quality : int, 1 to 100
        Of the JPEGs: unless they must keep to a size, and of those that hold what the decoder
        of a stream gave out.
    frame_rate : float, [1/s]

    Yields
    ------
    SceneMoment
        With the frame as it was; for H.264 the one that was decoded.
    bytes

    Raises
    ------
    ConfigurationError
        When PyAV, which makes H.264, is not installed.
    """
    if compression.codec == 'h264':
        yield from _through_h264(moments, compression.rate / _FRAMES, quality, frame_rate)
        return
    keeper = _SizeKeeper(compression.rate / _FRAMES)
    for moment in moments:
        image = moment.frame.image
        sized = compression.codec == 'jpeg_rate'
        yield moment, keeper.encode(image) if sized else encode_jpeg(image, quality)


def check_codec(compression: CompressionSettings) -> None:
    """Refuse a codec that nothing here knows.

    Raises
    ------
    ConfigurationError
        When PyAV is needed and not installed.
    """
    if compression.codec == 'h264':
        pyav(*_H264)


class _SizeKeeper:
    """Chooses the quality of JPEGs so that their mean size is the wanted.

    Parameters
    ----------
    size : float, [bytes]
    """

    def __init__(self, size: float) -> None:
        self._size = size
        self._quality: int | None = None
        self._excess = 0.0

    def encode(self, image: NDArray[np.uint8]) -> bytes:
        """The next picture as a JPEG."""
        if self._quality is None:
            self._quality = self._found(image)
        content = encode_jpeg(image, self._quality)
        self._excess += len(content) / self._size - 1.0
        if abs(self._excess) > _TOLERANCE:
            step = -1 if self._excess > 0.0 else 1
            low, high = _QUALITIES
            self._quality = min(max(self._quality + step, low), high)
        return content

    def _found(self, image: NDArray[np.uint8]) -> int:
        """The largest quality that a picture does not exceed the size with."""
        low, high = _QUALITIES
        while low < high:
            middle = (low + high + 1) // 2
            if len(encode_jpeg(image, middle)) > self._size:
                high = middle - 1
            else:
                low = middle
        return low


def _through_h264(
    moments: Iterable[SceneMoment], size: float, quality: int, frame_rate: float
) -> Iterator[tuple[SceneMoment, bytes]]:
    stream = H264Stream(size, frame_rate)
    waiting: deque[SceneMoment] = deque()
    for moment in moments:
        waiting.append(moment)
        for image in stream.push(moment.frame.image):
            yield _seen(waiting.popleft(), image, quality)
    for image in stream.finish():
        yield _seen(waiting.popleft(), image, quality)


def _seen(
    moment: SceneMoment, image: NDArray[np.uint8], quality: int
) -> tuple[SceneMoment, bytes]:
    frame = replace(moment.frame, image=image)
    return replace(moment, frame=frame), encode_jpeg(image, quality)


class H264Stream:
    """An encoder and the decoder behind it.

    Parameters
    ----------
    size : float, [bytes]
        Of a frame, in the mean.
    frame_rate : float, [1/s]

    Raises
    ------
    ConfigurationError
        When PyAV is not installed; at the first picture, for sides that are not even.
    """

    def __init__(self, size: float, frame_rate: float) -> None:
        self._av = pyav(*_H264)
        self.bytes_written = 0
        self._rate = Fraction(frame_rate).limit_denominator(1000)
        self._bits = round(8.0 * size * frame_rate)
        self._encoder: Any = None
        self._decoder = self._av.CodecContext.create('h264', 'r')
        self._decoder.thread_count = 1
        self._number = 0

    def push(self, image: NDArray[np.uint8]) -> Iterator[NDArray[np.uint8]]:
        """Encode a picture; those that can be decoded now."""
        if self._encoder is None:
            self._encoder = self._started(image.shape)
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format='bgr24')
        frame.pts = self._number
        self._number += 1
        for packet in self._encoder.encode(frame):
            self.bytes_written += packet.size
            yield from self._decoded(packet)

    def finish(self) -> Iterator[NDArray[np.uint8]]:
        """The last pictures."""
        if self._encoder is not None:
            for packet in self._encoder.encode(None):
                self.bytes_written += packet.size
                yield from self._decoded(packet)
            yield from self._decoded(None)

    def _decoded(self, packet: Any) -> Iterator[NDArray[np.uint8]]:
        for frame in self._decoder.decode(packet):
            yield np.asarray(frame.to_ndarray(format='bgr24'), dtype=np.uint8)

    def _started(self, shape: tuple[int, ...]) -> Any:
        height, width = shape[:2]
        if height % 2 or width % 2:
            raise ConfigurationError(
                '--compression-codec', f'h264 of {width} x {height} px', 'give even sides'
            )
        encoder = self._av.CodecContext.create('libx264', 'w')
        encoder.width, encoder.height, encoder.pix_fmt = width, height, 'yuv420p'
        encoder.framerate, encoder.time_base = self._rate, 1 / self._rate
        encoder.bit_rate = self._bits
        # One thread: then the stream is the same on every machine. No look-ahead: a camera
        # cannot look ahead.
        encoder.thread_count = 1
        buffer = str(self._bits)
        encoder.options = {
            'preset': 'veryfast',
            'tune': 'zerolatency',
            'maxrate': buffer,
            'bufsize': buffer,
        }
        return encoder
