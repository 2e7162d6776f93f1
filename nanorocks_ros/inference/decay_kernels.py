"""The loops of `decay_likelihood`, compiled: place by place of the grid of restitutions."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

ROUNDING = 1e-9
_NEWTON_STEPS = 15
_MOST = 1e300
_LONGEST_STEP = 0.5
_SMALL = 3e-3
# Before anything is measured the gas is taken to have been faster at the shaking event than at the
# first speed used by a factor of 1.6, give or take a factor of e, where that is within four
# seconds of the event. What it did before a first speed that comes later is known the less the
# later that is: both rise with the logarithm of that time.
_AMPLITUDE_LEAD, _AMPLITUDE_SPREAD = 0.5, 1.0
_EARLY, _LEAD_PER_LOG_TIME = math.log(4.0), 1.0
# The search begins where the first speeds are matched, however fast the gas was.
_MOST_LEAD = 8.0
# Speeds from which the amplitude is guessed.
_FIRST_SPEEDS = 3
# Sums that are made side by side: one alone would wait for its own last result at each term.
_ABREAST = 4


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
    first: float,
    step: float,
    found: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
) -> None:
    """Fill in the likelihood at every place, for its best amplitude.

    Parameters
    ----------
    data : tuple of 3 ndarrays (n,)
        ln t, ln v and its variance.
    cells : ndarray of int64, (n,)
        Bins of the data, counted from the first.
    covariances : ndarray (n_corners, n_x, n_x)
    corners, shares : ndarray (n_places or 1, 4)
        One for all places, or one of each.
    means, slopes : ndarray (n_places, n_x), (n_places, n_z, n_x)
    camera : ndarray (2,)
    first, step : float
        Logarithm of the first distance of the library, and from each to the next.
    found : tuple of ndarray (n_places, 2), (n_places or 0, n_z + 2), (n_places or 0, n_z + 2, \
n_z + 2)
        Log likelihood and deviation; gradient and information, which may be left out.
    """
    log_time, log_speed, variance = data
    numbers, gradients, informations = found
    n = log_time.size
    n_z = slopes.shape[1] + camera.size
    mixed = np.empty(covariances.shape[1:])
    factor = np.empty((n, n))
    # Columns: residual, derivative with ln a, then the nuisances; whitened in place.
    columns = np.empty((2 + n_z, n))
    middle = log_speed.mean()
    late = _LEAD_PER_LOG_TIME * max(log_time[0] - _EARLY, 0.0)
    expected = log_speed[0] + _AMPLITUDE_LEAD + late
    spread = _AMPLITUDE_SPREAD + late
    for place in range(means.shape[0]):
        if place < corners.shape[0]:
            _mix(covariances, corners[place], shares[place], mixed)
        amplitude = _matching(log_time, log_speed, means[place], first, step)
        offset = (amplitude + log_time[0] - first) / step
        _covariance(mixed, cells, offset, factor)
        for i in range(n):
            factor[i, i] += variance[i]
        log_determinant = _factorise(factor)
        change = _LONGEST_STEP
        cost = _MOST
        best = amplitude
        for _ in range(_NEWTON_STEPS):
            _compare(log_time, log_speed, means[place], first, step, amplitude, columns)
            _whiten(factor, columns, 2)
            off = (amplitude - expected) / spread
            now = off * off
            pull = -off / spread
            stiffness = 1.0 / spread**2
            for i in range(n):
                now += columns[0, i] ** 2
                pull += columns[0, i] * columns[1, i]
                stiffness += columns[1, i] ** 2
            if now > cost:
                # Too far: the mean is curved.
                change *= 0.3
            else:
                cost, best = now, amplitude
                change = min(max(pull / stiffness, -_LONGEST_STEP), _LONGEST_STEP)
            amplitude = best + change
            if abs(change) < _SMALL:
                break
        off = (best - expected) / spread
        if gradients.shape[0] == 0:
            numbers[place, 1] = cost - off * off
            numbers[place, 0] = -0.5 * (cost + log_determinant)
            continue
        _compare(log_time, log_speed, means[place], first, step, best, columns)
        for i in range(n):
            at = (best + log_time[i] - first) / step
            # Beyond its ends the library's slopes stay as they are there.
            at = min(max(at, 0.0), slopes.shape[2] - 1.0)
            for z in range(slopes.shape[1]):
                columns[2 + z, i] = _between(slopes[place, z], at)[0]
            columns[n_z, i] = camera[0] * (columns[1, i] - 1.0)
            columns[n_z + 1, i] = camera[1] * (log_speed[i] - middle)
        _whiten(factor, columns, 2 + n_z)
        _sum_up(columns, (off, spread), numbers[place], gradients[place], informations[place])
        numbers[place, 0] -= 0.5 * (log_determinant + off * off)


@compiled
def _matching(
    log_time: NDArray[np.float64],
    log_speed: NDArray[np.float64],
    mean: NDArray[np.float64],
    first: float,
    step: float,
) -> float:
    """The amplitude with which the first speeds are the expected ones, if there is one."""
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


@compiled
def _mix(
    covariances: NDArray[np.float64],
    corners: NDArray[np.int64],
    shares: NDArray[np.float64],
    found: NDArray[np.float64],
) -> None:
    """The covariance of the library between four corners."""
    one, two, three, four = (
        covariances[corners[0]],
        covariances[corners[1]],
        covariances[corners[2]],
        covariances[corners[3]],
    )
    for i in range(found.shape[0]):
        for j in range(found.shape[1]):
            found[i, j] = (
                shares[0] * one[i, j]
                + shares[1] * two[i, j]
                + shares[2] * three[i, j]
                + shares[3] * four[i, j]
            )


@compiled
def _covariance(
    table: NDArray[np.float64],
    cells: NDArray[np.int64],
    offset: float,
    found: NDArray[np.float64],
) -> None:
    """Lower half of the covariance of data at some cells after an offset."""
    n = cells.size
    last = table.shape[0] - 1
    # Beyond the ends of the library the covariance is that of its ends, cells apart as they are.
    within = min(max(offset, 0.0), last - cells[n - 1] - ROUNDING)
    whole = math.floor(within)
    high = within - whole
    low = 1.0 - high
    for i in range(n):
        row = max(whole + cells[i], 0)
        for j in range(i + 1):
            column = max(whole + cells[j], 0)
            found[i, j] = low * table[row, column] + high * table[row + 1, column + 1]


@compiled
def _factorise(matrix: NDArray[np.float64]) -> float:
    """Cholesky factor in place, in the lower half; ln of the determinant."""
    n = matrix.shape[0]
    log_determinant = 0.0
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i == j:
                log_determinant += math.log(total)
                matrix[i, i] = math.sqrt(total)
            else:
                matrix[i, j] = total / matrix[j, j]
    return log_determinant


@compiled
def _whiten(factor: NDArray[np.float64], columns: NDArray[np.float64], count: int) -> None:
    """The first columns divided by the factor, in place."""
    for one in range(0, count, _ABREAST):
        # Beyond the end the last column is done again, which does no harm.
        two, three, four = (
            min(one + 1, count - 1),
            min(one + 2, count - 1),
            min(one + 3, count - 1),
        )
        for i in range(factor.shape[0]):
            a, b, c, d = columns[one, i], columns[two, i], columns[three, i], columns[four, i]
            for k in range(i):
                share = factor[i, k]
                a -= share * columns[one, k]
                b -= share * columns[two, k]
                c -= share * columns[three, k]
                d -= share * columns[four, k]
            root = factor[i, i]
            columns[one, i], columns[two, i] = a / root, b / root
            columns[three, i], columns[four, i] = c / root, d / root


@compiled
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


@compiled
def _between(values: NDArray[np.float64], at: float) -> tuple[float, float]:
    """Value and slope between two entries, straight on beyond the ends."""
    cell = min(max(math.floor(at), 0), values.size - 2)
    slope = values[cell + 1] - values[cell]
    return values[cell] + (at - cell) * slope, slope


@compiled
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
    # At the best amplitude there is no pull left, but where the mean has a kink or an end.
    pull = -off / spread
    stiffness = 1.0 / spread**2
    for i in range(n):
        deviation += columns[0, i] ** 2
        pull += columns[0, i] * columns[1, i]
        stiffness += columns[1, i] ** 2
    along = np.zeros(gradient.size)
    for z in range(gradient.size):
        slope = 0.0
        for i in range(n):
            along[z] += columns[1, i] * columns[2 + z, i]
            slope += columns[0, i] * columns[2 + z, i]
        # What the amplitude would take over is no gain of a nuisance.
        gradient[z] = slope - along[z] * pull / stiffness
        for one in range(0, z + 1, _ABREAST):
            two, three, four = min(one + 1, z), min(one + 2, z), min(one + 3, z)
            share = -along[z]
            a, b = share * along[one] / stiffness, share * along[two] / stiffness
            c, d = share * along[three] / stiffness, share * along[four] / stiffness
            for i in range(n):
                value = columns[2 + z, i]
                a += value * columns[2 + one, i]
                b += value * columns[2 + two, i]
                c += value * columns[2 + three, i]
                d += value * columns[2 + four, i]
            for y, total in ((one, a), (two, b), (three, c), (four, d)):
                information[z, y] = total
                information[y, z] = total
    numbers[0] = -0.5 * deviation
    numbers[1] = deviation
