"""Pictures as they were seen, from those of a camera that was held another way."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

Turn = tuple[int, int, int, int]
"""a, b, c, d of a display: ``x' = a x + c y``, ``y' = b x + d y``, y pointing down."""

UPRIGHT: Turn = (1, 0, 0, 1)


def turned(image: NDArray[np.uint8], turn: Turn) -> NDArray[np.uint8]:
    """The picture as a display would show it.

    Parameters
    ----------
    image : ndarray, (height, width[, 3])
    turn : tuple of int
        a, b, c, d of the display: ``x' = a x + c y``, ``y' = b x + d y``, y pointing down.
    """
    a, b, c, d = turn
    if a == 0:
        image, a, d = cv2.transpose(image).astype(np.uint8, copy=False), c, b
    if a < 0:
        image = image[:, ::-1]
    return np.ascontiguousarray(image[::-1] if d < 0 else image)


def turn_of(frame: Any) -> Turn:
    """How a frame of PyAV asks to be turned."""
    for one in frame.side_data:
        if getattr(one.type, 'name', one.type) != 'DISPLAYMATRIX':
            continue
        matrix = np.frombuffer(one, np.int32).astype(float)
        a, b, c, d = matrix[0], matrix[1], matrix[3], matrix[4]
        if abs(b) > abs(a):
            return 0, int(np.sign(b)), int(np.sign(c)), 0
        return int(np.sign(a)) or 1, 0, 0, int(np.sign(d)) or 1
    return UPRIGHT


def words_of(turn: Turn) -> str:
    """What is done to a picture, for people."""
    a, b, c, d = turn
    mirrored = ' and mirrored' if a * d - b * c < 0 else ''
    return f'turned by {round(math.degrees(math.atan2(b, a))) % 360} degrees clockwise{mirrored}'
