"""Fits to single free flights: their bend, and the clock of a gas that slows beads down.

With Stokes drag x(t) = x0 + v s(t), s = (1 - exp(-drag t)) / drag: in the clock s, that of the
gas without drag, every flight is straight. In the usual clock it is bent, and the bend of a flight
is its mean acceleration.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.exponentials import decayed

if TYPE_CHECKING:
    from numpy.typing import NDArray

BEND_SIZE = 9
"""Length of the array that `write_bend` fills."""

MIN_BEND_POINTS = 10
"""Smallest number of positions of a flight whose bend is fitted."""


@compiled
def undragged_times(times: NDArray[np.float64], origin: float, drag: float) -> NDArray[np.float64]:
    """Times in the clock of the gas without drag.

    Parameters
    ----------
    times : ndarray (n,), [s]
    origin : float, [s]
        Where both clocks show the same time and run alike: slopes in the new clock are velocities
        at that time.
    drag : float, >= 0, [1/s]

    Returns
    -------
    ndarray (n,), [s]
        The times themselves without drag.
    """
    if drag == 0.0:
        return times
    undragged = np.empty(times.size)
    for k in range(times.size):
        gone, left = decayed(drag * abs(times[k] - origin))
        undragged[k] = origin + (gone if times[k] >= origin else -gone / left) / drag
    return undragged


@compiled
def write_bend(
    times: NDArray[np.float64],
    positions: NDArray[np.float64],
    errors: NDArray[np.float64],
    row: NDArray[np.float64],
) -> bool:
    """Fit a parabola to the positions of a flight.

    Parameters
    ----------
    times : ndarray (n,), [s]
    positions : ndarray (n, 2), [m]
    errors : ndarray (n,), [m]
        Of one coordinate.
    row : ndarray (BEND_SIZE,)
        Written: middle time, duration, number of positions, velocity (2) at the middle,
        mean acceleration (2) and its standard error, and chi square of the residuals with
        ``2 n - 6`` degrees of freedom.

    Returns
    -------
    bool
        Whether there were enough positions.
    """
    n = times.size
    if n < MIN_BEND_POINTS:
        row[2] = 0.0
        return False
    total, middle = 0.0, 0.0
    for k in range(n):
        weight = 1.0 / (errors[k] * errors[k])
        total += weight
        middle += weight * (times[k] - times[0])
    middle = times[0] + middle / total
    second, third = 0.0, 0.0
    for k in range(n):
        t = times[k] - middle
        weight = 1.0 / (errors[k] * errors[k])
        second += weight * t * t
        third += weight * t * t * t
    # Polynomials 1, t and t^2 - slope t - offset are orthogonal for these weights.
    slope, offset = third / second, second / total
    spread = 0.0
    for k in range(n):
        t = times[k] - middle
        p = t * t - slope * t - offset
        spread += p * p / (errors[k] * errors[k])
    chi_square = 0.0
    for c in range(2):
        mean, linear, square = 0.0, 0.0, 0.0
        for k in range(n):
            t = times[k] - middle
            x = (positions[k, c] - positions[0, c]) / (errors[k] * errors[k])
            mean += x
            linear += x * t
            square += x * (t * t - slope * t - offset)
        mean, linear, square = mean / total, linear / second, square / spread
        for k in range(n):
            t = times[k] - middle
            rest = positions[k, c] - positions[0, c] - mean - linear * t
            rest -= square * (t * t - slope * t - offset)
            chi_square += rest * rest / (errors[k] * errors[k])
        row[3 + c] = linear - square * slope
        row[5 + c] = 2.0 * square
    row[0], row[1], row[2] = middle, times[n - 1] - times[0], n
    row[7], row[8] = 2.0 / math.sqrt(spread), chi_square
    return True
