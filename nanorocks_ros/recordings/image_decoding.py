"""Decoding of compressed images: JPEG by libjpeg-turbo itself where it is installed.

The wheels of OpenCV take longer for a JPEG than `simplejpeg` does (by 15 % and more), which links
the same library and gives the same pixels. It is optional: ROS distributions do not package it.
Whatever it does not read without a warning (broken and CMYK images, other formats), OpenCV
decodes.

Tested by ``test/recordings/test_image_decoding.py``.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.errors import FrameError
from nanorocks_ros.limits import IMAGE_PIXELS, is_too_large
from nanorocks_ros.recordings.jpeg_header import START, jpeg_head

if TYPE_CHECKING:
    from numpy.typing import NDArray

try:
    import simplejpeg
except ImportError:
    simplejpeg = None

_AS_STORED = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_IGNORE_ORIENTATION
_GRAY = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
# Color space by number of channels; OpenCV converts those of others.
_SPACES = {1: 'GRAY', 3: 'BGR'}


def decoded_image(
    content: NDArray[np.uint8], where: str = 'image', *, gray: bool = False
) -> NDArray[np.uint8] | None:
    """Decode a compressed image as it is stored, whatever orientation its metadata tell.

    Parameters
    ----------
    content : ndarray of uint8, (bytes,)
    where : str
        Where it comes from, for errors.
    gray : bool
        Decode its brightness only.

    Returns
    -------
    ndarray of uint8, (height, width, 3), bgr, or (height, width) if it is gray
        None if it cannot be decoded.

    Raises
    ------
    FrameError
        If it is larger than `IMAGE_PIXELS` allows.
    """
    image = _fast_jpeg(content, gray=gray)
    flags = _GRAY if gray else _AS_STORED
    return _by_opencv(content, where, flags) if image is None else image


def _fast_jpeg(content: NDArray[np.uint8], *, gray: bool) -> NDArray[np.uint8] | None:
    """A JPEG decoded by `simplejpeg`; None if it is not installed or cannot do without doubt."""
    if simplejpeg is None or content[:2].tobytes() != START:
        return None
    head = jpeg_head(content.data)
    # OpenCV refuses those that are too large.
    if head is None or not 0 < head.width * head.height <= IMAGE_PIXELS.value:
        return None
    space = _SPACES.get(head.channels)
    if space is None:
        return None
    # A warning of the library is an error here; OpenCV then shows what there is.
    with suppress(ValueError):
        image = simplejpeg.decode_jpeg(content, 'GRAY' if gray else space)
        if image.shape[:2] == (head.height, head.width):
            return np.asarray(image[:, :, 0] if image.shape[2] == 1 else image, dtype=np.uint8)
    return None


def _by_opencv(content: NDArray[np.uint8], where: str, flags: int) -> NDArray[np.uint8] | None:
    try:
        image = cv2.imdecode(content, flags)
    except cv2.error as error:
        if is_too_large(error):
            raise IMAGE_PIXELS.exceeded(None, FrameError, where) from error
        return None
    return None if image is None else np.asarray(image, dtype=np.uint8)
