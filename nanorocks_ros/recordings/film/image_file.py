"""Decoding of image files to 8 bits, including 16-bit files of cameras with 8 to 14 bits.

Tested by ``test/studies/film_import/test_import_times.py``.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.limits import IMAGE_PIXELS, is_too_large, require_regular_file

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

# Bits of sensors. Files have 8 or 16 bits and do not state how many of them the camera uses.
_SENSOR_BITS = (8, 10, 12, 14)
FULL_BITS = 16
"""Bits per channel of images with more than 8 bits."""

_EIGHT_BIT = -1


def read_image(file: Path, bits: int = FULL_BITS) -> NDArray[np.uint8] | None:
    """Decode an image file, upright, gray or bgr; None if it cannot be decoded.

    Parameters
    ----------
    file : Path
    bits : int
        Number of the lower bits that the camera uses in 16-bit images, 8 to 16.
    """
    image = _decoded(file, cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH)
    if image is not None and image.dtype == np.uint16:
        image = np.minimum(image >> (bits - 8), 255)
    elif image is not None and image.dtype != np.uint8:
        # OpenCV converts other types (float) to 8 bits.
        image = _decoded(file, cv2.IMREAD_ANYCOLOR)
    return None if image is None else image.astype(np.uint8, copy=False)


def bits_used(files: Sequence[Path]) -> int:
    """Number of bits that 16-bit images use; 16 also if the first image has 8 bits.

    Parameters
    ----------
    files : sequence of Path
        All are read if the highest bit of the first image is not used.
    """
    first = next((value for value in map(_max_value, files) if value is not None), None)
    if first is None or first == _EIGHT_BIT or first >> (FULL_BITS - 1):
        return FULL_BITS
    with ThreadPoolExecutor() as pool:
        values = [value for value in pool.map(_max_value, files) if value is not None]
    largest = max(value for value in values if value != _EIGHT_BIT)
    return next((bits for bits in _SENSOR_BITS if not largest >> bits), FULL_BITS)


def _max_value(file: Path) -> int | None:
    """Largest value of a 16-bit image; `_EIGHT_BIT` if it has 8 bits; None if not decodable."""
    image = _decoded(file, cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH)
    if image is None:
        return None
    return int(image.max()) if image.dtype == np.uint16 else _EIGHT_BIT


def _decoded(file: Path, flags: int) -> NDArray[Any] | None:
    require_regular_file(file, RecordingError)
    try:
        content = np.fromfile(file, np.uint8)
        image = cv2.imdecode(content, flags) if content.size else None
    except OSError:
        return None
    except cv2.error as error:
        if is_too_large(error):
            raise IMAGE_PIXELS.exceeded(None, RecordingError, str(file)) from error
        return None
    return None if image is None else np.asarray(image)
