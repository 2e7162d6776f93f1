"""Joint posterior of the restitutions of beads and walls.

The decay of the mean speed alone determines one combination of the two: a higher restitution of
the beads compensates a lower one of the walls. So the result is a probability over both, and the
estimate of one depends on the prior of the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.interpolate import RectBivariateSpline

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.inference.decay.decay_library import LOWEST_WALL
from nanorocks_ros.inference.decay.decay_tables import BEAD_POWER, WALL_POWER
from nanorocks_ros.inference.likelihood_1d import Posterior1D
from nanorocks_ros.numerics.splines import spline_basis

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.decay.decay_tables import DecayTables
    from nanorocks_ros.inference.likelihood_1d import Likelihood1D

# Points of the fine grid along each restitution.
_FINE, _WALL_FINE = 241, 121
# Points with a probability below exp(-this) of the maximum are left out.
_DEPTH = 18.0
# Log likelihoods lower than the maximum by more than about this are compressed before the
# interpolation: a spline overshoots next to steep slopes.
_COMPRESSION = 200.0
# The elastic corner of the grid has no decay to compare with. Its log likelihood is set this much
# below its better neighbour, so that the spline does not overshoot.
_CORNER = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Posterior:
    """Probability of pairs of restitutions, on a grid that covers all likely values.

    Parameters
    ----------
    restitution : ndarray (n_c,)
    wall_restitution : ndarray (n_w,)
    probability : ndarray (n_c, n_w)
        Sums to 1.
    tension : float
        Disagreement of decay, rebounds and collisions in standard deviations; 0 with the decay
        alone.
    """

    restitution: NDArray[np.float64]
    wall_restitution: NDArray[np.float64]
    probability: NDArray[np.float64]
    tension: float = 0.0

    @property
    def mean(self) -> tuple[float, float]:
        """Means of both restitutions."""
        return (
            float(self.probability.sum(axis=1) @ self.restitution),
            float(self.probability.sum(axis=0) @ self.wall_restitution),
        )

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of both restitutions, (2, 2)."""
        x = self.restitution - self.mean[0]
        y = self.wall_restitution - self.mean[1]
        p = self.probability
        mixed = float(x @ p @ y)
        return np.array(
            [
                [float(p.sum(axis=1) @ x**2), mixed],
                [mixed, float(p.sum(axis=0) @ y**2)],
            ]
        )

    @property
    def beads(self) -> Posterior1D:
        """Of the beads alone, marginalised over the walls."""
        return Posterior1D(restitution=self.restitution, probability=self.probability.sum(axis=1))

    def quantiles(self, probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
        """Quantiles of the bead restitution, marginalised over the walls."""
        return _quantiles(self.restitution, self.probability.sum(axis=1), probabilities)

    def wall_quantiles(self, probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
        """Quantiles of the wall restitution, marginalised over the beads."""
        return _quantiles(self.wall_restitution, self.probability.sum(axis=0), probabilities)


def _quantiles(
    axis: NDArray[np.float64], weight: NDArray[np.float64], probabilities: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Quantiles of a distribution whose entries extend half way to their neighbours."""
    edges = np.concatenate(([axis[0]], 0.5 * (axis[1:] + axis[:-1]), [axis[-1]]))
    below = np.concatenate(([0.0], np.cumsum(weight)))
    return np.asarray(np.interp(probabilities, below / below[-1], edges))


def check_walls(walls: tuple[float, float]) -> None:
    """Refuse a prior of the wall restitution outside the range of a library.

    Raises
    ------
    ConfigurationError
    """
    low, high = walls
    if not LOWEST_WALL <= low <= high <= 1.0:
        raise ConfigurationError(
            'prior.min_wall_restitution, prior.max_wall_restitution',
            f'{low:g} to {high:g}',
            f'give a range within {LOWEST_WALL:g} to 1, for which decays were simulated',
        )


def posterior_of(
    tables: DecayTables,
    log_likelihood: NDArray[np.float64],
    walls: tuple[float, float],
    *,
    bead_likelihood: Likelihood1D | None = None,
    wall_likelihood: Likelihood1D | None = None,
) -> Posterior:
    """The posterior for flat priors.

    Parameters
    ----------
    tables : DecayTables
    log_likelihood : ndarray (n_places,)
        On the grid of the tables.
    walls : tuple of 2 floats
        Ends of the flat prior of the wall restitution; equal if it is known. The prior of the
        bead restitution is flat from 0 to 1.
    bead_likelihood, wall_likelihood : Likelihood1D, optional
        Further log likelihoods of one restitution alone.

    Raises
    ------
    ConfigurationError
        For a wall prior outside the range of the library.
    """
    check_walls(walls)
    shape = (tables.restitution.size, tables.wall_restitution.size)
    less = (log_likelihood.max() - log_likelihood).reshape(shape)
    less = _without_pits(_without_pits(less, 0), 1)
    less[-1, -1] = min(less[-1, -1], min(less[-2, -1], less[-1, -2]) + _CORNER)
    values = -_COMPRESSION * np.log1p(less / _COMPRESSION)
    surface = _Surface.through(
        _even(tables.restitution, 0.0, BEAD_POWER),
        _even(tables.wall_restitution, LOWEST_WALL, WALL_POWER),
        values,
    )
    box = (0.0, 1.0, *walls)
    for _ in range(3):
        beads, wall = _axes(*box)
        pressed = surface.at(_even(beads, 0.0, BEAD_POWER), _even(wall, LOWEST_WALL, WALL_POWER))
        fine = -_COMPRESSION * np.expm1(-pressed / _COMPRESSION)
        if bead_likelihood is not None:
            fine += bead_likelihood.at(beads)[:, np.newaxis]
        if wall_likelihood is not None:
            fine += wall_likelihood.at(wall)
        best = float(fine.max())
        fine -= best
        box = _likely(fine, beads, wall)
    weight = np.exp(fine) * _halves(beads.size)[:, np.newaxis] * _halves(wall.size)
    # Without the decay each likelihood would reach its own maximum.
    apart = sum(
        float(term.log_likelihood.max()) for term in (bead_likelihood, wall_likelihood) if term
    )
    return Posterior(
        restitution=beads,
        wall_restitution=wall,
        probability=weight / weight.sum(),
        tension=math.sqrt(2.0 * max(apart - best, 0.0))
        if bead_likelihood or wall_likelihood
        else 0.0,
    )


class _Surface(NamedTuple):
    """A bicubic spline through a grid of values: knots, and coefficients of their B-splines."""

    knots: tuple[NDArray[np.float64], NDArray[np.float64]]
    coefficients: NDArray[np.float64]

    @classmethod
    def through(
        cls, x: NDArray[np.float64], y: NDArray[np.float64], values: NDArray[np.float64]
    ) -> _Surface:
        spline = RectBivariateSpline(x, y, values)
        return cls(spline.get_knots(), spline.get_coeffs().reshape(values.shape))

    def at(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values on a grid of points within the knots, (n_x, n_y)."""
        rows, columns = (
            spline_basis(knots, points) for knots, points in zip(self.knots, (x, y), strict=True)
        )
        return np.asarray(rows @ self.coefficients @ columns.T)


def _without_pits(less: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Log likelihood below the maximum, made unimodal along one axis.

    Where amplitude, scale and restitution compensate each other, noise of the library leaves
    isolated pits, around which a spline overshoots.
    """
    before = np.minimum.accumulate(less, axis=axis)
    behind = np.flip(np.minimum.accumulate(np.flip(less, axis=axis), axis=axis), axis=axis)
    return np.minimum(less, np.maximum(before, behind))


def _even(restitution: NDArray[np.float64], low: float, power: float) -> NDArray[np.float64]:
    """Coordinate in which the grid is evenly spaced, 0 at the lowest restitution, 1 at 1."""
    return np.asarray(1.0 - ((1.0 - restitution) / (1.0 - low)) ** power)


def _axes(
    low: float, high: float, wall_low: float, wall_high: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    beads = np.linspace(low, high, _FINE)
    if wall_low == wall_high:
        return beads, np.array([wall_low])
    return beads, np.linspace(wall_low, wall_high, _WALL_FINE)


def _halves(n: int) -> NDArray[np.float64]:
    """Weights of the trapezoidal rule: half at the first and the last entry."""
    weights = np.ones(n)
    weights[[0, -1]] = 0.5
    return weights


def _likely(
    fine: NDArray[np.float64], beads: NDArray[np.float64], wall: NDArray[np.float64]
) -> tuple[float, float, float, float]:
    """Bounding box of all likely points, with one point more on each side."""
    box = []
    for axis, other in ((beads, 1), (wall, 0)):
        likely = np.flatnonzero(fine.max(axis=other) > -_DEPTH)
        first, last = max(likely[0] - 1, 0), min(likely[-1] + 1, axis.size - 1)
        box += [float(axis[first]), float(axis[last])]
    return box[0], box[1], box[2], box[3]
