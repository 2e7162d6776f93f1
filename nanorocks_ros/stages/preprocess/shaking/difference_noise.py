"""Noise of gray images, from the differences of successive ones.

Tested by ``test/stages/preprocess/shaking/test_shake_detection.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.quantiles import Quantile

if TYPE_CHECKING:
    from numpy.typing import NDArray


# Half a second of pictures at 30 Hz: longer than a jump takes, shorter than a decay.
MEMORY_FRAMES = 15
# Frames needed for the smallest noise.
_FEW_FRAMES = 5
NOISE_QUANTILE = 0.2
# Beyond 3 sigma a difference counts as motion; what is left of a Gaussian has this variance.
_CLIP = 3.0
_CLIPPED_VARIANCE = 0.9733
# A uint8 difference of variance 2 sigma^2 is never known better than its rounding.
_ROUNDING_POWER = 1.0 / 6.0


def difference_power(later: NDArray[np.uint8], earlier: NDArray[np.uint8]) -> float:
    """Sum of the squared differences of two gray images, [gray levels^2]."""
    return float(cv2.norm(later, earlier, cv2.NORM_L2SQR))


@compiled
def difference_counts(later: NDArray[np.uint8], earlier: NDArray[np.uint8]) -> NDArray[np.int64]:
    """How many pixels differ by 0, 1, ... 255 gray levels."""
    # Two tables: the same entry twice in a row would wait for itself.
    counts = np.zeros((2, 256), dtype=np.int64)
    first, second = later.reshape(-1), earlier.reshape(-1)
    for k in range(first.size):
        place = np.uint64(k)
        difference = np.int32(first[place]) - np.int32(second[place])
        counts[np.uint64(k & 1), np.uint64(abs(difference))] += 1
    total: NDArray[np.int64] = counts[0] + counts[1]
    return total


@compiled
def total_power(counts: NDArray[np.int64]) -> float:
    """Sum of the squared differences, [gray levels^2]; exact, for they are whole numbers."""
    total = 0.0
    for level in range(256):
        total += counts[level] * float(level * level)
    return total


@compiled
def clipped_power(counts: NDArray[np.int64]) -> float:
    """Noise: mean squared difference of the pixels in which nothing moved, [gray levels^2]."""
    pixels = 0.0
    for level in range(256):
        pixels += counts[level]
    power = total_power(counts) / pixels
    for _ in range(30):
        bound = max(1.0, _CLIP * _CLIP * power)
        kept, kept_power = 0.0, 0.0
        for level in range(256):
            if level * level <= bound:
                kept += counts[level]
                kept_power += counts[level] * float(level * level)
        clipped = kept_power / kept / _CLIPPED_VARIANCE
        if abs(clipped - power) <= 1e-6 * power:
            break
        power = clipped
    return max(power, _ROUNDING_POWER)


def noise_power(later: NDArray[np.uint8], earlier: NDArray[np.uint8]) -> float:
    """Mean squared difference per pixel that two images of a scene at rest would have.

    Pixels in which something moved are clipped away, iteratively.

    Returns
    -------
    float, [gray levels^2]
        Twice the variance of the sensor noise.
    """
    counts = difference_counts(np.ascontiguousarray(later), np.ascontiguousarray(earlier))
    return float(clipped_power(counts))


class NoiseMeter:
    """Noise of a series of images: the smallest measured.

    Where grains cover much of a picture, fast motion cannot be told from noise: of the grains of
    tray 7 at 15 mm/s all motion was taken for noise. Grains that are slow or at rest show it.
    """

    def __init__(self) -> None:
        # A frame stored twice has no noise: the minimum would be wrong.
        self._recent = Quantile(NOISE_QUANTILE, MEMORY_FRAMES)
        self._pushed = 0
        self._smallest = math.inf
        self._last: NDArray[np.uint8] | None = None

    def start_from(self, image: NDArray[np.uint8]) -> None:
        """Compare the next image with this one."""
        self._last = image

    def push(self, image: NDArray[np.uint8]) -> float:
        """Mean squared difference per pixel of two images of a scene at rest."""
        last, self._last = self._last, image
        if last is None:
            return 0.0
        recent = self._recent.push(noise_power(image, last))
        self._pushed += 1
        if self._pushed >= _FEW_FRAMES:
            self._smallest = min(self._smallest, recent)
        return min(self._smallest, recent)
