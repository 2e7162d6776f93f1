"""Rough position of the plate in a picture, from the slopes along the sides of its trays.

Tested by ``test/studies/calibration/test_plate_fit.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.experiment.plate import PLATE
from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# Reduction of the picture for the search.
_REDUCED = 4
_SCALE_STEP = 1.01
# Quantile at which slopes are cut off: glare must not outweigh a tray.
_STEEPEST = 0.98


@dataclass(frozen=True, slots=True)
class PlateGuess:
    """A straight, upright plate that fits roughly.

    Parameters
    ----------
    pixels_per_metre : float
    corner : tuple of 2 floats, [px]
        Upper left corner of the plate.
    contrast : float
        Mean slope along the sides of the trays, in units of that of the whole picture.
    """

    pixels_per_metre: float
    corner: tuple[float, float]
    contrast: float


@compiled
def _best_plate(
    across: NDArray[np.float64],
    down: NDArray[np.float64],
    boxes: NDArray[np.float64],
    scales: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Scale and place at which the sides of the boxes collect the steepest slopes.

    Parameters
    ----------
    across : ndarray, (rows + 1, columns)
        Slopes along rows, summed from above.
    down : ndarray, (rows, columns + 1)
        Slopes along columns, summed from the left.
    boxes : ndarray, (n, 4)
        x, y, width, height of the floors at scale 1.
    scales : ndarray, (m,)
    result : ndarray, (m, 4)
        Written: mean slope, x, y and length of the sides, for each scale.
    """
    rows, columns = down.shape[0], across.shape[1]
    ends = np.empty((boxes.shape[0], 4), dtype=np.int64)
    for m in range(scales.size):
        low_x, low_y, high_x, high_y, length = 10**9, 10**9, -(10**9), -(10**9), 0
        for k in range(boxes.shape[0]):
            ends[k, 0] = int(boxes[k, 0] * scales[m] + 0.5)
            ends[k, 1] = int(boxes[k, 1] * scales[m] + 0.5)
            ends[k, 2] = int((boxes[k, 0] + boxes[k, 2]) * scales[m] + 0.5)
            ends[k, 3] = int((boxes[k, 1] + boxes[k, 3]) * scales[m] + 0.5)
            low_x, low_y = min(low_x, ends[k, 0]), min(low_y, ends[k, 1])
            high_x, high_y = max(high_x, ends[k, 2]), max(high_y, ends[k, 3])
            length += 2 * (ends[k, 2] - ends[k, 0] + ends[k, 3] - ends[k, 1])
        best = -1.0
        for y in range(-low_y, rows - high_y):
            for x in range(-low_x, columns - high_x):
                total = 0.0
                for k in range(ends.shape[0]):
                    a, b = x + ends[k, 0], y + ends[k, 1]
                    c, d = x + ends[k, 2], y + ends[k, 3]
                    total += across[d, a] - across[b, a] + across[d, c] - across[b, c]
                    total += down[b, c] - down[b, a] + down[d, c] - down[d, a]
                if total > best:
                    best = total
                    result[m, 1], result[m, 2] = x, y
        result[m, 0] = best / max(length, 1)
        result[m, 3] = length


def guess_plate(
    gray: NDArray[np.uint8], trays: Sequence[Tray], scale: tuple[float, float] | None = None
) -> PlateGuess | None:
    """Find the plate in a picture of the whole scene, to a few pixels.

    Parameters
    ----------
    gray : ndarray of uint8, (rows, columns)
    trays : sequence of Tray
        With a place on the plate.
    scale : tuple of 2 floats, [px/m], optional
        Lowest and highest to try; by default all at which the trays fill a third of the
        picture or more.

    Returns
    -------
    PlateGuess or None
        None when the trays do not fit into the picture at any scale.
    """
    boxes = np.array([[*(tray.place or (0.0, 0.0)), *tray.dimensions[:2]] for tray in trays])
    extent = (boxes[:, :2] + boxes[:, 2:]).max(axis=0) - boxes[:, :2].min(axis=0)
    largest = min(gray.shape[1] / extent[0], gray.shape[0] / extent[1]) * 0.995
    low, high = scale or (largest / 3.0, largest)
    high = min(high, largest)
    if high < low:
        return None
    size = (gray.shape[1] // _REDUCED, gray.shape[0] // _REDUCED)
    reduced = cv2.resize(gray, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    small = np.asarray(cv2.GaussianBlur(reduced, (0, 0), 1.2), dtype=np.float32)
    slopes = [np.abs(cv2.Sobel(small, cv2.CV_32F, 1 - k, k)) for k in (0, 1)]
    usual = []
    for k, slope in enumerate(slopes):
        np.minimum(slope, np.quantile(slope, _STEEPEST), out=slope)
        usual.append(float(slope.mean()))
        slopes[k] = np.pad(np.cumsum(slope, axis=k, dtype=np.float64), _FRONT[k])
    count = max(1, math.ceil(math.log(high / low) / math.log(_SCALE_STEP)) + 1)
    scales = np.geomspace(low, high, count)
    candidates = np.full((count, 4), -1.0)
    _best_plate(slopes[0], slopes[1], boxes, scales / _REDUCED, candidates)
    # The mean over longer sides has less scatter.
    excess = (candidates[:, 0] - np.mean(usual)) * np.sqrt(np.maximum(candidates[:, 3], 0.0))
    best = int(np.argmax(excess))
    return PlateGuess(
        pixels_per_metre=float(scales[best]),
        corner=(float(candidates[best, 1] * _REDUCED), float(candidates[best, 2] * _REDUCED)),
        contrast=float(candidates[best, 0] / max(np.mean(usual), 1e-9)),
    )


_FRONT = (((1, 0), (0, 0)), ((0, 0), (1, 0)))


def plate_places(trays: Sequence[Tray]) -> dict[int, NDArray[np.float64]]:
    """x, y, width, height of the floors from the middle of the plate, by tray, [m]."""
    return {
        tray.number: np.array(
            [
                (tray.place or (0.0, 0.0))[0] - 0.5 * PLATE[0],
                (tray.place or (0.0, 0.0))[1] - 0.5 * PLATE[1],
                *tray.dimensions[:2],
            ]
        )
        for tray in trays
    }
