"""Free flight of a bead: line fit through its last positions, with detection of deflections."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, kernel
from nanorocks_ros.numerics.median import median_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

MAX_POINTS = 48
"""Largest number of positions kept for a track."""

# Chi square of a deflected position: three standard deviations for two degrees of freedom.
_MAX_DEFLECTION = 11.8
# Largest chi square of a line per degree of freedom; above, there was a gradual deflection.
_MAX_CHI_SQUARE = 3.0


@kernel
def fit_line(
    times: NDArray[np.float64],
    positions: NDArray[np.float64],
    errors: NDArray[np.float64],
    line: NDArray[np.float64],
) -> None:
    """Fit a line to positions, weighted by their errors.

    Parameters
    ----------
    times : ndarray (n,), n >= 2, [s]
    positions : ndarray (n, 2)
    errors : ndarray (n,)
        Of a coordinate.
    line : ndarray (9 or more,)
        Written: time and position of the centre of the line, velocity, variances of position and
        velocity, chi square of the residuals, number of positions.
    """
    total, time, x, y = 0.0, 0.0, 0.0, 0.0
    for k in range(times.size):
        weight = 1.0 / (errors[k] * errors[k])
        total += weight
        time += weight * times[k]
        x += weight * positions[k, 0]
        y += weight * positions[k, 1]
    time, x, y = time / total, x / total, y / total
    spread, u, v = 0.0, 0.0, 0.0
    for k in range(times.size):
        weight = (times[k] - time) / (errors[k] * errors[k])
        spread += weight * (times[k] - time)
        u += weight * (positions[k, 0] - x)
        v += weight * (positions[k, 1] - y)
    u, v = u / spread, v / spread
    chi_square = 0.0
    for k in range(times.size):
        dx = positions[k, 0] - x - u * (times[k] - time)
        dy = positions[k, 1] - y - v * (times[k] - time)
        chi_square += (dx * dx + dy * dy) / (errors[k] * errors[k])
    line[0], line[1], line[2], line[3], line[4] = time, x, y, u, v
    line[5], line[6], line[7], line[8] = 1.0 / total, 1.0 / spread, chi_square, times.size


@kernel
def fit_flight(
    times: NDArray[np.float64],
    positions: NDArray[np.float64],
    errors: NDArray[np.float64],
    count: int,
    line: NDArray[np.float64],
) -> None:
    """Fit a line to the last positions of a bead.

    Parameters
    ----------
    times : ndarray (MAX_POINTS,), [s]
    positions : ndarray (MAX_POINTS, 2)
    errors : ndarray (MAX_POINTS,)
        Of a coordinate.
    count : int, >= 2
        Number of positions to use, from the front of the arrays.
    line : ndarray (9,)
        Written, see `fit_line`.
    """
    fit_line(times[:count], positions[:count], errors[:count], line)
    # Residuals above the stated errors inflate the variances.
    inflation = max(line[7] / (2 * count - 4), 1.0) if count > 3 else 1.0
    line[5] *= inflation
    line[6] *= inflation


@kernel
def extend_flight(
    times: NDArray[np.float64],
    positions: NDArray[np.float64],
    errors: NDArray[np.float64],
    count: int,
    line: NDArray[np.float64],
    time: float,
    x: float,
    y: float,
    error: float,
    window: float,
) -> int:
    """Add a position to a flight; a deflected one begins a new flight.

    Parameters
    ----------
    times, positions, errors, count, line
        See `fit_flight`; newest first, changed. With one position after a collision, the line
        starts there with the velocity from the position before, and a variance that covers the
        unknown time of the collision.
    time, x, y, error : float
        The new position.
    window : float, [s]
        Longest flight that is fitted.

    Returns
    -------
    int
        Number of positions of the flight.
    """
    deflected = False
    if count >= 2:
        dt = time - line[0]
        variance = line[5] + line[6] * dt * dt + error * error
        dx = x - line[1] - line[3] * dt
        dy = y - line[2] - line[4] * dt
        deflected = dx * dx + dy * dy > _MAX_DEFLECTION * variance
    for k in range(min(count, MAX_POINTS - 1), 0, -1):
        times[k], errors[k] = times[k - 1], errors[k - 1]
        positions[k, 0], positions[k, 1] = positions[k - 1, 0], positions[k - 1, 1]
    times[0], positions[0, 0], positions[0, 1], errors[0] = time, x, y, error
    if count == 0:
        line[8] = 1.0
        return 1
    if deflected:
        interval = time - times[1]
        line[0], line[1], line[2] = time, x, y
        line[3] = (x - positions[1, 0]) / interval
        line[4] = (y - positions[1, 1]) / interval
        # The collision was at an unknown time between the two positions.
        line[5] = error * error
        line[6] = (0.5 * (dx * dx + dy * dy) + error * error + errors[1] * errors[1]) / (
            interval * interval
        )
        line[7], line[8] = 0.0, 1.0
        return 1
    count = min(count + 1, MAX_POINTS)
    while count > 2 and times[0] - times[count - 1] > window:
        count -= 1
    fit_flight(times, positions, errors, count, line)
    while count >= 4 and line[7] > _MAX_CHI_SQUARE * (2 * count - 4):
        count = max(count // 2, 2)
        fit_flight(times, positions, errors, count, line)
    return count


@compiled
def median_square_speed(lines: NDArray[np.float64], has_velocity: NDArray[np.bool_]) -> float:
    """Median squared velocity of the selected lines, (n, 9), at least one."""
    squares = np.empty(lines.shape[0])
    n = 0
    for i in range(lines.shape[0]):
        if has_velocity[i]:
            squares[n] = lines[i, 3] * lines[i, 3] + lines[i, 4] * lines[i, 4]
            n += 1
    return median_of(squares[:n])
