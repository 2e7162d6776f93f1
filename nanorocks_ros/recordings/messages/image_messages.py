"""Camera messages to frames; works on messages of rosbags and of rclpy alike."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from nanorocks_ros.errors import FrameError
from nanorocks_ros.recordings.jpeg_header import is_whole_jpeg
from nanorocks_ros.records import Frame

if TYPE_CHECKING:
    from numpy.typing import NDArray

NS = 1_000_000_000
_CHANNELS = {'bgr8': 3, 'rgb8': 3, 'mono8': 1}
_JPEG_START = b'\xff\xd8'
_READ = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_IGNORE_ORIENTATION


def stamp_ns_of(message: Any) -> int:
    """The stamp in the header of a message, [ns].

    Parameters
    ----------
    message : object with a ``header``
    """
    stamp = message.header.stamp
    return int(stamp.sec) * NS + int(stamp.nanosec)


def usable_stamp_ns(message: Any, where: str) -> int:
    """The same where a frame can be put in order by it.

    Raises
    ------
    FrameError
        For the stamp 0 of drivers that give none, and for times before 1970.
    """
    stamp_ns = stamp_ns_of(message)
    if stamp_ns > 0:
        return stamp_ns
    what = f'a frame of {stamp_ns / NS:g} s since 1970' if stamp_ns else 'a frame without a stamp'
    raise FrameError(where, what, 'let the driver of the camera stamp its frames')


def _bytes_of(data: Any) -> NDArray[np.uint8]:
    # Neither numpy arrays (rosbags) nor array.array (rclpy) are copied.
    return np.frombuffer(data, dtype=np.uint8) if len(data) else np.empty(0, dtype=np.uint8)


def _channels(encoding: str, where: str) -> int:
    channels = _CHANNELS.get(encoding)
    if channels is None:
        known = ', '.join(_CHANNELS)
        raise FrameError(
            where,
            f"encoding '{encoding}' is not supported ({known})",
            'let the camera publish one of these',
        )
    return channels


def frame_from_image(message: Any, where: str) -> Frame:
    """A frame that looks at the pixels of an image message, without copying them.

    Parameters
    ----------
    message : sensor_msgs/Image
        Rows may be padded.
    where : str
        The topic, for errors.

    Returns
    -------
    Frame

    Raises
    ------
    FrameError
        For other encodings than bgr8, rgb8 and mono8, for sizes that do not fit the data, and
        without a stamp.
    """
    encoding = str(message.encoding)
    channels = _channels(encoding, where)
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = _bytes_of(message.data)
    row = width * channels
    if height < 1 or width < 1 or step < row or data.size != height * step:
        raise FrameError(
            where,
            f'{data.size} bytes in rows of {step} are no {width} x {height} {encoding} image '
            f'(expected {height * max(step, row)} bytes, rows of {row} or more)',
            'check the driver of the camera',
        )
    rows = data.reshape(height, step)[:, :row]
    image = rows.reshape(height, width, channels) if channels > 1 else rows
    return Frame(stamp_ns=usable_stamp_ns(message, where), encoding=encoding, image=image)


def frame_from_compressed(message: Any, where: str) -> Frame:
    """A frame decoded from a compressed image message.

    Parameters
    ----------
    message : sensor_msgs/CompressedImage
        JPEG, PNG or another 8-bit format that OpenCV reads.
    where : str
        The topic, for errors.

    Returns
    -------
    Frame
        ``bgr8``, or ``mono8`` when the picture is gray.

    Raises
    ------
    FrameError
        When the picture cannot be decoded, ends too early or has no stamp.
    """
    data = _bytes_of(message.data)
    stamp_ns = usable_stamp_ns(message, where)
    # A JPEG that lost its end is decoded by OpenCV all the same, with gray where the rest was.
    whole = data[:2].tobytes() != _JPEG_START or is_whole_jpeg(data.data)
    image = _decoded(data) if whole else None
    if image is None:
        what = 'cannot be decoded' if whole else 'ends too early'
        if picture_kind(message) in _FILMS:
            raise FrameError(
                where,
                f"holds '{picture_kind(message)}', a film whose pictures need each other",
                'record JPEG or PNG, or write a video of it and run nanorocks import',
            )
        raise FrameError(
            where,
            f"the picture at {stamp_ns} ns ({data.size} bytes, format '{message.format}') {what}",
            'leave this frame out, or record it again',
        )
    return Frame(stamp_ns=stamp_ns, encoding='mono8' if image.ndim == 2 else 'bgr8', image=image)


def _decoded(data: NDArray[np.uint8], flags: int = _READ) -> NDArray[np.uint8] | None:
    try:
        image = cv2.imdecode(data, flags)
    except cv2.error:
        return None
    return None if image is None else np.asarray(image, dtype=np.uint8)


def encode_jpeg(image: NDArray[np.uint8], quality: int) -> bytes:
    """A picture as JPEG.

    Parameters
    ----------
    image : ndarray of uint8, (height, width, 3), bgr, or (height, width)
    quality : int, 1 to 100

    Raises
    ------
    FrameError
        When the array is no picture or the quality is out of range.
    """
    if not 1 <= quality <= 100:
        raise FrameError('JPEG quality', f'{quality}', 'give a number from 1 to 100')
    pictured = image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)
    if image.dtype != np.uint8 or not image.size or not pictured:
        raise FrameError(
            'JPEG',
            f'array of {image.dtype} with shape {image.shape} is no picture',
            'give uint8, (height, width) or (height, width, 3)',
        )
    done, content = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise FrameError(
            'JPEG', f'picture of shape {image.shape} cannot be encoded', 'give a smaller one'
        )
    return content.tobytes()


def jpeg_of(frame: Frame, quality: int) -> bytes:
    """A frame as JPEG, whatever its encoding.

    Raises
    ------
    FrameError
        As `encode_jpeg`.
    """
    image = frame.image
    if frame.encoding == 'rgb8':
        image = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2BGR), dtype=np.uint8)
    return encode_jpeg(image, quality)


def is_decodable(content: bytes) -> bool:
    """Whether OpenCV makes a picture of it."""
    return _decoded(_bytes_of(content)) is not None


def decoded_gray(content: bytes) -> NDArray[np.uint8]:
    """The brightness of a compressed picture, (height, width); empty when it is none."""
    image = _decoded(_bytes_of(content), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    return np.empty((0, 0), dtype=np.uint8) if image is None else image


_FILMS = frozenset({'h264', 'h265', 'hevc', 'vp9', 'av1'})
_STARTS = {
    _JPEG_START: 'jpeg',
    b'\x89PNG': 'png',
    b'BM': 'bmp',
    b'RIFF': 'webp',
    b'II*\x00': 'tiff',
    b'MM\x00*': 'tiff',
    # Units of H.264 and H.265 follow a start code; the first is told by what it holds.
    b'\x00\x00\x00\x01': 'h264',
    b'\x00\x00\x01': 'h264',
}


def picture_kind(message: Any) -> str:
    """How a camera message holds its picture: ``jpeg``, ``h264``, ``bgr8``.

    Parameters
    ----------
    message : sensor_msgs/Image or sensor_msgs/CompressedImage
    """
    if not hasattr(message, 'format'):
        return str(message.encoding)
    start = _bytes_of(message.data)[:4].tobytes()
    for mark, kind in _STARTS.items():
        if start.startswith(mark):
            return kind
    return str(message.format)
