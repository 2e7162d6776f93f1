"""How much of the difference of two pictures is motion, not noise.

Tested by ``test/recordings/film/test_duplicate_frames.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Shifts explain 0.5 to 0.9 of the difference of distinct frames, and 0.02 of compression noise.
_SHIFTED = 0.3
# A file that holds more frames a second than the camera took repeats at least one in 25 (24 in 25
# frames a second): fewer are no repeats. Among so few frames one cannot tell.
_REPEATED, _FEW = 0.03, 30
# Beads that move differently lie in different blocks of so many pixels.
_BLOCK_PX = 16
# Smallest determinant of a gradient matrix, relative to the square of its trace: below it, only
# motion across the edge of a block is seen.
_EDGE = 1e-3


def shifted_share(before: NDArray[np.uint8], now: NDArray[np.uint8]) -> float:
    r"""Share of the squared difference of two pictures that small shifts explain.

    The difference of a picture that moved by :math:`u` is :math:`-u \cdot \nabla I`. In each
    block, :math:`u` is fitted by least squares (Lucas and Kanade 1981). Noise of a sensor or codec
    is not parallel to the gradient: two shifts explain 2 of the 256 pixels of a block.

    Parameters
    ----------
    before, now : ndarray of uint8, (rows, columns)

    Returns
    -------
    float
        0 to 1; 0 for identical pictures, and for pictures smaller than a block.
    """
    rows, columns = (side // _BLOCK_PX * _BLOCK_PX for side in before.shape)
    if not rows or not columns:
        return 0.0
    first, second = (image[:rows, :columns].astype(np.float32) for image in (before, now))
    change, middle = second - first, 0.5 * (first + second)
    across = cv2.Sobel(middle, cv2.CV_32F, 1, 0, scale=0.125)
    down = cv2.Sobel(middle, cv2.CV_32F, 0, 1, scale=0.125)
    xx, xy, yy, xd, yd, dd = (
        _block_means(left * right)
        for left, right in (
            (across, across),
            (across, down),
            (down, down),
            (across, change),
            (down, change),
            (change, change),
        )
    )
    total = float(dd.sum())
    if total == 0.0:
        return 0.0
    floor = _EDGE * (xx + yy) ** 2 + 1e-9
    determinant = np.maximum(xx * yy - xy * xy, floor)
    explained = (yy * xd * xd - 2.0 * xy * xd * yd + xx * yd * yd) / determinant
    return float(np.clip(explained, 0.0, dd).sum()) / total


def is_shifted(share: float) -> bool:
    """Whether the difference of two alike pictures is motion, by its `shifted_share`."""
    return share >= _SHIFTED


def repeats_often(repeats: int, frames: int) -> bool:
    """Whether so many frames that show hardly anything new are repeats of a picture.

    A camera that jitters comes back to its place now and then, and a codec then skips most of a
    picture in which beads have moved a little.
    """
    return frames < _FEW or repeats >= _REPEATED * frames


def _block_means(values: NDArray[np.float32]) -> NDArray[np.float32]:
    rows, columns = (side // _BLOCK_PX for side in values.shape)
    means: NDArray[np.float32] = values.reshape(rows, _BLOCK_PX, columns, _BLOCK_PX).mean((1, 3))
    return means
