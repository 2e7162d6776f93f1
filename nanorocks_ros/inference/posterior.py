"""The restitutions of beads and walls: what is known of both together, and of each.

The decay of the mean speed alone tells one combination of the two: along a valley a higher
restitution of the beads makes up for a lower one of the walls. So the result is a probability
over both, and what is said of one of them depends on what is known of the other: the prior.
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
from nanorocks_ros.numerics.splines import spline_basis

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.decay.decay_likelihood import DecayTables
    from nanorocks_ros.inference.likelihood_1d import SingleTerm

# Points of the fine grid along each restitution.
_FINE, _WALL_FINE = 241, 121
# Less likely places than exp(-this) of the best are not looked at.
_DEPTH = 18.0
# Beyond about so much less, log likelihoods are compressed before they are interpolated: next to
# steep slopes a spline would swing.
_COMPRESSION = 200.0
# Where nothing is lost there is no decay to compare with: that corner of the grid is taken as so
# much less likely than the likelier of its neighbours, lest a spline swing around it.
_CORNER = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Posterior:
    """Probability of pairs of restitutions, on a grid that covers all that are likely.

    Parameters
    ----------
    restitution : ndarray (n_c,)
    wall_restitution : ndarray (n_w,)
    probability : ndarray (n_c, n_w)
        Sums to 1.
    tension : float
        Standard deviations by which what went into it disagrees: decay, rebounds and collisions;
        0 where there was the decay alone.
    """

    restitution: NDArray[np.float64]
    wall_restitution: NDArray[np.float64]
    probability: NDArray[np.float64]
    tension: float = 0.0

    @property
    def mean(self) -> tuple[float, float]:
        """Of both restitutions."""
        return (
            float(self.probability.sum(axis=1) @ self.restitution),
            float(self.probability.sum(axis=0) @ self.wall_restitution),
        )

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Of both restitutions, (2, 2)."""
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

    def quantiles(self, probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of the restitution of the beads, whatever the walls."""
        return _quantiles(self.restitution, self.probability.sum(axis=1), probabilities)

    def wall_quantiles(self, probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of the restitution of the walls, whatever the beads."""
        return _quantiles(self.wall_restitution, self.probability.sum(axis=0), probabilities)


def _quantiles(
    axis: NDArray[np.float64], weight: NDArray[np.float64], probabilities: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Each entry stands for the stretch half way to its neighbours."""
    edges = np.concatenate(([axis[0]], 0.5 * (axis[1:] + axis[:-1]), [axis[-1]]))
    below = np.concatenate(([0.0], np.cumsum(weight)))
    return np.asarray(np.interp(probabilities, below / below[-1], edges))


def check_walls(walls: tuple[float, float]) -> None:
    """Refuse a prior of the walls beyond what a library covers.

    Raises
    ------
    ConfigurationError
    """
    low, high = walls
    if not LOWEST_WALL <= low <= high <= 1.0:
        raise ConfigurationError(
            'prior.min_wall_restitution, prior.max_wall_restitution',
            f'{low:g} to {high:g}',
            f'give a range within {LOWEST_WALL:g} to 1',
        )


def posterior_of(
    tables: DecayTables,
    log_likelihood: NDArray[np.float64],
    walls: tuple[float, float],
    *,
    of_beads: SingleTerm | None = None,
    of_walls: SingleTerm | None = None,
) -> Posterior:
    """The posterior, with even priors.

    Parameters
    ----------
    tables : DecayTables
    log_likelihood : ndarray (n_places,)
        On the grid of the tables.
    walls : tuple of 2 floats
        Lowest and highest restitution that the walls may have, each as likely; equal when it is
        known. That of the beads may be anything from 0 to 1.
    of_beads, of_walls : SingleTerm, optional
        Further log likelihoods, of each of the two by itself.

    Raises
    ------
    ConfigurationError
        For walls outside what the library covers.
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
        if of_beads is not None:
            fine += of_beads.at(beads)[:, np.newaxis]
        if of_walls is not None:
            fine += of_walls.at(wall)
        best = float(fine.max())
        fine -= best
        box = _likely(fine, beads, wall)
    weight = np.exp(fine) * _halves(beads.size)[:, np.newaxis] * _halves(wall.size)
    # By itself each of the terms could be as good as its own best.
    apart = sum(float(term.log_likelihood.max()) for term in (of_beads, of_walls) if term)
    return Posterior(
        restitution=beads,
        wall_restitution=wall,
        probability=weight / weight.sum(),
        tension=math.sqrt(2.0 * max(apart - best, 0.0)) if of_beads or of_walls else 0.0,
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
        """On the grid of some places within the knots, (n_x, n_y)."""
        rows, columns = (
            spline_basis(knots, points) for knots, points in zip(self.knots, (x, y), strict=True)
        )
        return np.asarray(rows @ self.coefficients @ columns.T)


def _without_pits(less: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """How much less likely places are, where along one restitution there is one best of them.

    Where amplitude, scale and restitution make up for each other, noise of the library leaves
    single places without the best of it, around which a spline would swing.
    """
    before = np.minimum.accumulate(less, axis=axis)
    behind = np.flip(np.minimum.accumulate(np.flip(less, axis=axis), axis=axis), axis=axis)
    return np.minimum(less, np.maximum(before, behind))


def _even(restitution: NDArray[np.float64], low: float, power: float) -> NDArray[np.float64]:
    """Where restitutions lie, from 0 for the lowest to 1, in what the grid is even in."""
    return np.asarray(1.0 - ((1.0 - restitution) / (1.0 - low)) ** power)


def _axes(
    low: float, high: float, wall_low: float, wall_high: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    beads = np.linspace(low, high, _FINE)
    if wall_low == wall_high:
        return beads, np.array([wall_low])
    return beads, np.linspace(wall_low, wall_high, _WALL_FINE)


def _halves(n: int) -> NDArray[np.float64]:
    """The first and the last entry of an axis stand for half as much."""
    weights = np.ones(n)
    weights[[0, -1]] = 0.5
    return weights


def _likely(
    fine: NDArray[np.float64], beads: NDArray[np.float64], wall: NDArray[np.float64]
) -> tuple[float, float, float, float]:
    """The box around all places that are not beyond hope, and one more on each side."""
    box = []
    for axis, other in ((beads, 1), (wall, 0)):
        likely = np.flatnonzero(fine.max(axis=other) > -_DEPTH)
        first, last = max(likely[0] - 1, 0), min(likely[-1] + 1, axis.size - 1)
        box += [float(axis[first]), float(axis[last])]
    return box[0], box[1], box[2], box[3]
