"""Beginnings of lasting motion: of the beads in the images of one tray, and of the plate.

A shaking event sets all beads in motion between one frame and the next, and they move for seconds.
A key frame of a codec changes all still texture a little, a lamp that is switched changes all
levels, a knocked camera blurs a picture: each for a frame or two. So a jump is a candidate, which
the frames after it confirm or refute.
"""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.numerics.quantiles import Quantile, median
from nanorocks_ros.records import NS
from nanorocks_ros.stages.preprocess.shaking.difference_noise import (
    MEMORY_FRAMES,
    NOISE_QUANTILE,
    clipped_power,
    difference_counts,
    total_power,
)
from nanorocks_ros.stages.preprocess.shaking.onset_confirmation import (
    Candidate,
    Candidates,
    FrameClock,
    Onsets,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

_NOISE_FRAMES = 300
# At most so many of the frames that confirm an onset may lack the motion, as a share.
_LACKING = 1.0 / 3.0
# Frames before a jump that tell the usual motion.
_FEW_BEFORE = 3
# A gas does not stop from one frame to the next: with a motion below this share of the usual, the
# picture is frozen. A gas that is at rest for longer has cooled.
_STOPPED = 0.1
_LONGEST_STOP_NS = 5 * NS
# Squared difference of the first and the last image of a motion, as a share of the variance of the
# image, in the blocks of 8 pixels where each is largest: a bead that moves by u pixels reaches
# u^2 / 5.3, hence 1.2 pixels in 0.3 s are motion. What a codec refines reaches some per cent.
_BLOCK_PX, _LARGEST_BLOCKS = 8, 4
_MOVED_SHARE = 0.25
# Contrast below which nothing is seen, as a multiple of the noise.
_SEEN = 4.0
# An oscillating plate stands still twice in every period, which is no rest.
_SWING_NS = 5 * NS
# Smallest significant speed of the tray, in standard errors.
_SIGNIFICANT = 5.0
# Share of the frames in which an oscillating plate must be fast: it turns twice a period. A knock
# of the camera lasts for a frame or two.
_SWING_LACKING = 2.0 / 3.0


class MotionMeter:
    """Noise of the gray images of one tray, and where lasting motion of its beads begins.

    The motion is the mean squared difference of successive images without what noise and changes
    of brightness and contrast explain, in units of the contrast. Collisions change it by some ten
    per cent, a shaking event by a factor, for many frames.

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
        self._recent: deque[tuple[float, float]] = deque(maxlen=MEMORY_FRAMES)
        self._noise = Quantile(NOISE_QUANTILE, _NOISE_FRAMES)
        self._last: tuple[NDArray[np.uint8], float, float] | None = None
        self._clock = FrameClock()
        self._stopped_ns: int | None = None
        self._seen = True
        self._candidates = Candidates(_LACKING)
        self.noise_power = 0.0

    def push(self, stamp_ns: int, gray: NDArray[np.uint8]) -> Onsets:
        """Take the next image.

        Parameters
        ----------
        stamp_ns : int
        gray : ndarray of uint8, (rows, columns)
        """
        gray = np.ascontiguousarray(gray)
        mean, spread = (float(level[0, 0]) for level in cv2.meanStdDev(gray))
        last, self._last = self._last, (gray, mean, spread)
        # Beads move further while frames are missing, which is no jump. A jump during the gap is
        # seen with the next image.
        if not self._clock.push(stamp_ns) or last is None:
            return self._candidates.onsets()
        counts = difference_counts(gray, last[0])
        # Motion adds to the noise, and a frame stored twice has none: neither the mean nor the
        # minimum is right.
        self.noise_power = self._noise.push(clipped_power(counts))
        seen, self._seen = self._seen, _is_seen(gray, spread, self.noise_power)
        if not (seen and self._seen):
            # In the dark, motion is unknown.
            self._recent.clear()
            self._candidates.undecided.clear()
            return Onsets()
        power = total_power(counts) / gray.size - (mean - last[1]) ** 2 - (spread - last[2]) ** 2
        contrast = max(spread * last[2], self.noise_power)
        motion = max(power - self.noise_power, 0.0) / contrast
        noise = self.noise_power / contrast
        confirmed = tuple(
            candidate.before_ns
            for candidate in self._candidates.push(stamp_ns, motion)
            if candidate.gray is not None and _moved(candidate.gray, gray, self.noise_power)
        )
        usual = 0.0
        if len(self._recent) >= _FEW_BEFORE:
            # In a picture with less contrast, the motion before was known less well.
            usual, unknown = (median(values) for values in zip(*self._recent, strict=True))
            bar = self._ratio * usual + max(unknown, noise)
            if motion > bar:
                frames = self._clock.confirming_frames()
                self._candidates.add(Candidate(self._clock.previous_ns, bar, frames, gray))
        if not self._is_frozen(stamp_ns, motion, usual, identical=counts[0] == gray.size):
            self._recent.append((motion, noise))
        return self._candidates.onsets(confirmed)

    def _is_frozen(self, stamp_ns: int, motion: float, usual: float, *, identical: bool) -> bool:
        """Whether the picture stands still, while the beads need not; `usual` is the motion."""
        full = len(self._recent) == MEMORY_FRAMES
        if not full or not (identical or motion < _STOPPED * usual):
            self._stopped_ns = None
            return False
        if self._stopped_ns is None:
            self._stopped_ns = stamp_ns
        return identical or stamp_ns - self._stopped_ns < _LONGEST_STOP_NS


def _moved(first: NDArray[np.uint8], last: NDArray[np.uint8], noise_power: float) -> bool:
    """Whether something moved from one image to another, be they as bright as they may."""
    levels = first.astype(np.float32)
    later = last.astype(np.float32)
    gain = float(levels.std()) / max(float(later.std()), 1e-6)
    difference = (later - later.mean()) * gain - (levels - levels.mean())
    change = _largest(_blocks(difference * difference)) - noise_power
    return change > _MOVED_SHARE * _block_variance(levels, noise_power)


def _is_seen(gray: NDArray[np.uint8], spread: float, noise_power: float) -> bool:
    """Whether an image shows more than noise; `spread` is its standard deviation."""
    if spread * spread > (_SEEN + 0.5) * noise_power:
        return True
    return _block_variance(gray.astype(np.float32), noise_power) > _SEEN * noise_power


def _block_variance(levels: NDArray[np.float32], noise_power: float) -> float:
    """Largest variance in the blocks of an image, without noise, [gray levels^2]."""
    return _largest(_blocks(levels * levels) - _blocks(levels) ** 2) - 0.5 * noise_power


def _blocks(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Means of the blocks of an image."""
    rows, columns = (max(1, side // _BLOCK_PX) for side in values.shape)
    means = cv2.resize(values, (columns, rows), interpolation=cv2.INTER_AREA)
    return means.astype(np.float32, copy=False)


def _largest(values: NDArray[np.float32]) -> float:
    """The last of the few largest values: a single one may be a reflection."""
    place = max(0, values.size - _LARGEST_BLOCKS)
    return float(np.partition(values.reshape(-1), place)[place])


class PlateMeter:
    """Where the plate with the trays begins to move.

    Parameters
    ----------
    ratio : float
        Smallest jump of the speed, as a factor.
    least_speed : float, [m/s]
    """

    def __init__(self, ratio: float, least_speed: float) -> None:
        self._ratio = ratio
        self._least = least_speed
        # Stamps of the last speeds, and those speeds that no later one reaches, which fall.
        self._stamps: deque[int] = deque()
        self._largest: deque[tuple[int, float]] = deque()
        self._clock = FrameClock()
        self._candidates = Candidates(_SWING_LACKING)

    def push(self, stamp_ns: int, speed: float, error: float) -> Onsets:
        """Take the speed of the plate since the frame before, [m/s]; NaN when unknown."""
        self._clock.push(stamp_ns)
        if not (math.isfinite(speed) and math.isfinite(error)):
            return self._candidates.onsets()
        while self._stamps and stamp_ns - self._stamps[0] > _SWING_NS:
            self._stamps.popleft()
        while self._largest and stamp_ns - self._largest[0][0] > _SWING_NS:
            self._largest.popleft()
        lasting = self._candidates.push(stamp_ns, speed)
        if len(self._stamps) >= _FEW_BEFORE:
            before = self._largest[0][1]
            bar = max(self._least, _SIGNIFICANT * error, self._ratio * before)
            if speed > bar:
                frames = self._clock.confirming_frames()
                self._candidates.add(Candidate(self._clock.previous_ns, bar, frames))
        self._stamps.append(stamp_ns)
        while self._largest and self._largest[-1][1] <= speed:
            self._largest.pop()
        self._largest.append((stamp_ns, speed))
        return self._candidates.onsets(tuple(candidate.before_ns for candidate in lasting))
