"""How likely a measured decay is, for every pair of restitutions on a grid.

A decay is a series of ln v with errors. Against the mean ln f of the library, the deviations of
the gas from its mean have the library's covariance, and the errors of the speeds add to it. The
amplitude is free: v(t) = a f(a t) holds exactly, and the best a is found for each place of the
grid by Newton's method (a profile likelihood: integrating over ln a instead would favour low
restitutions, of which a fast gas soon forgets how fast it was). What is not known exactly of
the tray or the camera (`nuisances`) is left in: for every place the result holds how the
likelihood depends on it, to second order, so that many decays of one tray can be added up before
it is integrated over; unlike noise it does not average out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from nanorocks_ros.physics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.decay_library import DecayLibrary

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
# Nothing is measured better than that, relative.
_LEAST_ERROR = 2e-3
_ROUNDING = 1e-9
# Standard deviations up to which a nuisance may be off.
_FARTHEST = 4.0
# One of so many places is looked at to find about the best.
_EVERY = 4
# A scale known no better than this is no linear nuisance: it is tried at so many of its standard
# deviations, and linear by half of one between them.
_WIDE = 0.1
_SCALES = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
# Nuisances of the camera, beside those of the library: scale of lengths, and a relative error of
# the speeds that grows with their logarithm.
CAMERA_NUISANCES = ('scale', 'speed_bias')


@dataclass(frozen=True, slots=True, kw_only=True)
class DecayTables:
    """The library at the places of a grid of restitutions.

    Parameters
    ----------
    decays : DecayLibrary
    restitution : ndarray (n_c,)
    wall_restitution : ndarray (n_w,)
    mean : ndarray (n_c * n_w, n_x)
        Of ln f.
    slopes : ndarray (n_c * n_w, n_z, n_x)
        Change of ln f for one standard deviation of each nuisance; without those of the camera.
    corners : ndarray of int64, (n_c * n_w, 4)
        Places around each, in the grid of the covariances.
    shares : ndarray (n_c * n_w, 4)
        Their weights.
    """

    decays: DecayLibrary
    restitution: NDArray[np.float64]
    wall_restitution: NDArray[np.float64]
    mean: NDArray[np.float64]
    slopes: NDArray[np.float64]
    corners: NDArray[np.int64]
    shares: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class DecayLikelihood:
    """What decays say, at the places of the grid; those of several decays add up.

    Where the scale is hardly known every array has one axis more before those named here: one
    likelihood for each scale that is tried.

    Parameters
    ----------
    log_likelihood : ndarray (n_places,)
        For nuisances as they are expected.
    gradient : ndarray (n_places, n_z)
        Of it with the nuisances, in units of their standard deviations.
    information : ndarray (n_places, n_z, n_z)
        Minus its second derivative.
    deviation : ndarray (n_places,)
        Sum of the squares of the whitened residuals.
    samples : int
        Independent of how many speeds went into each: binned.
    """

    log_likelihood: NDArray[np.float64]
    gradient: NDArray[np.float64]
    information: NDArray[np.float64]
    deviation: NDArray[np.float64]
    samples: int

    def __add__(self, other: DecayLikelihood) -> DecayLikelihood:
        return DecayLikelihood(
            log_likelihood=self.log_likelihood + other.log_likelihood,
            gradient=self.gradient + other.gradient,
            information=self.information + other.information,
            deviation=self.deviation + other.deviation,
            samples=self.samples + other.samples,
        )

    def integrated(self) -> NDArray[np.float64]:
        """Log likelihood (n_places,) with the nuisances integrated over their Gaussian priors."""
        prior = np.eye(self.gradient.shape[-1])
        matrix = prior + self.information
        shift = np.linalg.solve(matrix, self.gradient[..., np.newaxis])[..., 0]
        # Far out the dependence is not linear, and could explain anything.
        share = np.minimum(1.0, _FARTHEST / np.maximum(np.abs(shift).max(axis=-1), _FARTHEST))
        gain = (share - 0.5 * share**2) * np.einsum('...z,...z->...', self.gradient, shift)
        each = self.log_likelihood + gain - 0.5 * np.linalg.slogdet(matrix)[1]
        if each.ndim == 1:
            return np.asarray(each)
        weight = np.exp(-0.5 * _SCALES**2)
        return np.asarray(logsumexp(each, axis=0, b=(weight / weight.sum())[:, np.newaxis]))

    def deviation_at(self, place: int) -> float:
        """Sum of the squares of the whitened residuals at a place, for the likeliest scale."""
        deviation = np.atleast_2d(self.deviation)[:, place]
        return float(deviation[np.atleast_2d(self.log_likelihood)[:, place].argmax()])


def decay_likelihood(
    tables: DecayTables,
    time: NDArray[np.float64],
    speed: NDArray[np.float64],
    error: NDArray[np.float64],
    camera: tuple[float, float],
) -> DecayLikelihood:
    """The likelihood of one decay over the grid.

    Parameters
    ----------
    tables : DecayTables
    time : ndarray (n,), [s], > 0
        Since the shaking event; rising. Of times further apart than the ends of the library are,
        the first count.
    speed, error : ndarray (n,), [m/s], > 0
        Mean projected speeds and one standard error of each.
    camera : tuple of 2 floats
        Standard deviations of the `CAMERA_NUISANCES`, relative.
    """
    library = tables.decays
    within = time < time[0] * math.exp((library.distances.size - 2) * library.step)
    cells, log_time, log_speed, variance = _binned(
        library.step, time[within], speed[within], error[within]
    )
    data = (log_time, log_speed, variance)
    # First with the covariance of each place, then at all of them with that of the best one: how
    # strongly the gas fluctuates is known too roughly to tell restitutions by.
    some = slice(None, None, _EVERY)
    rough = _over(tables, data, cells, camera, some, tables.corners[some], tables.shares[some])
    best = int(np.argmax(rough.log_likelihood)) * _EVERY
    corners = np.tile(tables.corners[best], (tables.mean.shape[0], 1))
    shares = np.tile(tables.shares[best], (tables.mean.shape[0], 1))
    scale, bias = camera
    if scale <= _WIDE:
        return _over(tables, data, cells, camera, slice(None), corners, shares)
    each = [
        _over(
            tables,
            (log_time, log_speed - step * scale, variance),
            cells,
            (0.5 * scale, bias),
            slice(None),
            corners,
            shares,
        )
        for step in _SCALES
    ]
    return DecayLikelihood(
        **{
            name: np.stack([getattr(one, name) for one in each])
            for name in ('log_likelihood', 'gradient', 'information', 'deviation')
        },
        samples=cells.size,
    )


def _over(
    tables: DecayTables,
    data: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    cells: NDArray[np.int64],
    camera: tuple[float, float],
    places: slice,
    corners: NDArray[np.int64],
    shares: NDArray[np.float64],
) -> DecayLikelihood:
    """The likelihood at some places, with covariances between given corners."""
    library = tables.decays
    mean = tables.mean[places]
    n_z = tables.slopes.shape[1] + len(CAMERA_NUISANCES)
    numbers = np.empty((len(mean), 2))
    gradient = np.empty((len(mean), n_z))
    information = np.empty((len(mean), n_z, n_z))
    _evaluate(
        data,
        cells,
        library.covariance.reshape(-1, *library.covariance.shape[2:]),
        np.ascontiguousarray(corners),
        np.ascontiguousarray(shares),
        np.ascontiguousarray(mean),
        np.ascontiguousarray(tables.slopes[places]),
        np.array(camera),
        math.log(library.distances[0]),
        library.step,
        (numbers, gradient, information),
    )
    return DecayLikelihood(
        log_likelihood=numbers[:, 0],
        gradient=gradient,
        information=information,
        deviation=numbers[:, 1],
        samples=cells.size,
    )


def _binned(
    step: float, time: NDArray[np.float64], speed: NDArray[np.float64], error: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Number, ln t, ln v and its variance of each bin as wide as the step of the library."""
    bins = np.floor(np.log(time / time[0]) / step + _ROUNDING).astype(np.int64)
    starts = np.flatnonzero(np.diff(bins, prepend=-1))
    counts = np.diff(np.append(starts, time.size))
    relative = np.maximum(error / speed, _LEAST_ERROR)
    log_time = np.add.reduceat(np.log(time), starts) / counts
    log_speed = np.add.reduceat(np.log(speed), starts) / counts
    variance = np.add.reduceat(relative**2, starts) / counts**2
    # No two of them at one place: their covariance would be that of one and the same.
    return bins[starts], log_time, log_speed, variance


@compiled
def _evaluate(
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
    """Fill in the likelihood at every place, for its best amplitude."""
    log_time, log_speed, variance = data
    numbers, gradients, informations = found
    n = log_time.size
    n_z = slopes.shape[1] + camera.size
    factor = np.empty((n, n))
    # Columns: residual, derivative with ln a, then the nuisances; whitened in place.
    columns = np.empty((2 + n_z, n))
    middle = log_speed.mean()
    late = _LEAD_PER_LOG_TIME * max(log_time[0] - _EARLY, 0.0)
    expected = log_speed[0] + _AMPLITUDE_LEAD + late
    spread = _AMPLITUDE_SPREAD + late
    for place in range(means.shape[0]):
        amplitude = _matching(log_time, log_speed, means[place], first, step)
        offset = (amplitude + log_time[0] - first) / step
        _covariance(covariances, corners[place], shares[place], cells, offset, factor)
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
        amplitude = best
        _compare(log_time, log_speed, means[place], first, step, amplitude, columns)
        for i in range(n):
            at = (amplitude + log_time[i] - first) / step
            # Beyond its ends the library's slopes stay as they are there.
            at = min(max(at, 0.0), slopes.shape[2] - 1.0)
            for z in range(slopes.shape[1]):
                columns[2 + z, i] = _between(slopes[place, z], at)[0]
            columns[n_z, i] = camera[0] * (columns[1, i] - 1.0)
            columns[n_z + 1, i] = camera[1] * (log_speed[i] - middle)
        _whiten(factor, columns, 2 + n_z)
        off = (amplitude - expected) / spread
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
def _covariance(
    covariances: NDArray[np.float64],
    corners: NDArray[np.int64],
    shares: NDArray[np.float64],
    cells: NDArray[np.int64],
    offset: float,
    found: NDArray[np.float64],
) -> None:
    """Lower half of the covariance of data at some cells after an offset, between four corners."""
    n = cells.size
    last = covariances.shape[1] - 1
    # Beyond the ends of the library the covariance is that of its ends, cells apart as they are.
    within = min(max(offset, 0.0), last - cells[n - 1] - _ROUNDING)
    whole = math.floor(within)
    rest = within - whole
    found[:] = 0.0
    for k in range(4):
        if shares[k] <= 0.0:
            continue
        table = covariances[corners[k]]
        low, high = shares[k] * (1.0 - rest), shares[k] * rest
        for i in range(n):
            row = max(whole + cells[i], 0)
            for j in range(i + 1):
                column = max(whole + cells[j], 0)
                found[i, j] += low * table[row, column] + high * table[row + 1, column + 1]


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
    for column in range(count):
        for i in range(factor.shape[0]):
            total = columns[column, i]
            for k in range(i):
                total -= factor[i, k] * columns[column, k]
            columns[column, i] = total / factor[i, i]


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
        gradient[z] = 0.0
        for i in range(n):
            along[z] += columns[1, i] * columns[2 + z, i]
            gradient[z] += columns[0, i] * columns[2 + z, i]
        # What the amplitude would take over is no gain of a nuisance.
        gradient[z] -= along[z] * pull / stiffness
        for y in range(z + 1):
            total = -along[z] * along[y] / stiffness
            for i in range(n):
                total += columns[2 + z, i] * columns[2 + y, i]
            information[z, y] = total
            information[y, z] = total
    numbers[0] = -0.5 * deviation
    numbers[1] = deviation
