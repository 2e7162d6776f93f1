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
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.inference.decay.likelihood_kernels import ROUNDING, evaluate
from nanorocks_ros.numerics.log_sums import log_sum
from nanorocks_ros.numerics.small_cholesky import integrate
from nanorocks_ros.records import Measured

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.decay.decay_library import DecayLibrary
    from nanorocks_ros.inference.decay.friction_weights import FrictionWeights

# Smallest relative error of a speed.
_LEAST_ERROR = 2e-3
# Step through the grid in the search for the approximate maximum.
_EVERY = 4
# A scale with a larger error is not linear: it is sampled at these multiples of its standard
# deviation, and linear within half of one around each.
_WIDE = 0.1
_SCALES = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
# Nuisances of the camera, beside those of the library: scale of lengths, and a relative error of
# the speeds that grows with their logarithm. The error of the drag is one more.
CAMERA_NUISANCES = ('scale', 'speed_bias')
_NO_DRAG = Measured(0.0, 0.0)


class _Unknowns(NamedTuple):
    """Standard deviations of the `CAMERA_NUISANCES`; drag and its error, [1/s]."""

    scale: float
    speed_bias: float
    drag: float
    drag_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RoughTables:
    """A library of beads that rub on the same grid.

    Parameters
    ----------
    friction : float
        Of floor, lid and side walls.
    mean
        As of `DecayTables`.
    bead_slope : ndarray (n_c * n_w, n_x)
        Change of ln f for one standard deviation of one more nuisance, the friction of the beads.
        Those of the others are those of smooth beads, and kept once.
    """

    friction: float
    mean: NDArray[np.float64]
    bead_slope: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class DecayTables:
    """The library on a grid of restitutions.

    Parameters
    ----------
    decays : DecayLibrary
    restitution : ndarray (n_c,)
    wall_restitution : ndarray (n_w,)
    mean : ndarray (n_c * n_w, n_x)
        Of ln f, over the priors of the nuisances.
    slopes : ndarray (n_c * n_w, n_z, n_x)
        Change of ln f for one standard deviation of each nuisance; without those of the camera.
    corners : ndarray of int64, (n_c * n_w, 4)
        Corners around each point, in the grid of the covariances.
    shares : ndarray (n_c * n_w, 4)
        Their weights.
    start : tuple of 2 floats
        Prior of the logarithm of the mean projected speed at the start, [m/s]: mean and standard
        deviation.
    rough : tuple of RoughTables
        With rising friction; empty if the library knows smooth beads alone.
    """

    decays: DecayLibrary
    restitution: NDArray[np.float64]
    wall_restitution: NDArray[np.float64]
    mean: NDArray[np.float64]
    slopes: NDArray[np.float64]
    corners: NDArray[np.int64]
    shares: NDArray[np.float64]
    start: tuple[float, float]
    rough: tuple[RoughTables, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class DecayLikelihood:
    """Likelihood of decays on the grid; those of several decays add up.

    If the error of the scale is large, every array has one more axis in front: one likelihood for
    each sampled scale.

    Parameters
    ----------
    log_likelihood : ndarray (n_places,)
        At the expected nuisances and the best amplitude, with the prior of that.
    start : ndarray (n_places,)
        What the integral over the amplitude adds to it.
    gradient : ndarray (n_places, n_z)
        Its derivative by the nuisances, in units of their standard deviations.
    information : ndarray (n_places, n_z, n_z)
        Minus its second derivative.
    deviation : ndarray (n_places,)
        Sum of the squares of the whitened residuals.
    samples : int
        Number of bins, whatever the number of speeds in each.
    decays : int
        Number of decays.
    rough : tuple of (float, DecayLikelihood)
        The same with rising frictions.
    """

    log_likelihood: NDArray[np.float64]
    start: NDArray[np.float64]
    gradient: NDArray[np.float64]
    information: NDArray[np.float64]
    deviation: NDArray[np.float64]
    samples: int
    decays: int
    rough: tuple[tuple[float, DecayLikelihood], ...] = ()

    def __add__(self, other: DecayLikelihood) -> DecayLikelihood:
        return DecayLikelihood(
            log_likelihood=self.log_likelihood + other.log_likelihood,
            start=self.start + other.start,
            gradient=self.gradient + other.gradient,
            information=self.information + other.information,
            deviation=self.deviation + other.deviation,
            samples=self.samples + other.samples,
            decays=self.decays + other.decays,
            rough=tuple(
                (friction, own + others)
                for (friction, own), (_, others) in zip(self.rough, other.rough, strict=True)
            ),
        )

    def emptied(self) -> DecayLikelihood:
        """A likelihood of the same shape that says nothing."""
        return DecayLikelihood(
            log_likelihood=np.zeros_like(self.log_likelihood),
            start=np.zeros_like(self.start),
            gradient=np.zeros_like(self.gradient),
            information=np.zeros_like(self.information),
            deviation=np.zeros_like(self.deviation),
            samples=0,
            decays=0,
            rough=tuple((friction, likelihood.emptied()) for friction, likelihood in self.rough),
        )

    def integrated(self, friction: FrictionWeights | None = None) -> NDArray[np.float64]:
        """Log likelihood (n_places,), start and nuisances integrated over their Gaussian priors.

        Parameters
        ----------
        friction : FrictionWeights, optional
            Probability of frictions; smooth beads if not given, or not in the library.
        """
        smooth = self._integrated()
        if friction is None or not self.rough:
            return smooth
        nodes = np.array([0.0, *(value for value, _ in self.rough)])
        logs = np.stack([smooth, *(likelihood._integrated() for _, likelihood in self.rough)])
        return friction.mixed(nodes, logs)

    def _integrated(self) -> NDArray[np.float64]:
        log_likelihood = np.empty(self.log_likelihood.shape)
        n_z = self.gradient.shape[-1]
        integrate(
            np.ascontiguousarray(self.gradient).reshape(-1, n_z),
            np.ascontiguousarray(self.information).reshape(-1, n_z, n_z),
            log_likelihood.reshape(-1),
        )
        # Cycles start alike: a sum over many would favour restitutions that forget their starts.
        log_likelihood += self.log_likelihood + self.start / max(self.decays, 1)
        if log_likelihood.ndim == 1:
            return np.asarray(log_likelihood)
        weight = np.exp(-0.5 * _SCALES**2)
        return np.asarray(log_sum(log_likelihood, weight / weight.sum()))

    def deviation_at(self, place: int) -> float:
        """Sum of the squares of the whitened residuals at a point, for the likeliest nuisances.

        At the expected nuisances it would be large where these are known badly: those of grains
        are, by a tenth and more of their speed.
        """
        n_places, n_z = self.gradient.shape[-2:]
        gradient = self.gradient.reshape(-1, n_places, n_z)[:, place]
        information = self.information.reshape(-1, n_places, n_z, n_z)[:, place]
        likeliest = np.linalg.solve(np.eye(n_z) + information, gradient[..., None])[..., 0]
        gain = np.einsum('sz,sz->s', gradient, likeliest)
        curved = np.einsum('sz,szy,sy->s', likeliest, information, likeliest)
        scale = (np.atleast_2d(self.log_likelihood)[:, place] + 0.5 * gain).argmax()
        deviation = np.atleast_2d(self.deviation)[:, place] - 2.0 * gain + curved
        return max(float(deviation[scale]), 0.0)


def decay_likelihood(
    tables: DecayTables,
    time: NDArray[np.float64],
    speed: NDArray[np.float64],
    error: NDArray[np.float64],
    camera: tuple[float, float],
    drag: Measured = _NO_DRAG,
    highest_friction: float = math.inf,
) -> DecayLikelihood:
    """The likelihood of one decay over the grid.

    In a gas that slows beads, v(t) = exp(-drag t) w(s) with s = (1 - exp(-drag t)) / drag, where
    w is the decay in a vacuum: both are compared in the clock s.

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
    drag : Measured, optional, [1/s]
        Of the gas on the beads, with its error.
    highest_friction : float
        Decays are compared at frictions up to the next one above it, which saves time; at 0 as
        those of smooth beads alone.
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
    unknowns = _Unknowns(*camera, drag.value, drag.error)
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
        for step in _SCALES
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
    n_z = tables.slopes.shape[1] + len(CAMERA_NUISANCES) + 1
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
