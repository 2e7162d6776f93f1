"""What can be said against the gray image of a tray: too bright, too flat, hidden by glare."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.compiled import compiled
from nanorocks_ros.records import Quality

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Levels from here on are full scale; a sensor's noise takes some pixels a little below it.
_FULL = 250
# Glare covers whole blocks of so many pixels, the highlight on a bead does not.
_BLOCK = 8
_GLARE = 0.01
_SATURATED = 0.01
# Gray levels between the darkest and the brightest per cent of the pixels.
_FLAT = 12
_TAIL = 0.01


@compiled
def _survey(gray: NDArray[np.uint8], counts: NDArray[np.int64]) -> int:
    """Count the levels of every other row, and the pixels of all blocks at full scale."""
    rows, columns = gray.shape
    for i in range(0, rows, 2):
        for j in range(columns):
            counts[gray[i, j]] += 1
    hidden = 0
    for i in range(0, rows - _BLOCK + 1, _BLOCK):
        for j in range(0, columns - _BLOCK + 1, _BLOCK):
            if gray[i + _BLOCK // 2, j + _BLOCK // 2] < _FULL:
                continue
            full = True
            for a in range(i, i + _BLOCK):
                for b in range(j, j + _BLOCK):
                    full = full and gray[a, b] >= _FULL
            if full:
                hidden += _BLOCK * _BLOCK
    return hidden


def picture_quality(gray: NDArray[np.uint8]) -> tuple[Quality, float]:
    """Flags for a gray image, and the share of it that is hidden by reflections.

    Parameters
    ----------
    gray : ndarray of uint8, (rows, columns)
    """
    counts = np.zeros(256, dtype=np.int64)
    glare = _survey(gray, counts) / gray.size
    cumulative = np.cumsum(counts) / max(1, int(counts.sum()))
    low, high = np.searchsorted(cumulative, (_TAIL, 1.0 - _TAIL))
    quality = Quality(0)
    if high - low < _FLAT:
        quality |= Quality.LOW_CONTRAST
    if 1.0 - cumulative[_FULL - 1] > _SATURATED:
        quality |= Quality.SATURATED
    if glare > _GLARE:
        quality |= Quality.GLARE
    return quality, glare
