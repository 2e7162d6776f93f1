"""Fits of polynomials and damped oscillations to tray positions, for the velocity at one time.

A codec leaves out small motion: where the tray swings by less than half a pixel its swing is seen
too small, or not at all, and no noise tells so. `SwingDecay` remembers how the swing ceased while
it was large.

Tested by ``test/stages/contacts/test_tray_history.py``.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.numerics.compiled import compiled

# Trial frequencies of the oscillation, [1/s].
_FREQUENCIES = np.geomspace(0.5, 6.0, 40)
# Smallest part of a term that is independent of the terms before it.
_MIN_PIVOT = 1e-4
# Speeds of a swing that tell its decay: over the largest, their least and largest number, and
# their least time [s].
_LARGE_SPEED, _FEWEST_SPEEDS, _MOST_SPEEDS, _LEAST_TIME = 0.25, 4, 60, 1.5
# A speed so many times the largest one, or the expected one, belongs to another swing.
_NEW_SWING = 1.5


class Slope(NamedTuple):
    """Slope at time 0 of a least-squares fit.

    Parameters
    ----------
    velocity : ndarray (2,), [m/s]
    residual : float, [m^2]
        Sum of the squared residuals.
    error_factor : float, [1/s]
        Error of the slope over the error of a position.
    fitted : ndarray (frames, 2), [m]
    """

    velocity: NDArray[np.float64]
    residual: float
    error_factor: float
    fitted: NDArray[np.float64]


def fit_slope(terms: NDArray[np.float64], positions: NDArray[np.float64]) -> Slope:
    """Fit terms, (frames, n); only the second has a slope at time 0, and it is 1."""
    inverse = np.linalg.pinv(terms)
    coefficients = inverse @ positions
    fitted = terms @ coefficients
    residual = float(np.sum((positions - fitted) ** 2))
    return Slope(coefficients[1], residual, float(np.linalg.norm(inverse[1])), fitted)


def swing_speed(times: NDArray[np.float64], fitted: NDArray[np.float64]) -> float:
    """Root mean square of a component of the velocity of fitted positions, (frames, 2), [m/s]."""
    velocities = np.diff(fitted, axis=0) / np.diff(times)[:, np.newaxis]
    return math.sqrt(float(np.mean(velocities**2)))


class SwingDecay:
    """How fast a tray swings that comes to rest, by the time in which it swung far."""

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=_MOST_SPEEDS)
        self._speeds: deque[float] = deque(maxlen=_MOST_SPEEDS)
        self._slope = self._start = math.nan

    def push(self, time: float, speed: float) -> None:
        """Take the root mean square of a component at another time, [s], [m/s]."""
        largest = max(self._speeds, default=0.0)
        if speed < _LARGE_SPEED * largest:
            return
        if speed > _NEW_SWING * (self.speed(time) or largest):
            self._times.clear()
            self._speeds.clear()
            self._slope = math.nan
        self._times.append(time)
        self._speeds.append(speed)
        times = np.array(self._times)
        if times.size >= _FEWEST_SPEEDS and np.ptp(times) >= _LEAST_TIME:
            self._slope, self._start = np.polyfit(times, np.log(self._speeds), 1).tolist()

    def speed(self, time: float) -> float:
        """Root mean square of a component, [m/s]; 0 where no swing is known that ceases."""
        if not self._slope < 0.0:
            return 0.0
        return math.exp(self._start + self._slope * time)


def polynomial_terms(times: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
    """Terms 1, t, ... up to a degree, (frames, degree + 1)."""
    return np.vander(times, degree + 1, increasing=True)


def oscillation_terms(
    times: NDArray[np.float64], positions: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Terms of a damped oscillation about a fixed position, at the frequency that fits best.

    The term with slope 1 at time 0 is the sine divided by the angular frequency.
    """
    omega = 2.0 * math.pi * _FREQUENCIES[:, None]
    sine, cosine = np.sin(omega * times), np.cos(omega * times)
    slope = sine / omega
    # The t sin term has no slope at 0; the t cos term has slope 1: the sine is subtracted from it.
    terms = np.stack([np.ones_like(sine), slope, cosine, times * cosine - slope, times * sine])
    best = _best_fit(terms, positions)
    if best < 0:
        term_sets = terms.transpose(1, 2, 0)
        transposed = term_sets.transpose(0, 2, 1)
        projected = transposed @ positions
        explained = projected * (
            np.linalg.pinv(transposed @ term_sets, hermitian=True) @ projected
        )
        best = int(np.argmax(explained.sum(axis=(1, 2))))
    return np.ascontiguousarray(terms[:, best].T)


@compiled
def _best_fit(terms: NDArray[np.float64], positions: NDArray[np.float64]) -> int:
    """Index of the set of terms, (terms, sets, frames), that explains most of the positions.

    -1 if the terms of a set are nearly dependent.
    """
    count, sets, frames = terms.shape
    normal, cholesky = np.empty((count, count)), np.empty((count, count))
    projected = np.empty((count, 2))
    largest, best = -np.inf, -1
    for k in range(sets):
        for i in range(count):
            for j in range(i + 1):
                total = 0.0
                for n in range(frames):
                    total += terms[i, k, n] * terms[j, k, n]
                normal[i, j] = total
            for c in range(2):
                total = 0.0
                for n in range(frames):
                    total += terms[i, k, n] * positions[n, c]
                projected[i, c] = total
        explained = _explained(normal, projected, cholesky)
        if not explained >= 0.0:
            return -1
        if explained > largest:
            largest, best = explained, k
    return best


@compiled
def _explained(
    normal: NDArray[np.float64], projected: NDArray[np.float64], cholesky: NDArray[np.float64]
) -> float:
    """Sum of squares that a fit explains, by Cholesky; NaN for an ill-conditioned matrix."""
    explained = 0.0
    for i in range(normal.shape[0]):
        for j in range(i + 1):
            value = normal[i, j]
            for m in range(j):
                value -= cholesky[i, m] * cholesky[j, m]
            if j < i:
                cholesky[i, j] = value / cholesky[j, j]
            elif value > _MIN_PIVOT * normal[i, i]:
                cholesky[i, i] = math.sqrt(value)
            else:
                return math.nan
        for c in range(projected.shape[1]):
            value = projected[i, c]
            for m in range(i):
                value -= cholesky[i, m] * projected[m, c]
            projected[i, c] = value / cholesky[i, i]
            explained += projected[i, c] * projected[i, c]
    return explained
