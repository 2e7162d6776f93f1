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
# Terms of a sum below exp(-this) of the largest are left out: all of them together do not change
# the last digit.
_LOST = 45.0


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
