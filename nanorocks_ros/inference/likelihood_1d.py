"""Log likelihood of one restitution alone, on a grid, from rebounds or collisions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.splines import spline_at, spline_slopes

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Smallest number of points at which a likelihood is evaluated for a convolution.
_SMEARED = 1000
# Points of a posterior, and the depth below the maximum at which a second grid ends.
_FINE, _DEPTH = 2001, 18.0
# Terms of a sum below exp(-this) of the largest are left out: all of them together do not change
# the last digit.
_LOST = 45.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Posterior1D:
    """Probability of one restitution, on an even grid.

    Parameters
    ----------
    restitution : ndarray (n,)
    probability : ndarray (n,)
        Sums to 1.
    """

    restitution: NDArray[np.float64]
    probability: NDArray[np.float64]

    @property
    def mean(self) -> float:
        """Mean."""
        return float(self.probability @ self.restitution)

    @property
    def deviation(self) -> float:
        """Standard deviation."""
        return math.sqrt(float(self.probability @ (self.restitution - self.mean) ** 2))

    def quantiles(self, probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
        """Quantiles, each entry extending half way to its neighbours."""
        axis = self.restitution
        edges = np.concatenate(([axis[0]], 0.5 * (axis[1:] + axis[:-1]), [axis[-1]]))
        below = np.concatenate(([0.0], np.cumsum(self.probability)))
        return np.asarray(np.interp(probabilities, below / below[-1], edges))

    def mixed_with(self, other: Posterior1D, weight: float) -> Posterior1D:
        """The posterior where another one holds with some probability, the weight."""
        low = min(self.restitution[0], other.restitution[0])
        high = max(self.restitution[-1], other.restitution[-1])
        edges = np.linspace(low, high, _FINE + 1)
        below = (1.0 - weight) * self._below(edges) + weight * other._below(edges)
        return Posterior1D(
            restitution=0.5 * (edges[1:] + edges[:-1]), probability=np.diff(below) / below[-1]
        )

    def weighted(self, mean: float, deviation: float) -> Posterior1D:
        """The posterior where something else tells the restitution with a Gaussian error."""
        weight = np.exp(-0.5 * ((self.restitution - mean) / deviation) ** 2) * self.probability
        if not weight.sum() > 0.0:
            return self
        return Posterior1D(restitution=self.restitution, probability=weight / weight.sum())

    def _below(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Probability below some places, (n,); each entry extends half way to its neighbours."""
        axis = self.restitution
        edges = np.concatenate(([axis[0]], 0.5 * (axis[1:] + axis[:-1]), [axis[-1]]))
        below = np.concatenate(([0.0], np.cumsum(self.probability)))
        return np.asarray(np.interp(places, edges, below / below[-1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Likelihood1D:
    """Log likelihood of one of the two restitutions, from rebounds or collisions.

    Parameters
    ----------
    restitution : ndarray (n,)
        Rising, over the whole range, and dense enough for a cubic spline; 4 or more.
    log_likelihood : ndarray (n,)
    """

    restitution: NDArray[np.float64]
    log_likelihood: NDArray[np.float64]

    def at(self, restitution: NDArray[np.float64]) -> NDArray[np.float64]:
        """The log likelihood at other rising restitutions, (n,)."""
        slopes = spline_slopes(self.restitution, self.log_likelihood)
        return spline_at(self.restitution, self.log_likelihood, slopes, restitution)

    def shifted(self, offset: float) -> Likelihood1D:
        """The likelihood where all measurements read too low by an offset, which may be 0."""
        if offset == 0.0:
            return self
        first, last = self.restitution[[0, -1]]
        places = np.clip(self.restitution - offset, first, last)
        return Likelihood1D(restitution=self.restitution, log_likelihood=self.at(places))

    def posterior(self, prior: tuple[float, float]) -> Posterior1D:
        """The posterior for a flat prior.

        Parameters
        ----------
        prior : tuple of 2 floats
            Its ends, within the range of the likelihood; equal if the restitution is known.
        """
        low, high = prior
        if low == high:
            return Posterior1D(restitution=np.array([low]), probability=np.ones(1))
        for _ in range(2):
            fine = np.linspace(low, high, _FINE)
            less = self.at(fine)
            less -= less.max()
            likely = np.flatnonzero(less > -_DEPTH)
            low = float(fine[max(likely[0] - 1, 0)])
            high = float(fine[min(likely[-1] + 1, fine.size - 1)])
        weight = np.exp(less)
        weight[[0, -1]] *= 0.5
        return Posterior1D(restitution=fine, probability=weight / weight.sum())

    def convolved(self, spread: float) -> Likelihood1D:
        """Convolution with a Gaussian: the likelihood with a common systematic error."""
        if spread == 0.0:
            return self
        first, last = self.restitution[[0, -1]]
        step = min(0.25 * spread, float(last - first) / _SMEARED)
        fine = np.arange(first, last + step, step)
        smeared = _smeared(fine, self.at(fine), self.restitution, spread)
        return Likelihood1D(restitution=self.restitution, log_likelihood=smeared)


@compiled
def _smeared(
    fine: NDArray[np.float64],
    logs: NDArray[np.float64],
    nodes: NDArray[np.float64],
    spread: float,
) -> NDArray[np.float64]:
    """Logarithm of the convolution of exp(logs) on an even grid with a Gaussian, at each node."""
    smeared = np.empty(nodes.size)
    part = np.empty(fine.size)
    max_log = logs.max()
    step = fine[1] - fine[0]
    for i in range(nodes.size):
        near = min(max(int((nodes[i] - fine[0]) / step + 0.5), 0), fine.size - 1)
        lower_log = logs[near] - 0.5 * ((fine[near] - nodes[i]) / spread) ** 2
        # Farther away the Gaussian makes even the maximum negligible.
        reach = int(spread * math.sqrt(2.0 * (max_log - lower_log + _LOST)) / step) + 2
        start, end = max(near - reach, 0), min(near + reach + 1, fine.size)
        best = lower_log
        for k in range(start, end):
            part[k] = logs[k] - 0.5 * ((fine[k] - nodes[i]) / spread) ** 2
            best = max(best, part[k])
        total = 0.0
        for k in range(start, end):
            if part[k] > best - _LOST:
                total += math.exp(part[k] - best)
        smeared[i] = best + math.log(total)
    return smeared
