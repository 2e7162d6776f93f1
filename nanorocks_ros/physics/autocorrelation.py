"""Autocorrelation of an image about its mean, and the region above a level."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Sums over a region: area, second moments about zero lag, number of nodes on the border.
_AREA, _XX, _XY, _YY, _BORDER = range(5)
# Corners of a cell of the grid, in order around it.
_CORNERS = np.array([[0, 0], [0, 1], [1, 1], [1, 0]])


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelRegion:
    """The region around zero lag in which an autocorrelation exceeds a level.

    Parameters
    ----------
    area : float, [px^2]
        0 if no value exceeds the level, as in a uniform image.
    axes_ratio : float, >= 1
        Axis ratio of the ellipse with the same second moments; NaN without area.
    direction : float, [rad], -pi/2 to pi/2
        From the columns to the longer axis, positive towards the rows (down); NaN without area.
    whole : bool
        Whether it does not touch the border; if it does, its true area is larger.
    """

    area: float
    axes_ratio: float
    direction: float
    whole: bool


def autocorrelation(image: NDArray[np.uint8] | NDArray[np.float32]) -> NDArray[np.float32]:
    """Normalised linear autocorrelation of an image about its mean.

    Parameters
    ----------
    image : ndarray of uint8 or float32, (rows, columns)

    Returns
    -------
    ndarray of float32, (rows, columns)
        1 at zero lag, which lies at (rows // 2, columns // 2); all 0 for a uniform image.
    """
    rows, columns = image.shape
    deviation = image.astype(np.float32)
    deviation -= np.float32(deviation.mean(dtype=np.float64))
    # Padded, so that up to lags of half the size the image does not overlap its periodic copy.
    # Rows of zeros and rows that are not needed are not transformed.
    down, right = (fft.next_fast_len(size + size // 2 + 1, real=True) for size in (rows, columns))
    spectrum = fft.fft(fft.rfft(deviation, n=right, axis=1), n=down, axis=0)
    power = spectrum.real**2 + spectrum.imag**2
    # The power is real, and half of the lags are enough, since C(-lag) = C(lag): back along the
    # columns with the transform of real values, conjugated, at half the price.
    along = fft.rfft(power, axis=0)[: rows // 2 + 1].conj()
    covariance = fft.irfft(along, n=right, axis=1)
    variance = covariance[0, 0]
    if variance <= 0.0:
        return np.zeros((rows, columns), dtype=np.float32)
    lags = np.arange(columns) - columns // 2
    values = np.empty((rows, columns), dtype=np.float32)
    values[rows // 2 :] = covariance[: rows - rows // 2, lags]
    values[: rows // 2] = covariance[rows // 2 : 0 : -1, -lags]
    values /= variance
    return values


def level_region(values: NDArray[np.float32], level: float) -> LevelRegion:
    """The region around zero lag in which an autocorrelation exceeds a level.

    Its outline is interpolated linearly between neighbouring values, so that the area is not
    quantised in pixels. Other regions above the level do not count.

    Parameters
    ----------
    values : ndarray of float32, (rows, columns)
        1 at zero lag, which lies at (rows // 2, columns // 2).
    level : float, 0 to 1
    """
    sums = _sums(values, np.float32(level))
    area = float(sums[_AREA])
    if area <= 0.0:
        return LevelRegion(area=0.0, axes_ratio=math.nan, direction=math.nan, whole=True)
    middle = 0.5 * (sums[_XX] + sums[_YY])
    spread = math.hypot(0.5 * (sums[_XX] - sums[_YY]), sums[_XY])
    return LevelRegion(
        area=area,
        axes_ratio=math.sqrt((middle + spread) / (middle - spread)),
        direction=0.5 * math.atan2(2.0 * sums[_XY], sums[_XX] - sums[_YY]),
        whole=bool(sums[_BORDER] == 0.0),
    )


@compiled
def _sums(values: NDArray[np.float32], level: np.float32) -> NDArray[np.float64]:
    """Area, second moments and nodes on the border of the region around zero lag, (5,)."""
    rows, columns = values.shape
    sums = np.zeros(5)
    inside = np.zeros((rows, columns), dtype=np.bool_)
    if values[rows // 2, columns // 2] <= level:
        return sums
    low, high = _fill(values, level, inside)
    xs, ys = np.empty(8), np.empty(8)
    for i in range(max(low[0] - 1, 0), min(high[0] + 1, rows - 1)):
        for j in range(max(low[1] - 1, 0), min(high[1] + 1, columns - 1)):
            n = _outline(values, level, inside, i, j, xs, ys)
            if n > 2:
                _add_polygon(xs[:n], ys[:n], sums)
    sums[_BORDER] = inside[0].sum() + inside[rows - 1].sum()
    sums[_BORDER] += inside[:, 0].sum() + inside[:, columns - 1].sum()
    return sums


@compiled
def _fill(
    values: NDArray[np.float32], level: np.float32, inside: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Mark the nodes above the level connected to zero lag; first and last (row, column)."""
    rows, columns = values.shape
    stack = np.empty((rows * columns, 2), dtype=np.int64)
    stack[0, 0], stack[0, 1] = rows // 2, columns // 2
    inside[rows // 2, columns // 2] = True
    low, high = stack[0].copy(), stack[0].copy()
    filled = 1
    while filled:
        filled -= 1
        i, j = stack[filled]
        low[0], low[1] = min(low[0], i), min(low[1], j)
        high[0], high[1] = max(high[0], i), max(high[1], j)
        for k in range(4):
            a, b = i + (k == 0) - (k == 1), j + (k == 2) - (k == 3)
            outside = a < 0 or b < 0 or a >= rows or b >= columns
            if outside or inside[a, b] or values[a, b] <= level:
                continue
            inside[a, b] = True
            stack[filled, 0], stack[filled, 1] = a, b
            filled += 1
    return low, high


@compiled
def _outline(
    values: NDArray[np.float32],
    level: np.float32,
    inside: NDArray[np.bool_],
    i: int,
    j: int,
    xs: NDArray[np.float64],
    ys: NDArray[np.float64],
) -> int:
    """Corners of the part of a cell inside the region, relative to zero lag; their number."""
    rows, columns = inside.shape
    n = 0
    for k in range(4):
        a, b = i + _CORNERS[k, 0], j + _CORNERS[k, 1]
        c, d = i + _CORNERS[(k + 1) % 4, 0], j + _CORNERS[(k + 1) % 4, 1]
        if inside[a, b]:
            xs[n], ys[n] = b - columns // 2, a - rows // 2
            n += 1
        if inside[a, b] != inside[c, d]:
            part = (level - values[a, b]) / (values[c, d] - values[a, b])
            xs[n], ys[n] = b + part * (d - b) - columns // 2, a + part * (c - a) - rows // 2
            n += 1
    return n


@compiled
def _add_polygon(
    xs: NDArray[np.float64], ys: NDArray[np.float64], sums: NDArray[np.float64]
) -> None:
    """Add the area and second moments of a polygon, by Green's theorem."""
    n = xs.size
    for k in range(n):
        x, y, u, v = xs[k], ys[k], xs[(k + 1) % n], ys[(k + 1) % n]
        cross = x * v - u * y
        sums[_AREA] += cross / 2.0
        sums[_XX] += cross * (x * x + x * u + u * u) / 12.0
        sums[_YY] += cross * (y * y + y * v + v * v) / 12.0
        sums[_XY] += cross * (x * v + 2.0 * x * y + 2.0 * u * v + u * y) / 24.0
