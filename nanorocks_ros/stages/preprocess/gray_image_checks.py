"""Checks of the gray image of a tray: saturation, low contrast and glare.

Tested by ``test/stages/preprocess/test_frame_preprocessor.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.records import Quality

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Levels from here on count as full scale, with the noise of the sensor.
_FULL = 250
# Glare covers whole blocks of so many pixels, the highlight on a bead does not.
_BLOCK = 8
_GLARE = 0.01
_SATURATED = 0.01
# Gray levels between the darkest and the brightest per cent of the pixels.
_FLAT = 12
_TAIL = 0.01


@compiled
def _levels(gray: NDArray[np.uint8]) -> tuple[int, float]:
    """Contrast, and share of the pixels at full scale, from every other row."""
    counts = np.zeros(256, dtype=np.int64)
    rows, columns = gray.shape
    for i in range(0, rows, 2):
        for j in range(columns):
            counts[np.uint64(gray[i, j])] += 1
    pixels = ((rows + 1) // 2) * columns
    below, low, high = 0, -1, 255
    for level in range(256):
        below += counts[level]
        if low < 0 and below >= _TAIL * pixels:
            low = level
        if below >= (1.0 - _TAIL) * pixels:
            high = level
            break
    return high - low, counts[_FULL:].sum() / pixels


@compiled
def _hidden(gray: NDArray[np.uint8]) -> float:
    """Share of the picture in blocks that are at full scale all over."""
    rows, columns = gray.shape
    blocks = 0
    for i in range(0, rows - _BLOCK + 1, _BLOCK):
        for j in range(0, columns - _BLOCK + 1, _BLOCK):
            # Most blocks are dark in the middle.
            if gray[i + _BLOCK // 2, j + _BLOCK // 2] >= _FULL:
                blocks += gray[i : i + _BLOCK, j : j + _BLOCK].min() >= _FULL
    return blocks * _BLOCK * _BLOCK / gray.size


def picture_quality(gray: NDArray[np.uint8]) -> tuple[Quality, float]:
    """Flags for a gray image, and the share of it that is hidden by reflections.

    Parameters
    ----------
    gray : ndarray of uint8, (rows, columns)
    """
    contrast, full = _levels(gray)
    glare = _hidden(gray)
    quality = Quality(0)
    if contrast < _FLAT:
        quality |= Quality.LOW_CONTRAST
    if full > _SATURATED:
        quality |= Quality.SATURATED
    if glare > _GLARE:
        quality |= Quality.GLARE
    return quality, float(glare)
