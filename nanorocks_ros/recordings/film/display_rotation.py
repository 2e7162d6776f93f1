"""Rotation of video frames by the display matrix of the file.

Tested by ``test/studies/film_import/test_import_times.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

Rotation = tuple[int, int, int, int]
"""Display matrix a, b, c, d: ``x' = a x + c y``, ``y' = b x + d y``, y pointing down."""

UNROTATED: Rotation = (1, 0, 0, 1)


def rotated(image: NDArray[np.uint8], rotation: Rotation) -> NDArray[np.uint8]:
    """Apply a display matrix to an image.

    Parameters
    ----------
    image : ndarray, (height, width[, 3])
    rotation : tuple of int
        Display matrix, as `Rotation`.
    """
    a, b, c, d = rotation
    if a == 0:
        image, a, d = cv2.transpose(image).astype(np.uint8, copy=False), c, b
    if a < 0:
        image = image[:, ::-1]
    return np.ascontiguousarray(image[::-1] if d < 0 else image)


def rotation_of(frame: Any) -> Rotation:
    """Display matrix of a frame of PyAV; `UNROTATED` if it has none."""
    for entry in frame.side_data:
        if getattr(entry.type, 'name', entry.type) != 'DISPLAYMATRIX':
            continue
        matrix = np.frombuffer(entry, np.int32).astype(float)
        a, b, c, d = matrix[0], matrix[1], matrix[3], matrix[4]
        if abs(b) > abs(a):
            return 0, int(np.sign(b)), int(np.sign(c)), 0
        return int(np.sign(a)) or 1, 0, 0, int(np.sign(d)) or 1
    return UNROTATED


def rotation_text(rotation: Rotation) -> str:
    """Description of a rotation for notices."""
    a, b, c, d = rotation
    mirrored = ' and mirrored' if a * d - b * c < 0 else ''
    return f'rotated by {round(math.degrees(math.atan2(b, a))) % 360} degrees clockwise{mirrored}'
