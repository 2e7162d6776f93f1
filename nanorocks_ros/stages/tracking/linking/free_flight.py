"""Free flight of a bead: a straight line through its last places, and where it leads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, kernel
from nanorocks_ros.numerics.median import median_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

KEPT = 48
"""Places kept of each track."""

# Two degrees of freedom: three standard deviations.
_KINK = 11.8
# Of the residuals of a line, per degree of freedom: a deflection that no single place showed.
_BENT = 3.0


@kernel
def fit_line(
    times: NDArray[np.float64],
    places: NDArray[np.float64],
    errors: NDArray[np.float64],
    line: NDArray[np.float64],
) -> None:
    """Fit a line to places, weighted by their errors.

    Parameters
    ----------
    times : ndarray (n,), n >= 2, [s]
    places : ndarray (n, 2)
    errors : ndarray (n,)
        Of a coordinate.
    line : ndarray (9 or more,)
        Written: time and place of the centre of the line, velocity, variances of place and
        velocity, chi square of the residuals, places used.
    """
    total, time, x, y = 0.0, 0.0, 0.0, 0.0
    for k in range(times.size):
        weight = 1.0 / (errors[k] * errors[k])
        total += weight
        time += weight * times[k]
        x += weight * places[k, 0]
        y += weight * places[k, 1]
    time, x, y = time / total, x / total, y / total
    spread, u, v = 0.0, 0.0, 0.0
    for k in range(times.size):
        weight = (times[k] - time) / (errors[k] * errors[k])
        spread += weight * (times[k] - time)
        u += weight * (places[k, 0] - x)
        v += weight * (places[k, 1] - y)
    u, v = u / spread, v / spread
    chi = 0.0
    for k in range(times.size):
        dx = places[k, 0] - x - u * (times[k] - time)
        dy = places[k, 1] - y - v * (times[k] - time)
        chi += (dx * dx + dy * dy) / (errors[k] * errors[k])
    line[0], line[1], line[2], line[3], line[4] = time, x, y, u, v
    line[5], line[6], line[7], line[8] = 1.0 / total, 1.0 / spread, chi, times.size


@kernel
def fit_flight(
    times: NDArray[np.float64],
    places: NDArray[np.float64],
    errors: NDArray[np.float64],
    count: int,
    line: NDArray[np.float64],
) -> None:
    """Fit a line to the last places of a bead.

    Parameters
    ----------
    times : ndarray (KEPT,), [s]
    places : ndarray (KEPT, 2)
    errors : ndarray (KEPT,)
        Of a coordinate.
    count : int, >= 2
        Places used, the first ones of the arrays.
    line : ndarray (9,)
        Written, see `fit_line`.
    """
    fit_line(times[:count], places[:count], errors[:count], line)
    # Places that scatter more than their errors say are worse than those.
    worse = max(line[7] / (2 * count - 4), 1.0) if count > 3 else 1.0
    line[5] *= worse
    line[6] *= worse


@kernel
def extend_flight(
    times: NDArray[np.float64],
    places: NDArray[np.float64],
    errors: NDArray[np.float64],
    count: int,
    line: NDArray[np.float64],
    time: float,
    x: float,
    y: float,
    error: float,
    window: float,
) -> int:
    """Add a place to a flight; one that does not lie on the line begins a new flight.

    Parameters
    ----------
    times, places, errors, count, line
        See `fit_flight`; newest first, changed. With one place after a collision, the line
        leads there from the place before, and its error is what the collision leaves open.
    time, x, y, error : float
        The new place.
    window : float, [s]
        Longest flight kept.

    Returns
    -------
    int
        Places of the flight.
    """
    deflected = False
    if count >= 2:
        after = time - line[0]
        variance = line[5] + line[6] * after * after + error * error
        dx = x - line[1] - line[3] * after
        dy = y - line[2] - line[4] * after
        deflected = dx * dx + dy * dy > _KINK * variance
    for k in range(min(count, KEPT - 1), 0, -1):
        times[k], errors[k] = times[k - 1], errors[k - 1]
        places[k, 0], places[k, 1] = places[k - 1, 0], places[k - 1, 1]
    times[0], places[0, 0], places[0, 1], errors[0] = time, x, y, error
    if count == 0:
        line[8] = 1.0
        return 1
    if deflected:
        passed = time - times[1]
        line[0], line[1], line[2] = time, x, y
        line[3] = (x - places[1, 0]) / passed
        line[4] = (y - places[1, 1]) / passed
        # The collision was somewhere between the two places.
        line[5] = error * error
        line[6] = (0.5 * (dx * dx + dy * dy) + error * error + errors[1] * errors[1]) / (
            passed * passed
        )
        line[7], line[8] = 0.0, 1.0
        return 1
    count = min(count + 1, KEPT)
    while count > 2 and times[0] - times[count - 1] > window:
        count -= 1
    fit_flight(times, places, errors, count, line)
    while count >= 4 and line[7] > _BENT * (2 * count - 4):
        count = max(count // 2, 2)
        fit_flight(times, places, errors, count, line)
    return count


@compiled
def median_square_speed(lines: NDArray[np.float64], known: NDArray[np.bool_]) -> float:
    """Median of the squared velocities of some of the lines, (n, 9), at least one."""
    squares = np.empty(lines.shape[0])
    n = 0
    for i in range(lines.shape[0]):
        if known[i]:
            squares[n] = lines[i, 3] * lines[i, 3] + lines[i, 4] * lines[i, 4]
            n += 1
    return median_of(squares[:n])
