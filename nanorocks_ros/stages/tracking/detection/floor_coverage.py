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

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.tracking.detection.pixel_classes import RED

if TYPE_CHECKING:
    from numpy.typing import NDArray

FULL_COVERAGE, NO_COVERAGE = 230, 25
"""Levels of the map for a pixel of the bead and of the floor; noise exceeds both."""

# The line is updated in one frame of so many, with this weight: a time constant of about 1 s.
_UPDATE_FRAMES, _UPDATE_WEIGHT = 8, 0.3
# Side of the square by which patches of a species are eroded, which removes blurred edges, [px].
_EROSION_PX = 5
# Standard deviation of brightness at which the slope is half that through black, [gray levels].
_PRIOR_SPREAD = 8.0
# Deviation from the line, in gray levels, above which a pixel is a highlight or another bead.
_MAX_DEVIATION = 25.0
# Smallest deviation of the floor from the line, [gray levels]; less is no contrast.
_MIN_CONTRAST = 30.0
# Smallest number of pixels from which a line is estimated.
_MIN_PIXELS = 50.0


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
        self._bright, self._dark = (2, 0) if kind == RED else (0, 2)
        self._kind = kind
        slope = 0.5 * (color[self._dark] + color[1]) / max(color[self._bright], 1.0)
        self._line = (min(slope, 1.0), 0.0)
        self._sums = np.zeros(5)
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
        for _ in range(1 if self._sums[0] else 3):
            limit = _MAX_DEVIATION if self._sums[0] else 2.0 * _MAX_DEVIATION
            sums = colour_sums(
                color, np.asarray(core), self._bright, self._dark, self._line, limit
            )
            if sums[0] < _MIN_PIXELS:
                return
            weight = _UPDATE_WEIGHT if self._sums[0] else 1.0
            total = self._sums + weight * (sums / sums[0] - self._sums)
            self._line = _line_of(total)
        self._sums = total

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
        write_coverage(
            color, background, darkness, self._bright, self._dark, self._line, self._map
        )
        return self._map


def _line_of(means: NDArray[np.float64]) -> tuple[float, float]:
    """Slope and offset of the dark channels over the bright one; see `colour_sums`."""
    _, x, y, xx, xy = means
    prior = _PRIOR_SPREAD * _PRIOR_SPREAD
    ratio = y / max(x, 1.0)
    slope = (xy - x * y + prior * ratio) / (max(xx - x * x, 0.0) + prior)
    slope = min(max(slope, 0.0), 1.0)
    return float(slope), float(y - slope * x)


@compiled
def colour_sums(
    color: NDArray[np.uint8],
    core: NDArray[np.uint8],
    bright: int,
    dark: int,
    line: tuple[float, float],
    limit: float,
) -> NDArray[np.float64]:
    """Sums over the pixels near a line: number, bright, dark, bright squared, their product.

    Parameters
    ----------
    color : ndarray of uint8, (rows, columns, 3), bgr
    core : ndarray of uint8, (rows, columns)
        Nonzero in the pixels that are used.
    bright, dark : int
        Channels in which the species is bright and dark; green counts as dark, too.
    line : tuple of 2 floats
        Slope, and offset [gray levels].
    limit : float, [gray levels]
        Largest deviation of the mean of the dark channels from the line.
    """
    sums = np.zeros(5)
    slope, offset = line
    for i in range(core.shape[0]):
        for j in range(core.shape[1]):
            if not core[i, j]:
                continue
            x = np.float64(color[i, j, bright])
            y = 0.5 * (np.float64(color[i, j, dark]) + np.float64(color[i, j, 1]))
            if abs(y - slope * x - offset) > limit or x >= 250.0:
                continue
            sums[0] += 1.0
            sums[1] += x
            sums[2] += y
            sums[3] += x * x
            sums[4] += x * y
    return sums


@compiled
def write_coverage(
    color: NDArray[np.uint8],
    background: NDArray[np.uint8],
    darkness: NDArray[np.uint8],
    bright: int,
    dark: int,
    line: tuple[float, float],
    coverage: NDArray[np.uint8],
) -> None:
    """Write the coverage of the floor, see `FloorCoverage.map`."""
    pixels, empty = color.reshape(-1), background.reshape(-1)
    dark_map, result = darkness.reshape(-1), coverage.reshape(-1)
    three, green = np.uint64(3), np.uint64(1)
    bright_channel, dark_channel = np.uint64(bright), np.uint64(dark)
    slope, offset = np.float32(line[0]), np.float32(line[1])
    half, span = np.float32(0.5), np.float32(FULL_COVERAGE - NO_COVERAGE)
    lowest, highest = np.float32(0.0), np.float32(255.0)
    top, min_contrast = np.float32(FULL_COVERAGE + 0.5), np.float32(_MIN_CONTRAST)
    for pixel in range(result.size):
        k = np.uint64(pixel)
        level = half * (
            np.float32(pixels[three * k + dark_channel]) + np.float32(pixels[three * k + green])
        )
        level -= slope * np.float32(pixels[three * k + bright_channel]) + offset
        floor = half * (
            np.float32(empty[three * k + dark_channel]) + np.float32(empty[three * k + green])
        )
        floor -= slope * np.float32(empty[three * k + bright_channel]) + offset
        share = top - span * level / max(floor, min_contrast)
        value = np.uint8(min(max(share, lowest), highest))
        result[k] = value if floor > min_contrast else dark_map[k]
