"""Line fits to straight flights: break points between them and where two lines intersect."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.tracking.linking.free_flight import fit_line as _fit

_N_SUMS = 8
# Largest excess of chi square of a flight, in standard deviations: noise exceeds it once in 1000.
_MAX_CHI_SQUARE_SIGMAS = 4.0
LINE_SIZE = 10
"""Length of the array that holds a `Line`, in the order of its fields."""


class Line(NamedTuple):
    """A straight line through the positions of a flight.

    Parameters
    ----------
    time : float, [s]
        Centre of the line, where the errors of position and velocity are independent.
    position, velocity : ndarray (2,), [m], [m/s]
    position_variance, velocity_variance : float, [m^2], [m^2/s^2]
        Of one component.
    chi_square : float
        Of the residuals, with ``2 points - 4`` degrees of freedom.
    points : int
        Number of positions.
    duration : float, [s]
        From the first to the last position.
    """

    time: float
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    position_variance: float
    velocity_variance: float
    chi_square: float
    points: int
    duration: float

    @classmethod
    def from_row(cls, row: NDArray[np.float64]) -> Line:
        """Read a line from an array, (LINE_SIZE,)."""
        *_, position, velocity, chi_square, points, duration = row.tolist()
        return cls(
            float(row[0]),
            row[1:3],
            row[3:5],
            position,
            velocity,
            chi_square,
            int(points),
            duration,
        )

    @property
    def row(self) -> NDArray[np.float64]:
        """The fields in an array, (LINE_SIZE,)."""
        return np.hstack(self)


@compiled
def _chi_square(sums: NDArray[np.float64], first: int, end: int) -> float:
    """Chi square of a line, from sums of w, wt, wtt, wx, wxt, wy, wyt, w(xx+yy)."""
    w = sums[end, 0] - sums[first, 0]
    t = sums[end, 1] - sums[first, 1]
    x = sums[end, 3] - sums[first, 3]
    y = sums[end, 5] - sums[first, 5]
    spread = sums[end, 2] - sums[first, 2] - t * t / w
    cross_x = sums[end, 4] - sums[first, 4] - t * x / w
    cross_y = sums[end, 6] - sums[first, 6] - t * y / w
    slope = (cross_x * cross_x + cross_y * cross_y) / spread if spread > 0.0 else 0.0
    chi_square: float = sums[end, 7] - sums[first, 7] - (x * x + y * y) / w - slope
    return chi_square


@compiled
def best_break(
    times: NDArray[np.float64],
    positions: NDArray[np.float64],
    errors: NDArray[np.float64],
    min_points: int,
) -> tuple[int, float]:
    """Find the break at which two straight lines fit the positions best.

    Parameters
    ----------
    times : ndarray (n,), [s]
    positions : ndarray (n, 2), [m]
    errors : ndarray (n,), [m]
        Of one coordinate.
    min_points : int, >= 2
        Positions on each side.

    Returns
    -------
    first : int
        First position of the second line; 0 when there are too few positions.
    gain : float
        Decrease of chi square against a single line.
    """
    n = times.size
    if n < 2 * min_points:
        return 0, 0.0
    sums = np.zeros((n + 1, _N_SUMS))
    for k in range(n):
        # Relative to the first position, so that squares stay small.
        t = times[k] - times[0]
        x, y = positions[k, 0] - positions[0, 0], positions[k, 1] - positions[0, 1]
        w = 1.0 / (errors[k] * errors[k])
        for c, term in enumerate((1.0, t, t * t, x, x * t, y, y * t, x * x + y * y)):
            sums[k + 1, c] = sums[k, c] + w * term
    lowest, first = np.inf, 0
    for k in range(min_points, n - min_points + 1):
        chi_square = _chi_square(sums, 0, k) + _chi_square(sums, k, n)
        if chi_square < lowest:
            lowest, first = chi_square, k
    return first, _chi_square(sums, 0, n) - lowest


@compiled
def write_line(
    times: NDArray[np.float64],
    positions: NDArray[np.float64],
    errors: NDArray[np.float64],
    row: NDArray[np.float64],
) -> None:
    """Fit a line to positions (n, 2), n >= 2, weighted by errors, into an array (LINE_SIZE,)."""
    _fit(times, positions, errors, row)
    row[9] = times[-1] - times[0]


@compiled
def rescale_errors(
    row: NDArray[np.float64], variance: float, shared_error: float, correlation_length: float
) -> None:
    """Rescale the variances of a line to the residual variance, and add shared errors.

    Parameters
    ----------
    row : ndarray (LINE_SIZE,)
        Changed.
    variance : float
        Residual variance over the stated one.
    shared_error : float, [m]
        Standard error that neighbouring positions have in common.
    correlation_length : float, [m]
        Path over which that error changes. Along a shorter path before and after a contact it
        tilts both lines alike, and their ratio stays the same.
    """
    duration = row[9]
    squared_path = (row[3] * row[3] + row[4] * row[4]) * duration * duration
    decorrelated = squared_path / (squared_path + correlation_length * correlation_length)
    tilt = shared_error / duration
    row[5] *= variance
    # The ends weigh most in a slope: one wave of the error along a flight tilts it by about this.
    row[6] = variance * row[6] + decorrelated * 4.0 * tilt * tilt
    # Errors that positions share bend a line: residuals within the stated errors are straight.
    row[7] /= max(variance, 1.0)


def fit_line(
    times: NDArray[np.float64], positions: NDArray[np.float64], errors: NDArray[np.float64]
) -> Line:
    """Fit a line to positions (n, 2), n >= 2, weighted by their errors."""
    row = np.empty(LINE_SIZE)
    write_line(times, positions, errors, row)
    return Line.from_row(row)


class Intersection(NamedTuple):
    """Time at which the lines before and after a contact intersect, for one or more beads.

    Parameters
    ----------
    time, error : float, [s]
    chi_square : float
        Of the positions at that time; ``2 beads - 1`` degrees of freedom.
    """

    time: float
    error: float
    chi_square: float


@compiled
def intersect_lines(lines: NDArray[np.float64]) -> tuple[float, float, float]:
    """Time, error and chi square of an `Intersection` of lines, (beads, 2, LINE_SIZE)."""
    beads = lines.shape[0]
    time = 0.0
    for k in range(beads):
        time += lines[k, 0, 0] + lines[k, 1, 0]
    time *= 0.5 / beads
    error, chi_square = np.inf, 0.0
    # The errors of the lines depend on the instant; two rounds are enough.
    for _ in range(2):
        numerator, denominator, total = 0.0, 0.0, 0.0
        for k in range(beads):
            before, after = lines[k, 0], lines[k, 1]
            since_before, since_after = time - before[0], time - after[0]
            variance = (
                before[5]
                + before[6] * since_before * since_before
                + after[5]
                + after[6] * since_after * since_after
            )
            x = after[1] + after[3] * since_after - before[1] - before[3] * since_before
            y = after[2] + after[4] * since_after - before[2] - before[4] * since_before
            u, v = after[3] - before[3], after[4] - before[4]
            numerator -= (x * u + y * v) / variance
            denominator += (u * u + v * v) / variance
            total += (x * x + y * y) / variance
        step = numerator / denominator
        time += step
        error, chi_square = 1.0 / math.sqrt(denominator), max(total - numerator * step, 0.0)
    return time, error, chi_square


@compiled
def contact_position(lines: NDArray[np.float64], time: float) -> tuple[float, float, float]:
    """Position of the bead at the contact from both flights, and the variance of a coordinate."""
    before, after = lines[0], lines[1]
    since_before, since_after = time - before[0], time - after[0]
    variance = before[5] + before[6] * since_before * since_before
    after_variance = after[5] + after[6] * since_after * since_after
    weight = after_variance / (variance + after_variance)
    x = weight * (before[1] + before[3] * since_before) + (1.0 - weight) * (
        after[1] + after[3] * since_after
    )
    y = weight * (before[2] + before[4] * since_before) + (1.0 - weight) * (
        after[2] + after[4] * since_after
    )
    return x, y, weight * variance


@compiled
def are_straight(lines: NDArray[np.float64]) -> bool:
    """Whether both flights of a contact, (2, LINE_SIZE), are straight within their errors."""
    for k in range(2):
        freedom = 2.0 * lines[k, 8] - 4.0
        if lines[k, 7] > freedom + _MAX_CHI_SQUARE_SIGMAS * math.sqrt(2.0 * freedom):
            return False
    return True
