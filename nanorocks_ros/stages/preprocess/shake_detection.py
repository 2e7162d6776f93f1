"""Sensor noise and shaking events, from the gray images and from the motion of the trays.

The :class:`ShakeCounter` of the preprocessor counts the shaking events; each tray image carries
the count. For images without a count a :class:`CycleFollower` finds the same events.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.quantiles import Quantile, median

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from nanorocks_ros.records import TrayImage

NS = 1_000_000_000

# Half a second of pictures at 30 Hz: longer than a jump takes, shorter than a decay.
_MEMORY_FRAMES = 15
_NOISE_FRAMES = 300
# Frames needed for the smallest noise.
_FEW_FRAMES = 5
_NOISE_QUANTILE = 0.2
# A step in time so many times longer than usual means that frames are missing.
_GAP = 1.75
# Beyond 3 sigma a difference counts as motion; what is left of a Gaussian has this variance.
_CLIP = 3.0
_CLIPPED_VARIANCE = 0.9733
# A uint8 difference of variance 2 sigma^2 is never known better than its rounding.
_ROUNDING_POWER = 1.0 / 6.0
# An oscillating plate stands still twice in every period, which is no rest.
_SWING_NS = 5 * NS
# Smallest significant speed of the tray, in standard errors.
_SIGNIFICANT = 5.0


def difference_power(later: NDArray[np.uint8], earlier: NDArray[np.uint8]) -> float:
    """Sum of the squared differences of two gray images, [gray levels^2]."""
    return float(cv2.norm(later, earlier, cv2.NORM_L2SQR))


@compiled
def _difference_counts(later: NDArray[np.uint8], earlier: NDArray[np.uint8]) -> NDArray[np.int64]:
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
def _total_power(counts: NDArray[np.int64]) -> float:
    """Sum of the squared differences, [gray levels^2]; exact, for they are whole numbers."""
    total = 0.0
    for level in range(256):
        total += counts[level] * float(level * level)
    return total


@compiled
def _power_of(counts: NDArray[np.int64]) -> float:
    pixels = 0.0
    for level in range(256):
        pixels += counts[level]
    power = _total_power(counts) / pixels
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
    counts = _difference_counts(np.ascontiguousarray(later), np.ascontiguousarray(earlier))
    return float(_power_of(counts))


class NoiseMeter:
    """Noise of a series of images: the smallest measured.

    Where grains cover much of a picture, fast motion cannot be told from noise: of the grains of
    tray 7 at 15 mm/s all motion was taken for noise. Grains that are slow or at rest show it.
    """

    def __init__(self) -> None:
        # A frame stored twice has no noise: the minimum would be wrong.
        self._recent = Quantile(_NOISE_QUANTILE, _MEMORY_FRAMES)
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


class MotionMeter:
    """Noise of the gray images of one tray, and whether their motion just jumped.

    A shaking event sets every bead in motion between one frame and the next, whereas
    collisions change the mean squared difference of two images by some ten per cent.

    Parameters
    ----------
    ratio : float
        Smallest jump of the motion, as a factor.

    Attributes
    ----------
    noise_power : float, [gray levels^2]
        Mean squared difference per pixel of two images of a scene at rest; 0 before the second.
    """

    def __init__(self, ratio: float) -> None:
        self._ratio = ratio
        self._recent: deque[float] = deque(maxlen=_MEMORY_FRAMES)
        self._noise = Quantile(_NOISE_QUANTILE, _NOISE_FRAMES)
        self._last: NDArray[np.uint8] | None = None
        self._last_ns = 0
        self._steps: deque[int] = deque(maxlen=_MEMORY_FRAMES)
        self.noise_power = 0.0

    def push(self, stamp_ns: int, gray: NDArray[np.uint8]) -> bool:
        """Take the next image; True when the motion jumped since the one before."""
        gray = np.ascontiguousarray(gray)
        last, self._last = self._last, gray
        step, self._last_ns = stamp_ns - self._last_ns, stamp_ns
        if last is None:
            return False
        usual = median(self._steps) if self._steps else step
        self._steps.append(step)
        # Beads move further while frames are missing, which is no jump. A jump during the gap is
        # seen with the next image.
        if step > _GAP * usual:
            return False
        counts = _difference_counts(gray, last)
        # Motion adds to the noise, and a frame stored twice has none: neither the mean nor the
        # minimum is right.
        self.noise_power = self._noise.push(_power_of(counts))
        quiet = self.noise_power * gray.size
        motion = _total_power(counts) - quiet
        # Of 15 frames, not of all: an earlier shaking event may have been stronger.
        before = max(self._recent, default=None)
        self._recent.append(motion)
        return before is not None and motion > self._ratio * max(before, 0.0) + quiet


class PlateMeter:
    """Whether the plate with the trays just began to move.

    Parameters
    ----------
    ratio : float
        Smallest jump of the speed, as a factor.
    least_speed : float, [m/s]
    """

    def __init__(self, ratio: float, least_speed: float) -> None:
        self._ratio = ratio
        self._least = least_speed
        self._recent: deque[tuple[int, float]] = deque()

    def push(self, stamp_ns: int, speed: float, error: float) -> bool:
        """Take the speed of the plate since the frame before, [m/s]; NaN when unknown."""
        if not (math.isfinite(speed) and math.isfinite(error)):
            return False
        while self._recent and stamp_ns - self._recent[0][0] > _SWING_NS:
            self._recent.popleft()
        before = max((speed for _, speed in self._recent), default=None)
        self._recent.append((stamp_ns, speed))
        least = max(self._least, _SIGNIFICANT * error)
        return before is not None and speed > max(least, self._ratio * before)


class ShakeCounter:
    """Counts the shaking events, by the jumps of the trays and of the plate in each frame.

    All trays are on one plate and are shaken together: an event is a jump of the plate, or of at
    least half of the trays.

    Parameters
    ----------
    shortest_cycle : float, [s]

    Attributes
    ----------
    cycle : int
        Events so far.
    cycle_start_ns : int or None
        Stamp of the frame before the last one.
    """

    def __init__(self, shortest_cycle: float) -> None:
        self._shortest_ns = round(shortest_cycle * NS)
        self._last_ns: int | None = None
        self.cycle = 0
        self.cycle_start_ns: int | None = None

    def push(self, stamp_ns: int, jumps: Iterable[bool], plate: bool = False) -> bool:
        """Take the jumps of the next frame; True when the trays were shaken before it."""
        last, self._last_ns = self._last_ns, stamp_ns
        if last is None:
            return False
        votes = list(jumps)
        rested = self.cycle_start_ns is None or last - self.cycle_start_ns >= self._shortest_ns
        shaken = plate or (any(votes) and 2 * sum(votes) >= len(votes))
        if not (rested and shaken):
            return False
        self.cycle += 1
        self.cycle_start_ns = last
        return True


class CycleFollower:
    """Cycle and noise of the images of one tray: carried by the images, or found from them.

    Parameters
    ----------
    ratio : float
        Smallest jump of the motion, as a factor.
    shortest_cycle : float, [s]

    Attributes
    ----------
    cycle, cycle_start_ns, noise_power
        Of the last image, see :class:`nanorocks_ros.records.TrayImage`.
    """

    def __init__(self, ratio: float, shortest_cycle: float) -> None:
        self._meter = MotionMeter(ratio)
        self._counter = ShakeCounter(shortest_cycle)
        self._first = True
        self.cycle = 0
        self.cycle_start_ns: int | None = None
        self.noise_power = 0.0

    def push(self, image: TrayImage) -> bool:
        """Take the next image; True when the tray was shaken since the one before."""
        before, first = self.cycle, self._first
        self._first = False
        if image.cycle is None or math.isnan(image.noise_power):
            jump = self._meter.push(image.stamp_ns, image.gray)
            self._counter.push(image.stamp_ns, (jump,))
            self.noise_power = self._meter.noise_power
            self.cycle, self.cycle_start_ns = self._counter.cycle, self._counter.cycle_start_ns
        if image.cycle is not None:
            self.cycle, self.cycle_start_ns = image.cycle, image.cycle_start_ns
            if not math.isnan(image.noise_power):
                self.noise_power = image.noise_power
        # A recording that starts in the middle of a cycle was not shaken at its first image.
        return self.cycle != before and not first

    def counted(self, image: TrayImage) -> TrayImage:
        """The last image with its cycle and noise filled in."""
        if image.cycle is not None and not math.isnan(image.noise_power):
            return image
        return replace(
            image,
            cycle=self.cycle,
            cycle_start_ns=self.cycle_start_ns,
            noise_power=self.noise_power,
        )
