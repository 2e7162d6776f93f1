"""Registration of a set of points in a picture, in compiled functions.

Gauss-Newton on the squared differences (Lucas and Kanade 1981; Baker and Matthews 2004,
IJCV 56, 221, "inverse compositional"), with the light's gain and offset as two more unknowns and
outliers bounded (Huber).

Tested by ``test/stages/preprocess/test_stabilise.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

_ITERATIONS = 12
_CONVERGED_PX = 0.005
# Before the light is fitted its change would count as noise of every point.
_CONVERGED_LEVELS = 0.3
# A difference of more than so many standard deviations counts as this many.
_BOUND = 2.0
# Median of the absolute value of a normal variate.
_MEDIAN = 0.6745
_ROUNDING = 0.3
# A point whose squared change of level is so many times the usual has half the weight: something
# passes in front of it, or the light changes there.
_SUSPECT = 3.0
# Pictures over which a change of level is averaged: what passes in front must count soon.
_SUSPECT_PICTURES = 64
UNKNOWNS = 4


@compiled
def sample(
    image: NDArray[np.uint8],
    mix: NDArray[np.float64],
    places: NDArray[np.float64],
    shift: tuple[float, float],
    values: NDArray[np.float64],
) -> None:
    """Gray mix of the picture at shifted points, bilinear; beyond its edge that of the edge.

    Parameters
    ----------
    image : ndarray of uint8, (height, width, channels)
    mix : ndarray, (channels,)
    places : ndarray, (n, 6)
        Of :func:`nanorocks_ros.stages.preprocess.rectify.places_of`.
    shift : tuple of 2 floats, [px]
    values : ndarray, (n,)
        Written.
    """
    height, width, channels = image.shape
    dx, dy = shift
    for k in range(places.shape[0]):
        x = places[k, 0] + places[k, 2] * dx + places[k, 4] * dy - 0.5
        y = places[k, 1] + places[k, 3] * dx + places[k, 5] * dy - 0.5
        x = min(max(x, 0.0), width - 1.001)
        y = min(max(y, 0.0), height - 1.001)
        a, b = int(x), int(y)
        right, below = x - a, y - b
        value = 0.0
        for channel in range(channels):
            above = image[b, a, channel] * (1.0 - right) + image[b, a + 1, channel] * right
            under = image[b + 1, a, channel] * (1.0 - right) + image[b + 1, a + 1, channel] * right
            value += mix[channel] * (above * (1.0 - below) + under * below)
        values[k] = value


@compiled
def substitute(factor: NDArray[np.float64], right: NDArray[np.float64]) -> None:
    """Solve with a known Cholesky factor, in place."""
    n = factor.shape[0]
    for m in range(right.shape[1]):
        for i in range(n):
            value = right[i, m]
            for k in range(i):
                value -= factor[i, k] * right[k, m]
            right[i, m] = value / factor[i, i]
        for i in range(n - 1, -1, -1):
            value = right[i, m]
            for k in range(i + 1, n):
                value -= factor[k, i] * right[k, m]
            right[i, m] = value / factor[i, i]


@compiled
def solve(matrix: NDArray[np.float64], right: NDArray[np.float64]) -> bool:
    """Solve symmetric positive equations in place (Cholesky); False when they have no answer.

    Parameters
    ----------
    matrix : ndarray, (n, n)
        Overwritten.
    right : ndarray, (n, m)
        Right sides; holds the solutions afterwards.
    """
    n = matrix.shape[0]
    for j in range(n):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] * matrix[j, k]
        if not pivot > 1e-12 * (1.0 + abs(matrix[j, j])):
            return False
        root = math.sqrt(pivot)
        matrix[j, j] = root
        for i in range(j + 1, n):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = value / root
    substitute(matrix, right)
    return True


@compiled
def _spread(differences: NDArray[np.float64]) -> float:
    """Standard deviation of the differences, from the median of their absolute values."""
    return max(float(np.median(np.abs(differences))) / _MEDIAN, _ROUNDING)


@compiled
def register(
    image: NDArray[np.uint8],
    mix: NDArray[np.float64],
    places: NDArray[np.float64],
    reference: NDArray[np.float64],
    slopes: NDArray[np.float64],
    trust: NDArray[np.float64],
    start: tuple[float, float],
    result: NDArray[np.float64],
    values: NDArray[np.float64],
) -> bool:
    """Displacement at which the picture shows the reference best.

    Parameters
    ----------
    image, mix, places
        As for :func:`sample`.
    reference : ndarray, (n,), [gray levels]
    slopes : ndarray, (n, 2), [gray levels/px]
        Gradient of the reference.
    trust : ndarray, (n,), 0 to 1
        Weight of each point.
    start : tuple of 2 floats, [px]
    result : ndarray, (5,)
        Written: displacement (2) [px], its standard error, and the standard deviations of the
        remaining differences and of what the reference explains [gray levels].
    values : ndarray, (n,)
        Written: the samples at that displacement, corrected for the light.

    Returns
    -------
    bool
        False when the equations have no solution.
    """
    n = reference.size
    dx, dy, gain, offset = start[0], start[1], 1.0, 0.0
    raw, differences = np.empty(n), np.empty(n)
    middle = reference.mean()
    contrast = math.sqrt(((reference - middle) ** 2).mean())
    row, step = np.empty(UNKNOWNS), np.empty((UNKNOWNS, 1))
    normal = np.empty((UNKNOWNS, UNKNOWNS))
    spread, change = 0.0, 0.0
    for _ in range(_ITERATIONS):
        sample(image, mix, places, (dx, dy), raw)
        for k in range(n):
            differences[k] = raw[k] - offset - middle - gain * (reference[k] - middle)
        spread = _spread(differences)
        normal[:] = 0.0
        step[:] = 0.0
        for k in range(n):
            far = abs(differences[k]) / (_BOUND * spread)
            weight = trust[k] if far <= 1.0 else trust[k] / far
            row[0], row[1] = slopes[k, 0], slopes[k, 1]
            row[2], row[3] = reference[k] - middle, 1.0
            for i in range(UNKNOWNS):
                step[i, 0] += weight * row[i] * differences[k]
                for j in range(i + 1):
                    normal[i, j] += weight * row[i] * row[j]
        if not solve(normal, step):
            return False
        dx -= step[0, 0]
        dy -= step[1, 0]
        gain += step[2, 0]
        offset += step[3, 0]
        change = math.sqrt(step[0, 0] * step[0, 0] + step[1, 0] * step[1, 0])
        light = abs(step[3, 0]) + abs(step[2, 0]) * contrast
        if change < _CONVERGED_PX and light < _CONVERGED_LEVELS:
            break
    sample(image, mix, places, (dx, dy), raw)
    for k in range(n):
        values[k] = (raw[k] - offset - middle) / max(gain, 0.1) + middle
    result[0], result[1] = dx, dy
    # The factor of Cholesky is left in `normal`: errors of the first two unknowns.
    sides = np.zeros((UNKNOWNS, 2))
    sides[0, 0] = sides[1, 1] = 1.0
    substitute(normal, sides)
    result[2] = spread * math.sqrt(0.5 * (sides[0, 0] + sides[1, 1])) + 0.5 * change
    result[3] = spread
    # At a wrong displacement the light seems to have lost its contrast: the gain is small.
    result[4] = max(gain, 0.0) * contrast
    return True


@compiled
def update_reference(
    values: NDArray[np.float64],
    seen: int,
    reference: NDArray[np.float64],
    powers: NDArray[np.float64],
    trust: NDArray[np.float64],
) -> None:
    """Update the reference with the samples of another picture.

    Parameters
    ----------
    values : ndarray, (n,), [gray levels]
        At the displacement of this picture.
    seen : int
        Number of pictures averaged, with this one.
    reference, powers : ndarray, (n,), [gray levels], [gray levels^2]
        Means of the values, and of the squares of their differences from it; changed.
    trust : ndarray, (n,), 0 to 1
        Written.
    """
    recent = min(seen, _SUSPECT_PICTURES)
    for k in range(values.size):
        difference = values[k] - reference[k]
        reference[k] += difference / seen
        powers[k] += (difference * difference - powers[k]) / recent
    usual = np.median(powers)
    for k in range(values.size):
        ratio = powers[k] / (_SUSPECT * usual)
        trust[k] = 1.0 / (1.0 + ratio * ratio)


@compiled
def search_shift(
    image: NDArray[np.uint8],
    mix: NDArray[np.float64],
    places: NDArray[np.float64],
    reference: NDArray[np.float64],
    centre: tuple[float, float],
    reach: int,
) -> tuple[float, float]:
    """Whole displacement, within a reach about a centre, of the best normalised correlation."""
    raw = np.empty(reference.size)
    best, best_x, best_y = -2.0, centre[0], centre[1]
    middle = reference.mean()
    for i in range(-reach, reach + 1):
        for j in range(-reach, reach + 1):
            at = (centre[0] + j, centre[1] + i)
            sample(image, mix, places, at, raw)
            mean = raw.mean()
            product, own, other = 0.0, 0.0, 0.0
            for k in range(raw.size):
                a, b = raw[k] - mean, reference[k] - middle
                product += a * b
                own += a * a
                other += b * b
            score = product / math.sqrt(max(own * other, 1e-12))
            if score > best:
                best, best_x, best_y = score, at[0], at[1]
    return best_x, best_y
