"""Likelihood of a measured decay for every pair of restitutions on a grid.

A decay is a series of ln v with errors. Against the mean ln f of the library, the deviations of
the gas from its mean have the library's covariance, and the errors of the speeds add to it. The
amplitude is free: v(t) = a f(a t) holds exactly, and the best a is computed at each point of the
grid by Newton's method (a profile likelihood: integrating over ln a would favour low
restitutions, at which a gas soon loses the memory of its initial speed). The nuisances of tray
and camera stay free: the result holds the dependence of the likelihood on them to second order,
so that many decays of one tray can be added before the integration over the nuisances, which,
unlike noise, do not average out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.decay.likelihood_kernels import ROUNDING, evaluate
from nanorocks_ros.numerics.log_sums import log_sum
from nanorocks_ros.numerics.small_cholesky import integrate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.decay.decay_library import DecayLibrary

# Smallest relative error of a speed.
_LEAST_ERROR = 2e-3
# Step through the grid in the search for the approximate maximum.
_EVERY = 4
# A scale with a larger error is not linear: it is sampled at these multiples of its standard
# deviation, and linear within half of one around each.
_WIDE = 0.1
_SCALES = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
# Nuisances of the camera, beside those of the library: scale of lengths, and a relative error of
# the speeds that grows with their logarithm.
CAMERA_NUISANCES = ('scale', 'speed_bias')


@dataclass(frozen=True, slots=True, kw_only=True)
class DecayTables:
    """The library on a grid of restitutions.

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
        Corners around each point, in the grid of the covariances.
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
    """Likelihood of decays on the grid; those of several decays add up.

    If the error of the scale is large, every array has one more axis in front: one likelihood for
    each sampled scale.

    Parameters
    ----------
    log_likelihood : ndarray (n_places,)
        At the expected nuisances.
    gradient : ndarray (n_places, n_z)
        Its derivative by the nuisances, in units of their standard deviations.
    information : ndarray (n_places, n_z, n_z)
        Minus its second derivative.
    deviation : ndarray (n_places,)
        Sum of the squares of the whitened residuals.
    samples : int
        Number of bins, whatever the number of speeds in each.
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
        log_likelihood = np.empty(self.log_likelihood.shape)
        n_z = self.gradient.shape[-1]
        integrate(
            np.ascontiguousarray(self.gradient).reshape(-1, n_z),
            np.ascontiguousarray(self.information).reshape(-1, n_z, n_z),
            log_likelihood.reshape(-1),
        )
        log_likelihood += self.log_likelihood
        if log_likelihood.ndim == 1:
            return np.asarray(log_likelihood)
        weight = np.exp(-0.5 * _SCALES**2)
        return np.asarray(log_sum(log_likelihood, weight / weight.sum()))

    def deviation_at(self, place: int) -> float:
        """Sum of the squares of the whitened residuals at a point, for the likeliest scale."""
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
        Since the shaking event; rising. Times beyond the range of the library, counted from the
        first, are left out.
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
    # First with the covariance of each point, then at all points with that of the best one: the
    # strength of the fluctuations is known too roughly to determine restitutions.
    subset = slice(None, None, _EVERY)
    corners, shares = tables.corners[subset], tables.shares[subset]
    rough = _over(tables, data, cells, camera, (subset, corners, shares), derivatives=False)
    best = int(np.argmax(rough.log_likelihood)) * _EVERY
    all_places = slice(None), tables.corners[best, np.newaxis], tables.shares[best, np.newaxis]
    scale, bias = camera
    if scale <= _WIDE:
        return _over(tables, data, cells, camera, all_places)
    likelihoods = [
        _over(
            tables,
            (log_time, log_speed - step * scale, variance),
            cells,
            (0.5 * scale, bias),
            all_places,
        )
        for step in _SCALES
    ]
    return DecayLikelihood(
        **{
            name: np.stack([getattr(likelihood, name) for likelihood in likelihoods])
            for name in ('log_likelihood', 'gradient', 'information', 'deviation')
        },
        samples=cells.size,
    )


def _over(
    tables: DecayTables,
    data: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    cells: NDArray[np.int64],
    camera: tuple[float, float],
    places: tuple[slice, NDArray[np.int64], NDArray[np.float64]],
    *,
    derivatives: bool = True,
) -> DecayLikelihood:
    """Likelihood at some points, with covariances interpolated between given corners."""
    library = tables.decays
    subset, corners, shares = places
    mean = tables.mean[subset]
    n_z = tables.slopes.shape[1] + len(CAMERA_NUISANCES)
    numbers = np.empty((len(mean), 2))
    gradient = np.empty((len(mean) if derivatives else 0, n_z))
    information = np.empty((len(gradient), n_z, n_z))
    evaluate(
        data,
        cells,
        library.covariance.reshape(-1, *library.covariance.shape[2:]),
        np.ascontiguousarray(corners),
        np.ascontiguousarray(shares),
        np.ascontiguousarray(mean),
        np.ascontiguousarray(tables.slopes[subset]),
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
    """Index, ln t, ln v and its variance of bins as wide as the step of the library."""
    bins = np.floor(np.log(time / time[0]) / step + ROUNDING).astype(np.int64)
    starts = np.flatnonzero(np.diff(bins, prepend=-1))
    counts = np.diff(np.append(starts, time.size))
    relative = np.maximum(error / speed, _LEAST_ERROR)
    log_time = np.add.reduceat(np.log(time), starts) / counts
    log_speed = np.add.reduceat(np.log(speed), starts) / counts
    variance = np.add.reduceat(relative**2, starts) / counts**2
    # One speed per bin: two in a bin would have a singular covariance.
    return bins[starts], log_time, log_speed, variance
