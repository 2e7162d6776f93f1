"""Contrast of the beads of a tray: glare, brightness gradient and shadows are removed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Brighter pixels, and those beside them, are glare. Without this, the autocorrelation of trays 2
# and 4 is that of the glare on the window.
_BRIGHT = 235


# Quantiles of the levels of the floor and of the darkest beads, and the share of the difference
# that is taken for shadow: with a larger share small beads vanish, too.
_FLOOR, _DARK, _SHADOW = 0.75, 0.03, 0.25
# Bins of the levels, [gray levels].
_BIN, _BINS = 0.5, 1024


def tray_contrast(gray: NDArray[np.uint8], *, halve: bool) -> NDArray[np.float32]:
    """Levels of the pixels that are darker than shadows on the floor; 0 for all others.

    The light falls off across a tray: a plane is subtracted. Beads and walls cast shadows, which
    would make the beads seem half as large again: the floor, shadows and glare become 0.

    Parameters
    ----------
    gray : ndarray of uint8, (rows, columns)
    halve : bool
        Whether to average two by two pixels; an odd last row or column is left out.

    Returns
    -------
    ndarray of float32, (rows, columns), <= 0, [gray levels]
        Of half the size when halved.
    """
    levels, seen = _levelled(gray, halve=halve)
    floor, dark = _floor_and_beads(levels, seen)
    # A bin lower, so that an even floor becomes 0.
    _clip(levels, seen, np.float32(floor - _SHADOW * (floor - dark) - _BIN))
    return levels


def tray_levels(gray: NDArray[np.uint8], *, halve: bool) -> NDArray[np.float32]:
    """Deviations of an image from its best plane, with the shadows.

    Parameters
    ----------
    gray, halve
        As for `tray_contrast`.

    Returns
    -------
    ndarray of float32, (rows, columns), [gray levels]
        0 in glare.
    """
    levels, seen = _levelled(gray, halve=halve)
    levels[~seen] = 0.0
    return levels


def _levelled(
    gray: NDArray[np.uint8], *, halve: bool
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Deviations from the plane, and the pixels without glare."""
    step = 2 if halve and min(gray.shape) > 1 else 1
    shape = gray.shape[0] // step, gray.shape[1] // step
    levels = np.empty(shape, dtype=np.float32)
    hidden = np.zeros(shape, dtype=np.bool_)
    _reduce(gray, step, levels, hidden)
    seen = ~_grown(hidden) if hidden.any() else ~hidden
    sums = _plane_sums(levels, seen)
    matrix = sums[[0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(3, 3)
    # The solution of least norm: in a single row or column, or where all is glare, there are many.
    plane = np.linalg.lstsq(matrix, sums[6:], rcond=None)[0]
    _subtract(levels, seen, plane.astype(np.float32))
    return levels, seen


@compiled
def _reduce(
    gray: NDArray[np.uint8],
    step: int,
    levels: NDArray[np.float32],
    hidden: NDArray[np.bool_],
) -> None:
    """Means of blocks of pixels, and whether one of them is bright."""
    weight = np.float32(1.0 / (step * step))
    for i in range(levels.shape[0]):
        for j in range(levels.shape[1]):
            total, most = 0, 0
            for a in range(step):
                for b in range(step):
                    level = int(gray[step * i + a, step * j + b])
                    total += level
                    most = max(most, level)
            levels[i, j] = np.float32(total) * weight
            hidden[i, j] = most > _BRIGHT


@compiled
def _grown(hidden: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The mask with all neighbours of its pixels."""
    rows, columns = hidden.shape
    grown = np.zeros_like(hidden)
    for i in range(rows):
        for j in range(columns):
            if hidden[i, j]:
                grown[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2] = True
    return grown


@compiled
def _plane_sums(levels: NDArray[np.float32], seen: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Sums of 1, x, y, xx, xy, yy and of z, zx, zy, with x and y from the middle, (9,)."""
    rows, columns = levels.shape
    sums = np.zeros(9)
    for i in range(rows):
        y = i - 0.5 * (rows - 1)
        for j in range(columns):
            if seen[i, j]:
                x = j - 0.5 * (columns - 1)
                z = float(levels[i, j])
                sums[0] += 1.0
                sums[1] += x
                sums[2] += y
                sums[3] += x * x
                sums[4] += x * y
                sums[5] += y * y
                sums[6] += z
                sums[7] += z * x
                sums[8] += z * y
    return sums


@compiled
def _subtract(
    levels: NDArray[np.float32], seen: NDArray[np.bool_], plane: NDArray[np.float32]
) -> None:
    rows, columns = levels.shape
    for i in range(rows):
        y = np.float32(i) - np.float32(0.5) * np.float32(rows - 1)
        for j in range(columns):
            x = np.float32(j) - np.float32(0.5) * np.float32(columns - 1)
            level = plane[0] + plane[1] * x + plane[2] * y
            levels[i, j] -= level


@compiled
def _floor_and_beads(levels: NDArray[np.float32], seen: NDArray[np.bool_]) -> tuple[float, float]:
    """Levels of the floor and of the darkest beads."""
    counts = np.zeros(_BINS, dtype=np.int64)
    total = 0
    for i in range(levels.shape[0]):
        for j in range(levels.shape[1]):
            if seen[i, j]:
                place = int(levels[i, j] / _BIN + 0.5 * _BINS)
                counts[min(max(place, 0), _BINS - 1)] += 1
                total += 1
    floor, dark, below = 0.0, 0.0, 0
    for k in range(_BINS):
        middle = (k + 0.5 - 0.5 * _BINS) * _BIN
        if below <= _DARK * total:
            dark = middle
        if below <= _FLOOR * total:
            floor = middle
        below += counts[k]
    return floor, dark


@compiled
def _clip(levels: NDArray[np.float32], seen: NDArray[np.bool_], level: np.float32) -> None:
    """Set pixels brighter than a level, and glare, to 0."""
    for i in range(levels.shape[0]):
        for j in range(levels.shape[1]):
            darker = seen[i, j] and levels[i, j] < level
            levels[i, j] = levels[i, j] - level if darker else np.float32(0.0)
