"""Conversion of image messages, of rosbags and of rclpy, to frames; JPEG compression."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import cv2
import numpy as np

from nanorocks_ros.errors import FrameError
from nanorocks_ros.recordings.image_decoding import decoded_image
from nanorocks_ros.recordings.jpeg_header import START as JPEG_START
from nanorocks_ros.recordings.jpeg_header import is_whole_jpeg
from nanorocks_ros.records import NS, Frame

if TYPE_CHECKING:
    from numpy.typing import NDArray


class _Encoding(NamedTuple):
    """How the pixels of an encoding become those of a frame."""

    bytes: int
    """Of a pixel."""
    frame: str
    """Encoding of the frame."""
    conversion: int | None = None
    """Code of cv2.cvtColor; None: the first channels are taken as they are."""


_FRAME_CHANNELS = {'bgr8': 3, 'rgb8': 3, 'mono8': 1}
_ENCODINGS = {
    'bgr8': _Encoding(3, 'bgr8'),
    'rgb8': _Encoding(3, 'rgb8'),
    'mono8': _Encoding(1, 'mono8'),
    'bgra8': _Encoding(4, 'bgr8'),
    'rgba8': _Encoding(4, 'rgb8'),
    '8UC3': _Encoding(3, 'bgr8'),
    '8UC1': _Encoding(1, 'mono8'),
    'mono16': _Encoding(2, 'mono8'),
    # OpenCV names a pattern by its second row.
    'bayer_rggb8': _Encoding(1, 'bgr8', cv2.COLOR_BayerBG2BGR),
    'bayer_bggr8': _Encoding(1, 'bgr8', cv2.COLOR_BayerRG2BGR),
    'bayer_gbrg8': _Encoding(1, 'bgr8', cv2.COLOR_BayerGR2BGR),
    'bayer_grbg8': _Encoding(1, 'bgr8', cv2.COLOR_BayerGB2BGR),
    'yuv422': _Encoding(2, 'bgr8', cv2.COLOR_YUV2BGR_UYVY),
    'uyvy': _Encoding(2, 'bgr8', cv2.COLOR_YUV2BGR_UYVY),
    'yuv422_yuy2': _Encoding(2, 'bgr8', cv2.COLOR_YUV2BGR_YUY2),
    'yuyv': _Encoding(2, 'bgr8', cv2.COLOR_YUV2BGR_YUY2),
}
# Video codecs and the first bytes of image formats.
_VIDEO_CODECS = frozenset({'h264', 'h265', 'hevc', 'vp9', 'av1'})
_STARTS = {
    JPEG_START: 'jpeg',
    b'\x89PNG': 'png',
    b'BM': 'bmp',
    b'RIFF': 'webp',
    b'II*\x00': 'tiff',
    b'MM\x00*': 'tiff',
    # Start codes of H.264 and H.265, which are not distinguished here.
    b'\x00\x00\x00\x01': 'h264',
    b'\x00\x00\x01': 'h264',
}


def stamp_ns_of(message: Any) -> int:
    """Time stamp in the header of a message, [ns].

    Parameters
    ----------
    message : object with a ``header``
    """
    stamp = message.header.stamp
    return int(stamp.sec) * NS + int(stamp.nanosec)


def valid_stamp_ns(message: Any, where: str) -> int:
    """Time stamp in the header of a message, checked to be after 1970, [ns].

    Raises
    ------
    FrameError
        If the stamp is 0, as from drivers that do not stamp, or before 1970.
    """
    stamp_ns = stamp_ns_of(message)
    if stamp_ns > 0:
        return stamp_ns
    problem = (
        f'a frame has the time stamp {stamp_ns / NS:g} s, before 1970'
        if stamp_ns
        else 'a frame has no time stamp'
    )
    raise FrameError(where, problem, 'configure the camera driver to stamp its frames')


def _bytes_of(data: Any) -> NDArray[np.uint8]:
    """View of the data of a message; numpy arrays (rosbags) and array.array (rclpy) alike."""
    return np.frombuffer(data, dtype=np.uint8) if len(data) else np.empty(0, dtype=np.uint8)


def _known(encoding: str, where: str) -> _Encoding:
    known = _ENCODINGS.get(encoding)
    if known is None:
        raise FrameError(
            where,
            f"encoding '{encoding}' is not supported ({', '.join(_ENCODINGS)})",
            'configure the camera to publish one of these, or convert it with a node (image_proc '
            'debayer_node for Bayer patterns of 16 bits)',
        )
    return known


def frame_from_image(message: Any, where: str) -> Frame:
    """Convert an image message to a frame; where they can be, the pixels are a view of it.

    An alpha channel is left out, of 16 bits the upper 8 are kept; Bayer patterns and 4:2:2 YUV
    are converted.

    Parameters
    ----------
    message : sensor_msgs/Image
        Rows may be padded.
    where : str
        The topic, for error messages.

    Returns
    -------
    Frame

    Raises
    ------
    FrameError
        If the encoding is not supported, the size does not fit the data, or there is no time
        stamp.
    """
    encoding = str(message.encoding)
    known = _known(encoding, where)
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = _bytes_of(message.data)
    row = width * known.bytes
    if height < 1 or width < 1 or step < row or data.size != height * step:
        raise FrameError(
            where,
            f'{data.size} bytes in rows of {step} do not fit a {width} x {height} {encoding} '
            f'image (expected {height * max(step, row)} bytes, rows of {row} or more)',
            'check the camera driver',
        )
    rows = data.reshape(height, step)[:, :row]
    pixels = rows.reshape(height, width, known.bytes)
    image = _frame_pixels(pixels, known, upper_byte=0 if message.is_bigendian else 1)
    return Frame(stamp_ns=valid_stamp_ns(message, where), encoding=known.frame, image=image)


def _frame_pixels(
    pixels: NDArray[np.uint8], known: _Encoding, *, upper_byte: int
) -> NDArray[np.uint8]:
    """The pixels of a frame, from those of a message: (height, width, bytes of a pixel)."""
    if known.conversion is not None:
        own = np.ascontiguousarray(pixels)
        return np.asarray(cv2.cvtColor(own, known.conversion), dtype=np.uint8)
    channels = _FRAME_CHANNELS[known.frame]
    if channels > 1:
        return pixels[:, :, :channels]
    return pixels[:, :, upper_byte if known.bytes > 1 else 0]


def frame_from_compressed(message: Any, where: str) -> Frame:
    """Decode a compressed image message to a frame.

    Parameters
    ----------
    message : sensor_msgs/CompressedImage
        JPEG, PNG or another 8-bit format that OpenCV reads.
    where : str
        The topic, for error messages.

    Returns
    -------
    Frame
        ``bgr8``, or ``mono8`` if the image is gray.

    Raises
    ------
    FrameError
        If the image cannot be decoded, is truncated or has no time stamp.
    """
    data = _bytes_of(message.data)
    stamp_ns = valid_stamp_ns(message, where)
    # OpenCV decodes a truncated JPEG without an error and fills the missing part with gray.
    complete = data[:2].tobytes() != JPEG_START or is_whole_jpeg(data.data)
    image = decoded_image(data, where) if complete else None
    if image is None:
        kind = image_kind(message)
        if kind in _VIDEO_CODECS:
            raise FrameError(
                where,
                f"holds '{kind}', a video whose frames depend on each other",
                'record JPEG or PNG, or write it to a video file and run nanorocks import',
            )
        problem = 'cannot be decoded' if complete else 'is truncated'
        size = f"{data.size} bytes, format '{message.format}'"
        raise FrameError(
            where,
            f'the image at {stamp_ns} ns ({size}) {problem}',
            'omit this frame, or record it again',
        )
    return Frame(stamp_ns=stamp_ns, encoding='mono8' if image.ndim == 2 else 'bgr8', image=image)


def encode_jpeg(image: NDArray[np.uint8], quality: int) -> bytes:
    """Compress an image to JPEG.

    Parameters
    ----------
    image : ndarray of uint8, (height, width, 3), bgr, or (height, width)
    quality : int, 1 to 100

    Raises
    ------
    FrameError
        If the array is not an image or the quality is out of range.
    """
    if not 1 <= quality <= 100:
        raise FrameError('JPEG quality', f'{quality}', 'give a number from 1 to 100')
    has_image_shape = image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)
    if image.dtype != np.uint8 or not image.size or not has_image_shape:
        raise FrameError(
            'JPEG',
            f'array of {image.dtype} with shape {image.shape} is not an image',
            'give uint8, (height, width) or (height, width, 3)',
        )
    encoded, content = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not encoded:
        raise FrameError(
            'JPEG', f'image of shape {image.shape} cannot be encoded', 'give a smaller image'
        )
    return content.tobytes()


def frame_to_jpeg(frame: Frame, quality: int) -> bytes:
    """Compress a frame of any encoding to JPEG.

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
    """Whether a compressed image can be decoded."""
    return decoded_image(_bytes_of(content)) is not None


def decoded_gray(content: bytes) -> NDArray[np.uint8]:
    """Brightness of a compressed image, (height, width); empty if it cannot be decoded."""
    image = decoded_image(_bytes_of(content), gray=True)
    return np.empty((0, 0), dtype=np.uint8) if image is None else image


def image_kind(message: Any) -> str:
    """Image format, video codec or encoding of a camera message: ``jpeg``, ``h264``, ``bgr8``.

    Parameters
    ----------
    message : sensor_msgs/Image or sensor_msgs/CompressedImage
    """
    if not hasattr(message, 'format'):
        return str(message.encoding)
    start = _bytes_of(message.data)[:4].tobytes()
    for magic, kind in _STARTS.items():
        if start.startswith(magic):
            return kind
    return str(message.format)
