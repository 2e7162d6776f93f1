"""Coverage of the floor by beads of one colour, whatever their shading.

The pixels of a bead lie on a line in colour space: light and shade change the brightness, not the
ratio of the channels. The deviation from that line, over that of the floor, is the share of a
pixel in which the floor is visible. A dark limb, a lit side and a shadow on the bead therefore do
not move its outline, while half of the darkness lies outside the outline where the limb is darker
than the rest of the bead: 0.1 px, in films of shaded spheres.

Tested by ``test/stages/tracking/detection/test_floor_coverage.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined
from nanorocks_ros.stages.tracking.detection.pixel_classes import RED

if TYPE_CHECKING:
    from numpy.typing import NDArray

FULL_COVERAGE, NO_COVERAGE = 230, 25
"""Levels of the map for a pixel of the bead and of the floor; noise exceeds both."""

# The slope is updated in one frame of so many, with this weight: a time constant of about 1 s.
_UPDATE_FRAMES, _UPDATE_WEIGHT = 8, 0.3
# Side of the square by which patches of a species are eroded, which removes blurred edges, [px].
_EROSION_PX = 5
# Quantile of the ratios of dark to bright: highlights and floor only add to the dark channels, in
# up to half of the pixels of a glossy bead.
_RATIO_QUANTILE = 0.25
# Bins of the histogram of ratios from 0 to 1.
_BINS = 256
# Brightness below which noise dominates a ratio, and above which a pixel may be saturated,
# [gray levels].
_DARKEST, _BRIGHTEST = 40, 250
# Smallest deviation of the floor from the line, [gray levels]; less is no contrast.
_MIN_CONTRAST = 30.0
# Smallest number of pixels from which a line is estimated.
_MIN_PIXELS = 50.0
_RED_CHANNEL = 2


class FloorCoverage:
    """The map of the coverage for one species, and the line of its colour.

    Parameters
    ----------
    kind : int
        RED or BLUE.
    color : tuple of 3 floats, bgr
        Colour of the material, for the first image.
    """

    def __init__(self, kind: int, color: tuple[float, float, float]) -> None:
        self._bright, self._dark = (_RED_CHANNEL, 0) if kind == RED else (0, _RED_CHANNEL)
        self._kind = kind
        slope = 0.5 * (color[self._dark] + color[1]) / max(color[self._bright], 1.0)
        self._slope = min(slope, 1.0)
        self._histogram = np.zeros(_BINS)
        self._frame = 0
        self._map = np.empty((0, 0), dtype=np.uint8)

    def update(self, color: NDArray[np.uint8], pixel_class: NDArray[np.uint8]) -> None:
        """Learn the line from the pixels of the species, in some frames.

        Parameters
        ----------
        color : ndarray of uint8, (rows, columns, 3), bgr
        pixel_class : ndarray of uint8, (rows, columns)
        """
        is_due = self._frame % _UPDATE_FRAMES == 0
        self._frame += 1
        if not is_due:
            return
        patches = np.asarray(pixel_class == self._kind, dtype=np.uint8)
        core = cv2.erode(patches, np.ones((_EROSION_PX, _EROSION_PX), dtype=np.uint8))
        counts = ratio_histogram(color, np.asarray(core), self._bright, self._dark)
        total = counts.sum()
        if total < _MIN_PIXELS:
            return
        weight = _UPDATE_WEIGHT if self._histogram.any() else 1.0
        self._histogram += weight * (counts / total - self._histogram)
        self._slope = _quantile(self._histogram, _RATIO_QUANTILE)

    def map(
        self,
        color: NDArray[np.uint8],
        background: NDArray[np.uint8],
        darkness: NDArray[np.uint8],
    ) -> NDArray[np.uint8]:
        """Coverage of the floor, (rows, columns), valid until the next call.

        Parameters
        ----------
        color, background : ndarray of uint8, (rows, columns, 3), bgr
        darkness : ndarray of uint8, (rows, columns)
            Taken where the floor has the colour of the bead.
        """
        if self._map.shape != darkness.shape:
            self._map = np.empty(darkness.shape, dtype=np.uint8)
        write_coverage(color, background, darkness, self._bright, self._slope, self._map)
        return self._map


def _quantile(histogram: NDArray[np.float64], share: float) -> float:
    """Ratio below which a share of a histogram over 0 to 1 lies, interpolated within its bin."""
    sums = np.concatenate([[0.0], np.cumsum(histogram)])
    return float(np.interp(share * sums[-1], sums, np.linspace(0.0, 1.0, sums.size)))


@compiled
def ratio_histogram(
    color: NDArray[np.uint8], core: NDArray[np.uint8], bright: int, dark: int
) -> NDArray[np.float64]:
    """Numbers of pixels by the ratio of the dark channels to the bright one, (256,).

    Parameters
    ----------
    color : ndarray of uint8, (rows, columns, 3), bgr
    core : ndarray of uint8, (rows, columns)
        Nonzero in the pixels that are used.
    bright, dark : int
        Channels in which the species is bright and dark; green counts as dark, too.
    """
    counts = np.zeros(_BINS)
    for i in range(core.shape[0]):
        for j in range(core.shape[1]):
            x = np.float64(color[i, j, bright])
            if not core[i, j] or x < _DARKEST or x >= _BRIGHTEST:
                continue
            y = 0.5 * (np.float64(color[i, j, dark]) + np.float64(color[i, j, 1]))
            counts[min(int(_BINS * y / x), _BINS - 1)] += 1.0
    return counts


@compiled
def write_coverage(
    color: NDArray[np.uint8],
    background: NDArray[np.uint8],
    darkness: NDArray[np.uint8],
    bright: int,
    shade: float,
    coverage: NDArray[np.uint8],
) -> None:
    """Write the coverage of the floor, see `FloorCoverage.map`; `bright` is a channel, 0 or 2."""
    pixels, empty = color.reshape(-1), background.reshape(-1)
    dark_map, result = darkness.reshape(-1), coverage.reshape(-1)
    slope = np.float32(shade)
    # With channels that are constants the loops are vectorised.
    if bright == _RED_CHANNEL:
        for pixel in range(result.size):
            k = np.uint64(pixel)
            level, floor = _off(pixels, k, 2, 0, slope), _off(empty, k, 2, 0, slope)
            result[k] = _level(level, floor, dark_map[k])
    else:
        for pixel in range(result.size):
            k = np.uint64(pixel)
            level, floor = _off(pixels, k, 0, 2, slope), _off(empty, k, 0, 2, slope)
            result[k] = _level(level, floor, dark_map[k])


@inlined
def _off(
    pixels: NDArray[np.uint8], k: np.uint64, bright: int, dark: int, slope: np.float32
) -> np.float32:
    """Deviation of a pixel of a flat picture from the line of the colour, [gray levels]."""
    place = np.uint64(3) * k
    total = np.int32(pixels[place + np.uint64(dark)]) + np.int32(pixels[place + np.uint64(1)])
    level = np.float32(0.5) * np.float32(total)
    return np.float32(level - slope * np.float32(pixels[place + np.uint64(bright)]))


@inlined
def _level(level: np.float32, floor: np.float32, darkness: np.uint8) -> np.uint8:
    """Coverage by the deviations of a pixel and of the floor; darkness where these are small."""
    least = np.float32(_MIN_CONTRAST)
    top, span = np.float32(FULL_COVERAGE + 0.5), np.float32(FULL_COVERAGE - NO_COVERAGE)
    share = top - span * level / max(floor, least)
    value = np.uint8(min(max(share, np.float32(0.0)), np.float32(255.0)))
    return value if floor > least else darkness
