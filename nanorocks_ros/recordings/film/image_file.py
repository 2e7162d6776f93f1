"""An image file as a picture of 8 bits, of whichever of its bits the camera filled."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

# What sensors have; files know 8 and 16 alone, and cameras that fill the lower ones do not say.
_SENSORS = (8, 10, 12, 14)
FULL = 16
"""Bits of images that have more than 8."""

_OF_8 = -1


def opened(file: Path, bits: int = FULL) -> NDArray[np.uint8] | None:
    """Its pixels, upright, gray or bgr; None when it cannot be decoded.

    Parameters
    ----------
    file : Path
    bits : int
        Of those in images of 16 bits, the lower ones that are filled, 8 to 16.
    """
    image = _decoded(file, cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH)
    if image is not None and image.dtype == np.uint16:
        image = np.minimum(image >> (bits - 8), 255)
    elif image is not None and image.dtype != np.uint8:
        # Of what is neither, OpenCV knows how bright it is.
        image = _decoded(file, cv2.IMREAD_ANYCOLOR)
    return None if image is None else image.astype(np.uint8, copy=False)


def bits_used(files: Sequence[Path]) -> int:
    """How many of their 16 bits images fill; 16 also where the first has not so many.

    Parameters
    ----------
    files : sequence of Path
        All are looked at, where the first leaves the highest bit empty.
    """
    first = next((most for most in map(_most, files) if most is not None), None)
    if first is None or first == _OF_8 or first >> (FULL - 1):
        return FULL
    with ThreadPoolExecutor() as pool:
        found = [one for one in pool.map(_most, files) if one is not None and one != _OF_8]
    most = max(found)
    return next((bits for bits in _SENSORS if not most >> bits), FULL)


def _most(file: Path) -> int | None:
    """The largest number in an image of 16 bits; `_OF_8` of one of fewer; None of no image."""
    image = _decoded(file, cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH)
    if image is None:
        return None
    return int(image.max()) if image.dtype == np.uint16 else _OF_8


def _decoded(file: Path, flags: int) -> NDArray[Any] | None:
    try:
        content = np.fromfile(file, np.uint8)
        image = cv2.imdecode(content, flags) if content.size else None
    except (OSError, cv2.error):
        return None
    return None if image is None else np.asarray(image)
