"""Fit of Haff's law to measured mean speeds, with an interval of the stated probability.

A gas of a few beads does not follow the mean decay: each collision takes a random share of
the energy, which does not come back. Linearising
dv/dt = -v^2 / (v0 tau) about its solution, a deviation of ln v dies out as 1 / (1 + t/tau)
while collisions keep adding to it at a constant rate per unit of s = ln(1 + t/tau): an
Ornstein-Uhlenbeck process in s, that starts from zero because v0 is free,

    cov[s, s'] = q/2 (exp(-|s - s'|) - exp(-(s + s'))).

Beside it the mean speed fluctuates quickly, at constant energy, as the collisions reshuffle
the speeds. The strength q, the variance of the quick part, and a scale of the errors given are
estimated with v0 and tau by restricted maximum likelihood, under a prior on the first two that
holds for simulated gases: both go as one over the number of beads. Taking the residuals for
independent would make the interval several times too narrow.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import optimize

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.decay.haff_likelihood import Decay
from nanorocks_ros.physics.haff_law import haff_speed

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Number of groups of speeds: more cost time and add no information.
_POINTS = 40
# Longest Haff time, in windows: beyond it a decay cannot be distinguished from none.
_LONGEST_HAFF_TIME = 30.0
_FEWEST_DEGREES = 3.0
_LOG_HAFF_TIME = (math.log(1e-3), math.log(1e5))
# Prior means of q and of the quick part, times the number of beads: from simulated gases in trays
# 1, 3 and 5 at restitutions from 0.6 to 0.95; see `haff_likelihood` for their spread.
USUAL_TIMES_BEADS = np.array([0.4, 0.1])
# Correlation range of the quick part in ln(1 + t/tau); `haff_likelihood` uses the power 10.
QUICK_RANGE = 0.1
_LOG_NOISE = (math.log(1e-12), math.log(10.0))
# The stated errors are known up to a common factor.
_LOG_SCALE = (math.log(0.05), math.log(20.0))

# Two standard deviations of the logarithms of q and of the quick part: beyond them the noise is
# not that of a gas. Then fits start from these changes of both logarithms, and from Haff times of
# these multiples of the window.
_UNUSUAL = np.array([1.0, 2.0])
_KINDS_OF_NOISE = np.array([[0.0, 0.0], [0.0, 5.0], [4.0, 0.0]])
_SPREAD_OF_TIMES = np.array([5e-4, 0.01, 0.1, 0.3, 1.0, 3.0, 10.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class HaffFit:
    """Parameters of Haff's law and their errors.

    Parameters
    ----------
    initial_speed, initial_speed_error : float, [m/s]
    haff_time, haff_time_error : float, [s]
    decay_rate : float, [1/m]
        1 / (v0 tau), from which the restitution follows.
    log_decay_rate_error : float
        One standard error of the logarithm of `decay_rate`.
    degrees_of_freedom : float
        Of the Student distribution of this error.
    reduced_chi_square : float
        With the errors of the speeds alone; above 1 where the gas itself fluctuates.
    samples : int
    """

    initial_speed: float
    initial_speed_error: float
    haff_time: float
    haff_time_error: float
    decay_rate: float
    log_decay_rate_error: float
    degrees_of_freedom: float
    reduced_chi_square: float
    samples: int


def fit_haff(
    time: NDArray[np.float64],
    speed: NDArray[np.float64],
    error: NDArray[np.float64],
    beads: int,
) -> HaffFit:
    """Fit v0 / (1 + t/tau) to mean speeds.

    Parameters
    ----------
    time : ndarray (n,), [s]
        Since the start of the cooling, in order.
    speed, error : ndarray (n,), [m/s], > 0
        Mean speeds and one standard error of each.
    beads : int, > 0
        Number of beads, which determines the fluctuations of the gas.

    Returns
    -------
    HaffFit

    Raises
    ------
    FitError
        With fewer than 4 speeds, values that are not positive and finite, or speeds that
        do not fall.

    References
    ----------
    Haff 1983; covariance derived above.
    """
    _check(time, speed, error)
    data = _binned(time, speed, error, beads)
    best = _best(data, _start(time, speed))
    tau = math.exp(best[0])
    if tau > _LONGEST_HAFF_TIME * time[-1]:
        raise FitError('haff fit', 'the speeds do not fall', 'give a window in which they do')
    _, log_v0, information = data.generalised(best)
    covariance = np.linalg.inv(information)
    v0 = math.exp(log_v0)
    residuals = (speed - haff_speed(time, v0, tau)) / error
    return HaffFit(
        initial_speed=v0,
        initial_speed_error=v0 * math.sqrt(covariance[0, 0]),
        haff_time=tau,
        haff_time_error=tau * math.sqrt(covariance[1, 1]),
        decay_rate=1.0 / (v0 * tau),
        log_decay_rate_error=math.sqrt(data.rate_variance(best)),
        degrees_of_freedom=_degrees_of_freedom(data, best),
        reduced_chi_square=float(residuals @ residuals) / (residuals.size - 2),
        samples=int(time.size),
    )


def _best(data: Decay, start: float) -> NDArray[np.float64]:
    """Parameters of the lowest cost, from an initial Haff time, [s].

    If the speeds follow Haff's law, one minimisation is enough. If not, the noise takes up the
    deviation: then several kinds of noise are tried, each with its own Haff time.
    """
    first = _lowest(data, np.array([math.log(start), *data.usual, 0.0]))
    unusual = np.abs(first.x[1:3] - data.usual) > _UNUSUAL
    if not unusual.any() and first.x[0] > _LOG_HAFF_TIME[0]:
        return np.asarray(first.x)
    fits = [first]
    taus = np.log(_SPREAD_OF_TIMES * data.time[-1])
    for noise in _KINDS_OF_NOISE:
        starts = [np.array([log_tau, *(data.usual + noise), 0.0]) for log_tau in taus]
        fits.append(_lowest(data, min(starts, key=data.cost)))
    return np.asarray(min(fits, key=lambda log_tau: float(log_tau.fun)).x)


def _lowest(data: Decay, start: NDArray[np.float64]) -> optimize.OptimizeResult:
    return optimize.minimize(
        data.cost_and_slope,
        start,
        method='L-BFGS-B',
        jac=True,
        # Low enough that speeds rounded to float32 give the same fit to 1e-6.
        options={'ftol': 1e-15, 'gtol': 1e-9},
        bounds=(_LOG_HAFF_TIME, _LOG_NOISE, _LOG_NOISE, _LOG_SCALE),
    )


def _degrees_of_freedom(data: Decay, best: NDArray[np.float64]) -> float:
    """Degrees of freedom of the variance of the decay rate, after Satterthwaite.

    The noise is estimated from one decay, so that a Gaussian interval would be too narrow;
    Student's distribution with 2 / var(ln variance) degrees of freedom takes its place.
    """
    shifts = 0.2 * np.eye(best.size)[1:]
    centre = data.cost(best)
    up = np.array([data.cost(best + shift) for shift in shifts])
    down = np.array([data.cost(best - shift) for shift in shifts])
    hessian = np.diag(up - 2.0 * centre + down)
    for i, j in itertools.combinations(range(len(shifts)), 2):
        mixed = data.cost(best + shifts[i] + shifts[j]) - up[i] - up[j] + centre
        hessian[i, j] = hessian[j, i] = mixed
    slope = np.array(
        [
            0.5 * math.log(data.rate_variance(best + shift) / data.rate_variance(best - shift))
            for shift in shifts
        ]
    )
    # The cost is -2 ln L, so its curvature is twice the information on the logarithms (in
    # steps of the shifts); a direction in which it is flat is noise that does not matter.
    values, vectors = np.linalg.eigh(0.5 * hessian)
    projected = (vectors.T @ slope) ** 2
    variance = float((projected / np.maximum(values, 0.01)).sum())
    return float(np.clip(2.0 / max(variance, 1e-6), _FEWEST_DEGREES, 1e6))


def _check(
    time: NDArray[np.float64], speed: NDArray[np.float64], error: NDArray[np.float64]
) -> None:
    if time.size < 4 or not time.size == speed.size == error.size:
        raise FitError(
            'haff fit',
            f'{time.size} times, {speed.size} speeds, {error.size} errors',
            'give at least 4 of each',
        )
    for name, values in (('time', time + 1.0), ('speed', speed), ('error', error)):
        if not (np.isfinite(values).all() and (values > 0.0).all()):
            raise FitError('haff fit', f'a {name} is not positive and finite', 'leave it out')
    if np.polyfit(time, np.log(speed), 1)[0] >= 0.0:
        raise FitError('haff fit', 'the speeds do not fall', 'give a window in which they do')


def _binned(
    time: NDArray[np.float64],
    speed: NDArray[np.float64],
    error: NDArray[np.float64],
    beads: int,
) -> Decay:
    group = max(1, math.ceil(time.size / _POINTS))
    starts = np.arange(0, time.size, group)
    counts = np.diff(np.append(starts, time.size))
    ends = starts + counts - 1
    return Decay(
        time=time,
        usual=np.log(USUAL_TIMES_BEADS / beads),
        inner_distance=(time[ends] - time[starts]) * (counts + 1) / (3.0 * counts),
        starts=starts,
        counts=counts,
        log_speed=np.add.reduceat(np.log(speed), starts) / counts,
        variance=np.add.reduceat((error / speed) ** 2, starts) / counts**2,
    )


def _start(time: NDArray[np.float64], speed: NDArray[np.float64]) -> float:
    """Haff time from a straight line through 1/v."""
    slope, offset = np.polyfit(time, 1.0 / speed, 1)
    if slope <= 0.0 or offset <= 0.0:
        return float(time[-1])
    return float(np.clip(offset / slope, 1e-2 * time[-1], 10.0 * time[-1]))
