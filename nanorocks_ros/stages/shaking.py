"""Sensor noise and shaking events, from the difference of consecutive gray images."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

NS = 1_000_000_000

# Half a second of pictures at 30 Hz: longer than a jump takes, shorter than a decay.
_MEMORY_FRAMES = 15
_NOISE_FRAMES = 300
_NOISE_QUANTILE = 0.2
# Beyond 3 sigma a difference counts as motion; what is left of a Gaussian has this variance.
_CLIP = 3.0
_CLIPPED_VARIANCE = 0.9733
# A uint8 difference of variance 2 sigma^2 is never known better than its rounding.
_ROUNDING_POWER = 1.0 / 6.0


def difference_power(later: NDArray[np.uint8], earlier: NDArray[np.uint8]) -> float:
    """Sum of the squared differences of two gray images, [gray levels^2]."""
    return float(cv2.norm(later, earlier, cv2.NORM_L2SQR))


def noise_power(later: NDArray[np.uint8], earlier: NDArray[np.uint8]) -> float:
    """Mean squared difference per pixel that two images of a scene at rest would have.

    Pixels in which something moved are clipped away, iteratively.

    Returns
    -------
    float, [gray levels^2]
        Twice the variance of the sensor noise.
    """
    difference = cv2.absdiff(later, earlier)
    counts = np.bincount(difference.ravel(), minlength=256).astype(np.float64)
    squares = np.arange(256.0) ** 2
    power = float(counts @ squares / counts.sum())
    for _ in range(30):
        kept = squares <= max(1.0, _CLIP**2 * power)
        clipped = float((counts * kept) @ squares / (counts @ kept)) / _CLIPPED_VARIANCE
        if abs(clipped - power) <= 1e-6 * power:
            break
        power = clipped
    return max(power, _ROUNDING_POWER)


class ShakeDetector:
    """Counts shaking events: jumps of the motion between two consecutive images.

    A shaking event sets every bead in motion between one frame and the next, whereas
    collisions change the mean squared difference of two images by some ten per cent. Each
    stage that needs the cycle counts for itself: the same images give the same count.

    Parameters
    ----------
    ratio : float
        Smallest jump of the motion, as a factor.
    shortest_cycle : float, [s]
    """

    def __init__(self, ratio: float, shortest_cycle: float) -> None:
        self._ratio = ratio
        self._shortest_ns = round(shortest_cycle * NS)
        self._recent: deque[float] = deque(maxlen=_MEMORY_FRAMES)
        self._noise: deque[float] = deque(maxlen=_NOISE_FRAMES)
        self._last: tuple[int, NDArray[np.uint8]] | None = None
        self.cycle = 0
        self.cycle_start_ns: int | None = None
        self.noise_power = 0.0

    def push(self, stamp_ns: int, gray: NDArray[np.uint8]) -> bool:
        """Take the next image; True when the tray was shaken since the one before."""
        last, self._last = self._last, (stamp_ns, gray)
        if last is None:
            return False
        self._noise.append(noise_power(gray, last[1]))
        # Slow motion hides in the noise, and a frame stored twice has none: neither the mean
        # nor the least will do.
        self.noise_power = float(np.quantile(self._noise, _NOISE_QUANTILE))
        quiet = self.noise_power * gray.size
        motion = difference_power(gray, last[1]) - quiet
        # 15 frames rather than all: the gas may have been shaken harder long ago.
        before = max(self._recent, default=None)
        self._recent.append(motion)
        rested = self.cycle_start_ns is None or last[0] - self.cycle_start_ns >= self._shortest_ns
        if before is None or not rested:
            return False
        if motion <= self._ratio * max(before, 0.0) + quiet:
            return False
        self.cycle += 1
        self.cycle_start_ns = last[0]
        return True
