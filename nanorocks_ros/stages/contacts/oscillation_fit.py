"""How fast a tray moves at an instant, from its places around it: the terms that are fitted."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.numerics.compiled import compiled

# Frequencies of a swing that are tried, [1/s].
_FREQUENCIES = np.geomspace(0.5, 6.0, 40)
# Share of a term that the others before it must leave, or they are all but the same.
_LEAST_PIVOT = 1e-4


class Slope(NamedTuple):
    """Slope at time 0 of what was fitted.

    Parameters
    ----------
    velocity : ndarray (2,), [m/s]
    left : float, [m^2]
        Sum of the squares that are left.
    factor : float, [1/s]
        Error of the slope over that of a place.
    """

    velocity: NDArray[np.float64]
    left: float
    factor: float


def slope_of(terms: NDArray[np.float64], places: NDArray[np.float64]) -> Slope:
    """Fit terms, (pictures, n), of which the second alone has a slope at 0, of 1."""
    inverse = np.linalg.pinv(terms)
    found = inverse @ places
    left = float(np.sum((places - terms @ found) ** 2))
    return Slope(found[1], left, float(np.linalg.norm(inverse[1])))


def powers(times: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
    """Terms 1, t, ... up to a degree, (pictures, degree + 1)."""
    return np.vander(times, degree + 1, increasing=True)


def swing_terms(times: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Terms of a swing that dies away about a resting place, of the frequency that fits best.

    The first slope is that of its sine, divided by the angular frequency.
    """
    omega = 2.0 * math.pi * _FREQUENCIES[:, None]
    sine, cosine = np.sin(omega * times), np.cos(omega * times)
    slope = sine / omega
    # Terms in t sin have no slope at 0; that in t cos has one, and is taken off the sine's.
    parts = np.stack([np.ones_like(sine), slope, cosine, times * cosine - slope, times * sine])
    best = _best_fit(parts, places)
    if best < 0:
        terms = parts.transpose(1, 2, 0)
        turned = terms.transpose(0, 2, 1)
        projected = turned @ places
        explained = projected * (np.linalg.pinv(turned @ terms, hermitian=True) @ projected)
        best = int(np.argmax(explained.sum(axis=(1, 2))))
    return np.ascontiguousarray(parts[:, best].T)


@compiled
def _best_fit(parts: NDArray[np.float64], places: NDArray[np.float64]) -> int:
    """Which of some sets of terms, (terms, sets, pictures), explains most of the places.

    -1 where that is not sure, since the terms of a set are all but the same.
    """
    count, sets, pictures = parts.shape
    normal, factor = np.empty((count, count)), np.empty((count, count))
    projected = np.empty((count, 2))
    most, best = -np.inf, -1
    for k in range(sets):
        for i in range(count):
            for j in range(i + 1):
                total = 0.0
                for n in range(pictures):
                    total += parts[i, k, n] * parts[j, k, n]
                normal[i, j] = total
            for c in range(2):
                total = 0.0
                for n in range(pictures):
                    total += parts[i, k, n] * places[n, c]
                projected[i, c] = total
        explained = _explained(normal, projected, factor)
        if not explained >= 0.0:
            return -1
        if explained > most:
            most, best = explained, k
    return best


@compiled
def _explained(
    normal: NDArray[np.float64], projected: NDArray[np.float64], factor: NDArray[np.float64]
) -> float:
    """Sum of squares that a fit explains, by Cholesky; NaN where that loses too many digits."""
    explained = 0.0
    for i in range(normal.shape[0]):
        for j in range(i + 1):
            value = normal[i, j]
            for m in range(j):
                value -= factor[i, m] * factor[j, m]
            if j < i:
                factor[i, j] = value / factor[j, j]
            elif value > _LEAST_PIVOT * normal[i, i]:
                factor[i, i] = math.sqrt(value)
            else:
                return math.nan
        for c in range(projected.shape[1]):
            value = projected[i, c]
            for m in range(i):
                value -= factor[i, m] * projected[m, c]
            projected[i, c] = value / factor[i, i]
            explained += projected[i, c] * projected[i, c]
    return explained
