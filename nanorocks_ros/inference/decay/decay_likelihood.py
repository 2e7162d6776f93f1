"""Likelihood of a measured decay for every pair of restitutions on a grid.

A decay is a series of ln v with errors. Against the mean ln f of the library, the deviations of
the gas from its mean have the library's covariance, and the errors of the speeds add to it. The
amplitude a in v(t) = a f(a t), which holds exactly, has a prior, which is widened where the first
speeds are far off it; the best a is computed at each point of the grid by Newton's method, and the
integral over ln a is that of a Gaussian around it: a gas that loses much energy soon loses the
memory of its initial speed, so that a larger share of its initial speeds agrees with a decay. With
a prior around the first speed measured, and without the integral, restitutions of beads read 0.03
high. Cycles start alike, so that the width of the starts that agree counts once for many.

The nuisances of tray and camera stay free: the result holds the dependence of the likelihood on
them to second order, so that many decays of one tray can be added before the integration over the
nuisances, which, unlike noise, do not average out.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.inference.decay.decay_library import NUISANCES
from nanorocks_ros.inference.decay.grid_likelihood import SCALES, DecayLikelihood
from nanorocks_ros.inference.decay.likelihood_kernels import ROUNDING, evaluate
from nanorocks_ros.records import Measured

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.decay.decay_tables import DecayTables

# Smallest relative error of a speed.
_LEAST_ERROR = 2e-3
# Step through the grid in the search for the approximate maximum.
_EVERY = 4
# A scale with a larger error is not linear: it is sampled at `SCALES`.
_WIDE = 0.1
# Nuisances of the camera, beside those of the library: scale of lengths, and a relative error of
# the speeds that grows with their logarithm. The errors of the drag and of the start are two more.
CAMERA_NUISANCES = ('scale', 'speed_bias')
_NO_DRAG = Measured(0.0, 0.0)
NUISANCE_COUNT = 1 + len(NUISANCES) + len(CAMERA_NUISANCES) + 2
"""Nuisances of smooth beads: floor and lid, those of library and camera, drag and start."""


class _Unknowns(NamedTuple):
    """Deviations of the `CAMERA_NUISANCES`; drag and its error, [1/s]; that of the start, [s]."""

    scale: float
    speed_bias: float
    drag: float
    drag_error: float
    start_error: float


def decay_likelihood(
    tables: DecayTables,
    time: NDArray[np.float64],
    speed: NDArray[np.float64],
    error: NDArray[np.float64],
    camera: tuple[float, float],
    drag: Measured = _NO_DRAG,
    highest_friction: float = math.inf,
    start_error: float = 0.0,
) -> DecayLikelihood:
    """The likelihood of one decay over the grid.

    In a gas that slows beads, v(t) = exp(-drag t) w(s) with s = (1 - exp(-drag t)) / drag, where
    w is the decay in a vacuum: both are compared in the clock s.

    Parameters
    ----------
    tables : DecayTables
    time : ndarray (n,), [s], > 0
        Since the gas began to cool; rising. Times beyond the range of the library, counted from
        the first, are left out.
    speed, error : ndarray (n,), [m/s], > 0
        Mean projected speeds and one standard error of each.
    camera : tuple of 2 floats
        Standard deviations of the `CAMERA_NUISANCES`, relative.
    drag : Measured, optional, [1/s]
        Of the gas on the beads, with its error.
    highest_friction : float
        Decays are compared at frictions up to the next one above it, which saves time; at 0 as
        those of smooth beads alone.
    start_error : float, [s]
        Standard error of the moment from which the times count.
    """
    library = tables.decays
    time, speed, error = undragged(time, speed, error, drag.value)
    within = time < time[0] * math.exp((library.distances.size - 2) * library.step)
    cells, log_time, log_speed, variance = _binned(
        library.step, time[within], speed[within], error[within]
    )
    data = (log_time, log_speed, variance)
    # First with the covariance of each point, then at all points with that of the best one: the
    # strength of the fluctuations is known too roughly to determine restitutions.
    subset = slice(None, None, _EVERY)
    corners, shares = tables.corners[subset], tables.shares[subset]
    unknowns = _Unknowns(*camera, drag.value, drag.error, start_error)
    first = _over(tables, data, cells, unknowns, (subset, corners, shares), derivatives=False)
    best = int(np.argmax(first.log_likelihood)) * _EVERY
    all_places = slice(None), tables.corners[best, np.newaxis], tables.shares[best, np.newaxis]
    smooth = _scaled(tables, data, cells, unknowns, all_places)
    rough = []
    below = sum(rubbing.friction < highest_friction for rubbing in tables.rough)
    for rubbing in tables.rough[: below + 1] if highest_friction > 0.0 else ():
        slopes = np.concatenate((tables.slopes, rubbing.bead_slope[:, np.newaxis]), axis=1)
        own = replace(tables, mean=rubbing.mean, slopes=slopes)
        # The misfit with friction acts as an error of the scale, as that without.
        scale = math.hypot(unknowns.scale, library.friction_misfit * rubbing.friction)
        likelihood = _scaled(own, data, cells, unknowns._replace(scale=scale), all_places)
        rough.append((rubbing.friction, likelihood))
    return replace(smooth, rough=tuple(rough))


def _scaled(
    tables: DecayTables,
    data: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    cells: NDArray[np.int64],
    unknowns: _Unknowns,
    places: tuple[slice, NDArray[np.int64], NDArray[np.float64]],
) -> DecayLikelihood:
    """Likelihood at all points, for several scales if the error of the scale is large."""
    log_time, log_speed, variance = data
    if unknowns.scale <= _WIDE:
        return _over(tables, data, cells, unknowns, places)
    likelihoods = [
        _over(
            tables,
            (log_time, log_speed - step * unknowns.scale, variance),
            cells,
            unknowns._replace(scale=0.5 * unknowns.scale),
            places,
        )
        for step in SCALES
    ]

    def stacked(name: str) -> NDArray[np.float64]:
        return np.stack([getattr(likelihood, name) for likelihood in likelihoods])

    return DecayLikelihood(
        log_likelihood=stacked('log_likelihood'),
        start=stacked('start'),
        gradient=stacked('gradient'),
        information=stacked('information'),
        deviation=stacked('deviation'),
        samples=cells.size,
        decays=1,
    )


def undragged(
    time: NDArray[np.float64],
    speed: NDArray[np.float64],
    error: NDArray[np.float64],
    drag: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Times, speeds and errors in the clock of the gas without drag; the speeds of time 0 stay."""
    if drag == 0.0:
        return time, speed, error
    growth = np.exp(drag * time)
    return -np.expm1(-drag * time) / drag, growth * speed, growth * error


def _over(
    tables: DecayTables,
    data: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    cells: NDArray[np.int64],
    unknowns: _Unknowns,
    places: tuple[slice, NDArray[np.int64], NDArray[np.float64]],
    *,
    derivatives: bool = True,
) -> DecayLikelihood:
    """Likelihood at some points, with covariances interpolated between given corners."""
    library = tables.decays
    subset, corners, shares = places
    mean = tables.mean[subset]
    n_z = tables.slopes.shape[1] + len(CAMERA_NUISANCES) + 2
    numbers = np.empty((len(mean), 3))
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
        np.array(unknowns),
        tables.start,
        (math.log(library.distances[0]), library.step),
        (numbers, gradient, information),
    )
    return DecayLikelihood(
        log_likelihood=numbers[:, 0],
        start=numbers[:, 2],
        gradient=gradient,
        information=information,
        deviation=numbers[:, 1],
        samples=cells.size,
        decays=1,
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
