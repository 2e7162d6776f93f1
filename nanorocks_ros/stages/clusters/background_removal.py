"""What stands out from the floor of a tray: no glare, gradient or shadow, half the pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Brighter pixels, and those beside them, show the lamp and not the tray. Without this, the
# autocorrelation of trays 2 and 4 is that of the glare on the window, whatever the beads do.
_BRIGHT = 235


# Ranks of the pixels that stand for the floor and for the darkest beads, and how much of the way
# from one to the other is taken for shadow: with more of it small beads fade, too.
_FLOOR, _DARK, _SHADOW = 0.75, 0.03, 0.25
# Bins of the levels, [gray levels].
_BIN, _BINS = 0.5, 1024


def tray_contrast(gray: NDArray[np.uint8], *, halve: bool) -> NDArray[np.float32]:
    """By how much the pixels of an image are darker than shadows on the floor, and no more.

    The light falls off across a tray: a plane is taken off. Beads and walls cast shadows, which
    would make the beads seem half as large again: the floor and what is hardly darker than it
    are made even. Glare is made so, too.

    Parameters
    ----------
    gray : ndarray of uint8, (rows, columns)
    halve : bool
        Whether to take means of two by two pixels; an odd last one is left out.

    Returns
    -------
    ndarray of float32, (rows, columns), <= 0, [gray levels]
        Of half the size when halved.
    """
    found, seen = _levelled(gray, halve=halve)
    floor, dark = _levels(found, seen)
    # A bin lower, so that of an even floor nothing is left.
    _clip(found, seen, np.float32(floor - _SHADOW * (floor - dark) - _BIN))
    return found


def tray_levels(gray: NDArray[np.uint8], *, halve: bool) -> NDArray[np.float32]:
    """The same with the shadows: deviations of an image from the plane that fits it best.

    Parameters
    ----------
    gray, halve
        As for `tray_contrast`.

    Returns
    -------
    ndarray of float32, (rows, columns), [gray levels]
        0 in glare.
    """
    found, seen = _levelled(gray, halve=halve)
    found[~seen] = 0.0
    return found


def _levelled(
    gray: NDArray[np.uint8], *, halve: bool
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Deviations from the plane, and where there is no glare."""
    step = 2 if halve and min(gray.shape) > 1 else 1
    shape = gray.shape[0] // step, gray.shape[1] // step
    found = np.empty(shape, dtype=np.float32)
    hidden = np.zeros(shape, dtype=np.bool_)
    _reduce(gray, step, found, hidden)
    seen = ~_grown(hidden) if hidden.any() else ~hidden
    sums = _plane_sums(found, seen)
    matrix = sums[[0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(3, 3)
    # Least squares of least size: in a single row or column, or where all is glare, there are
    # many planes.
    plane = np.linalg.lstsq(matrix, sums[6:], rcond=None)[0]
    _subtract(found, seen, plane.astype(np.float32))
    return found, seen


@compiled
def _reduce(
    gray: NDArray[np.uint8],
    step: int,
    found: NDArray[np.float32],
    hidden: NDArray[np.bool_],
) -> None:
    """Means of blocks of pixels, and whether one of them is bright."""
    weight = np.float32(1.0 / (step * step))
    for i in range(found.shape[0]):
        for j in range(found.shape[1]):
            total, most = 0, 0
            for a in range(step):
                for b in range(step):
                    level = int(gray[step * i + a, step * j + b])
                    total += level
                    most = max(most, level)
            found[i, j] = np.float32(total) * weight
            hidden[i, j] = most > _BRIGHT


@compiled
def _grown(hidden: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The same with all neighbours."""
    rows, columns = hidden.shape
    grown = np.zeros_like(hidden)
    for i in range(rows):
        for j in range(columns):
            if hidden[i, j]:
                grown[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2] = True
    return grown


@compiled
def _plane_sums(found: NDArray[np.float32], seen: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Sums of 1, x, y, xx, xy, yy and of z, zx, zy, with x and y from the middle, (9,)."""
    rows, columns = found.shape
    sums = np.zeros(9)
    for i in range(rows):
        y = i - 0.5 * (rows - 1)
        for j in range(columns):
            if seen[i, j]:
                x = j - 0.5 * (columns - 1)
                z = float(found[i, j])
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
    found: NDArray[np.float32], seen: NDArray[np.bool_], plane: NDArray[np.float32]
) -> None:
    rows, columns = found.shape
    for i in range(rows):
        y = np.float32(i) - np.float32(0.5) * np.float32(rows - 1)
        for j in range(columns):
            x = np.float32(j) - np.float32(0.5) * np.float32(columns - 1)
            level = plane[0] + plane[1] * x + plane[2] * y
            found[i, j] -= level


@compiled
def _levels(found: NDArray[np.float32], seen: NDArray[np.bool_]) -> tuple[float, float]:
    """Levels of the floor and of the darkest beads."""
    counts = np.zeros(_BINS, dtype=np.int64)
    total = 0
    for i in range(found.shape[0]):
        for j in range(found.shape[1]):
            if seen[i, j]:
                place = int(found[i, j] / _BIN + 0.5 * _BINS)
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
def _clip(found: NDArray[np.float32], seen: NDArray[np.bool_], level: np.float32) -> None:
    """What is brighter than a level, and glare, to 0."""
    for i in range(found.shape[0]):
        for j in range(found.shape[1]):
            darker = seen[i, j] and found[i, j] < level
            found[i, j] = found[i, j] - level if darker else np.float32(0.0)
