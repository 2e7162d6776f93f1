"""Compiled loops of `decay_likelihood` over the points of the grid of restitutions.

Tested by ``test/inference/decay/test_decay_likelihood.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, kernel
from nanorocks_ros.numerics.small_cholesky import factorise, whiten

if TYPE_CHECKING:
    from numpy.typing import NDArray

ROUNDING = 1e-9
_NEWTON_STEPS = 15
_LONGEST_STEP, _SMALL = 0.5, 3e-3
# The search starts from the amplitude that matches the first speeds; largest ln of it over them.
_MOST_LEAD = 8.0
# The speed at the start over the first speed that is seen, its logarithm; and standard deviations
# of the prior by which it may be off before the prior is widened by the rest.
_LEAD, _SURPRISE = 0.5, 2.0
# Drag times the time in the clock without it: below the first it is negligible, and at 1 the gas
# has come to rest.
_NEARLY_STRAIGHT, _MOST_DRAGGED = 1e-4, 1.0 - 1e-9
# Number of speeds for the initial amplitude.
_FIRST_SPEEDS = 3


@compiled
def evaluate(
    data: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    cells: NDArray[np.int64],
    covariances: NDArray[np.float64],
    corners: NDArray[np.int64],
    shares: NDArray[np.float64],
    means: NDArray[np.float64],
    slopes: NDArray[np.float64],
    camera: NDArray[np.float64],
    start: tuple[float, float],
    axis: tuple[float, float],
    results: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
) -> None:
    """Compute the likelihood at every point of the grid, for its best amplitude.

    Parameters
    ----------
    data : tuple of 3 ndarrays (n,)
        ln t, ln v and its variance.
    cells : ndarray of int64, (n,)
        Bins of the data, counted from the first.
    covariances : ndarray (n_corners, n_x, n_x)
    corners, shares : ndarray (n_places or 1, 4)
        One for all points, or one for each.
    means, slopes : ndarray (n_places, n_x), (n_places, n_z, n_x)
    camera : ndarray (5,)
        Standard deviations of scale and bias; drag and its standard deviation, [1/s]; standard
        deviation of the moment from which the times count, [s].
    start : tuple of 2 floats
        Mean and standard deviation of ln a before the decay is seen; wider where the first speeds
        are far off.
    axis : tuple of 2 floats
        Logarithm of the first distance of the library, and its step.
    results : tuple of 3 ndarrays
        Log likelihood, deviation and start of `DecayLikelihood`, (n_places, 3); gradient,
        (n_places, n_z + 4), and information, (n_places, n_z + 4, n_z + 4): empty if not needed.
    """
    log_time, log_speed, variance = data
    numbers, gradients, informations = results
    first, step = axis
    expected, spread = start
    # Films of other experiments have other speeds: a prior that is far off must not decide.
    surprise = abs(log_speed[0] + _LEAD - expected) - _SURPRISE * spread
    spread = math.hypot(spread, max(surprise, 0.0))
    n = log_time.size
    n_z = slopes.shape[1] + 4
    mixed = np.empty(covariances.shape[1:])
    factor = np.empty((n, n))
    # Columns: residual, derivative with ln a, then the nuisances; whitened in place.
    columns = np.empty((2 + n_z, n))
    middle = log_speed.mean()
    for place in range(means.shape[0]):
        amplitude = _matching(log_time, log_speed, means[place], first, step)
        # Beyond the ends of the library the covariance is that of its ends.
        offset = max((amplitude + log_time[0] - first) / step, 0.0)
        offset = min(offset, len(mixed) - 1 - cells[n - 1] - ROUNDING)
        if corners.shape[0] > 1:
            part = max(int(offset), 0), min(int(offset) + cells[n - 1] + 2, len(mixed))
            _mix(covariances, corners[place], shares[place], part, mixed)
        elif place == 0:
            _mix(covariances, corners[0], shares[0], (0, len(mixed)), mixed)
        _covariance(mixed, cells, offset, factor)
        for i in range(n):
            factor[i, i] += variance[i]
        log_determinant = factorise(factor)
        best, cost = _best_amplitude(
            data, means[place], axis, factor, (amplitude, expected, spread), columns
        )
        deviation = (best - expected) / spread
        if gradients.shape[0] == 0:
            numbers[place, 1] = cost - deviation * deviation
            numbers[place, 0] = -0.5 * (cost + log_determinant)
            continue
        _compare(log_time, log_speed, means[place], first, step, best, columns)
        offset = (best - first) / step
        _look_up(slopes[place], log_time / step + offset, columns[2:])
        columns[n_z - 2] = camera[0] * (columns[1] - 1.0)
        # The expected speeds: measured ones share their noise with the residuals, and over many
        # cycles that would count as a bias of the camera.
        columns[n_z - 1] = camera[1] * (log_speed - columns[0] - middle)
        _drag_column(log_time, camera[2], camera[3], columns[1], columns[n_z])
        _start_column(log_time, camera[2], camera[4], columns[1], columns[n_z + 1])
        whiten(factor, columns, 2 + n_z)
        _sum_up(
            columns, (deviation, spread), numbers[place], gradients[place], informations[place]
        )
        numbers[place, 0] -= 0.5 * (log_determinant + deviation * deviation)


@kernel
def _drag_column(
    log_time: NDArray[np.float64],
    drag: float,
    error: float,
    slope: NDArray[np.float64],
    column: NDArray[np.float64],
) -> None:
    """Change of the expected ln w at a time s, for one standard deviation of the drag.

    With x = drag s, ln(w) changes by t = -ln(1 - x) / drag for each unit of the drag, and ln(s) by
    (t (1 - x) - s) / (drag s), from which the slope of the mean makes another change of ln(w).
    """
    for i in range(log_time.size):
        s = math.exp(log_time[i])
        x = min(drag * s, _MOST_DRAGGED)
        if abs(x) < _NEARLY_STRAIGHT:
            # The first terms of both series.
            time, later = s * (1.0 + 0.5 * x), -s * (0.5 + x / 6.0)
        else:
            time = -math.log1p(-x) / drag
            later = (time * (1.0 - x) - s) / x
        column[i] = error * ((slope[i] - 1.0) * later - time)


@kernel
def _start_column(
    log_time: NDArray[np.float64],
    drag: float,
    error: float,
    slope: NDArray[np.float64],
    column: NDArray[np.float64],
) -> None:
    """Change of the expected ln w at a time s, where the gas began to cool one `error` later.

    Times are shorter then, so that s falls by 1 - drag s, and less drag has slowed the gas.
    """
    for i in range(log_time.size):
        s = math.exp(log_time[i])
        column[i] = error * (drag + (1.0 - slope[i]) * (1.0 - min(drag * s, 1.0)) / s)


@kernel
def _best_amplitude(
    data: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    mean: NDArray[np.float64],
    axis: tuple[float, float],
    factor: NDArray[np.float64],
    amplitudes: tuple[float, float, float],
    columns: NDArray[np.float64],
) -> tuple[float, float]:
    """The likeliest ln a and its cost, by Newton's method.

    `amplitudes` are the initial ln a, and the mean and standard deviation of its prior.
    """
    log_time, log_speed, _ = data
    first, step = axis
    amplitude, expected, spread = amplitudes
    residual, slope = columns[0], columns[1]
    change = _LONGEST_STEP
    cost = np.inf
    best = amplitude
    for _ in range(_NEWTON_STEPS):
        _compare(log_time, log_speed, mean, first, step, amplitude, columns)
        whiten(factor, columns, 2)
        deviation = (amplitude - expected) / spread
        new_cost = deviation * deviation
        pull = -deviation / spread
        stiffness = 1.0 / spread**2
        for i in range(log_time.size):
            new_cost += residual[i] ** 2
            pull += residual[i] * slope[i]
            stiffness += slope[i] ** 2
        if new_cost > cost:
            # The step was too long: the mean is curved.
            change *= 0.3
        else:
            cost, best = new_cost, amplitude
            change = min(max(pull / stiffness, -_LONGEST_STEP), _LONGEST_STEP)
        amplitude = best + change
        if abs(change) < _SMALL:
            break
    return best, cost


@kernel
def _matching(
    log_time: NDArray[np.float64],
    log_speed: NDArray[np.float64],
    mean: NDArray[np.float64],
    first: float,
    step: float,
) -> float:
    """The amplitude that matches the first speeds, if there is one."""
    n = min(_FIRST_SPEEDS, log_time.size)
    low, high = log_speed[0], log_speed[0] + _MOST_LEAD
    while high - low > _SMALL:
        amplitude = 0.5 * (low + high)
        rest = 0.0
        for i in range(n):
            value, _ = _between(mean, (amplitude + log_time[i] - first) / step)
            rest += log_speed[i] - amplitude - value
        if rest > 0.0:
            low = amplitude
        else:
            high = amplitude
    return float(low)


@kernel
def _mix(
    covariances: NDArray[np.float64],
    corners: NDArray[np.int64],
    shares: NDArray[np.float64],
    part: tuple[int, int],
    covariance: NDArray[np.float64],
) -> None:
    """Covariance of the library interpolated between four corners, in a range of distances."""
    first, second = covariances[corners[0]], covariances[corners[1]]
    third, fourth = covariances[corners[2]], covariances[corners[3]]
    for i in range(part[0], part[1]):
        for j in range(part[0], part[1]):
            covariance[i, j] = (
                shares[0] * first[i, j]
                + shares[1] * second[i, j]
                + shares[2] * third[i, j]
                + shares[3] * fourth[i, j]
            )


@kernel
def _covariance(
    table: NDArray[np.float64],
    cells: NDArray[np.int64],
    offset: float,
    covariance: NDArray[np.float64],
) -> None:
    """Lower half of the covariance of data in some cells, shifted by an offset."""
    whole = math.floor(offset)
    high = offset - whole
    low = 1.0 - high
    for i in range(cells.size):
        row = max(whole + cells[i], 0)
        row_below, row_above, target = table[row], table[row + 1], covariance[i]
        for j in range(i + 1):
            column = max(whole + cells[j], 0)
            target[j] = low * row_below[column] + high * row_above[column + 1]


@kernel
def _compare(
    log_time: NDArray[np.float64],
    log_speed: NDArray[np.float64],
    mean: NDArray[np.float64],
    first: float,
    step: float,
    amplitude: float,
    columns: NDArray[np.float64],
) -> None:
    """Residuals at an amplitude, and the derivative of the expected ln v with it."""
    for i in range(log_time.size):
        value, slope = _between(mean, (amplitude + log_time[i] - first) / step)
        columns[0, i] = log_speed[i] - amplitude - value
        columns[1, i] = 1.0 + slope / step


@kernel
def _between(values: NDArray[np.float64], at: float) -> tuple[float, float]:
    """Linear interpolation and its slope, extrapolated beyond the ends."""
    cell = min(max(math.floor(at), 0), values.size - 2)
    slope = values[cell + 1] - values[cell]
    return values[cell] + (at - cell) * slope, slope


@kernel
def _look_up(
    slopes: NDArray[np.float64], places: NDArray[np.float64], changes: NDArray[np.float64]
) -> None:
    """Changes of ln f with nuisances, (n_z, n_x), between distances; (n_z, n)."""
    for i in range(places.size):
        # Beyond the ends of the library its slopes are constant.
        at = min(max(places[i], 0.0), slopes.shape[1] - 1.0)
        cell = min(int(at), slopes.shape[1] - 2)
        share = at - cell
        for z in range(slopes.shape[0]):
            value = slopes[z, cell]
            changes[z, i] = value + share * (slopes[z, cell + 1] - value)


@kernel
def _sum_up(
    columns: NDArray[np.float64],
    amplitude: tuple[float, float],
    numbers: NDArray[np.float64],
    gradient: NDArray[np.float64],
    information: NDArray[np.float64],
) -> None:
    """Log likelihood and its derivatives, with the amplitude projected out."""
    n = columns.shape[1]
    off, spread = amplitude
    deviation = 0.0
    # At the best amplitude the gradient vanishes, except at kinks and ends of the mean.
    pull = -off / spread
    stiffness = 1.0 / spread**2
    for i in range(n):
        deviation += columns[0, i] ** 2
        pull += columns[0, i] * columns[1, i]
        stiffness += columns[1, i] ** 2
    residual, with_amplitude = columns[0], columns[1]
    for z in range(gradient.size):
        own = columns[2 + z]
        shared = 0.0
        for i in range(n):
            shared += with_amplitude[i] * own[i]
        # Stored here until all of them have been used.
        gradient[z] = shared
        for first in range(0, z + 1, 2):
            # Two columns at a time; an odd last one is paired with itself.
            second = min(first + 1, z)
            column, next_column = columns[2 + first], columns[2 + second]
            a, b = -shared * gradient[first] / stiffness, -shared * gradient[second] / stiffness
            for i in range(n):
                a += own[i] * column[i]
                b += own[i] * next_column[i]
            information[z, first] = information[first, z] = a
            information[z, second] = information[second, z] = b
    for z in range(gradient.size):
        own = columns[2 + z]
        slope = 0.0
        for i in range(n):
            slope += residual[i] * own[i]
        # The part that the amplitude can absorb is no gain of a nuisance.
        gradient[z] = slope - gradient[z] * pull / stiffness
    numbers[0] = -0.5 * deviation
    numbers[1] = deviation
    numbers[2] = -0.5 * math.log(stiffness * spread**2)
