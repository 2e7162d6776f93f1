"""What stands out from the floor of a tray: no glare, no gradient of light, half the pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Brighter pixels, and those beside them, show the lamp and not the tray. Without this, the
# autocorrelation of trays 2 and 4 is that of the glare on the window, whatever the beads do.
_BRIGHT = 235


def tray_contrast(gray: NDArray[np.uint8], *, halve: bool) -> NDArray[np.float32]:
    """Deviations of an image from the plane that fits it best.

    The light falls off across a tray; a plane takes out most of that, and with it a third of the
    scatter of the autocorrelation's width.

    Parameters
    ----------
    gray : ndarray of uint8, (rows, columns)
    halve : bool
        Whether to take means of two by two pixels; an odd last one is left out.

    Returns
    -------
    ndarray of float32, (rows, columns), [gray levels]
        Of half the size when halved; 0 in glare.
    """
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
    return found


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
            found[i, j] = found[i, j] - level if seen[i, j] else np.float32(0.0)
