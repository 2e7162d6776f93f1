"""What something else than the decay says of one of the two restitutions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.splines import spline_at, spline_slopes

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Places, at least, at which a term is evaluated to be smeared.
_SMEARED = 1000
# Parts of a sum that are less than the largest by exp(-this) are left out: not even all of them
# together would change the last digit.
_LOST = 45.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SingleTerm:
    """What something else says of one of the two restitutions, such as rebounds or collisions.

    Parameters
    ----------
    restitution : ndarray (n,)
        Rising, from end to end of what is possible, and close enough that a cubic spline tells
        the term between them; 4 or more.
    log_likelihood : ndarray (n,)
    """

    restitution: NDArray[np.float64]
    log_likelihood: NDArray[np.float64]

    def at(self, restitution: NDArray[np.float64]) -> NDArray[np.float64]:
        """The term at other restitutions, (n,), that rise."""
        slopes = spline_slopes(self.restitution, self.log_likelihood)
        return spline_at(self.restitution, self.log_likelihood, slopes, restitution)

    def off_by(self, spread: float) -> SingleTerm:
        """The same where all of it may be off by a common amount, a Gaussian of this spread."""
        if spread == 0.0:
            return self
        first, last = self.restitution[[0, -1]]
        step = min(0.25 * spread, float(last - first) / _SMEARED)
        fine = np.arange(first, last + step, step)
        smeared = _smeared(fine, self.at(fine), self.restitution, spread)
        return SingleTerm(restitution=self.restitution, log_likelihood=smeared)


@compiled
def _smeared(
    fine: NDArray[np.float64],
    logs: NDArray[np.float64],
    nodes: NDArray[np.float64],
    spread: float,
) -> NDArray[np.float64]:
    """Logarithm of the sum, over even places, of exp(logs) times a Gaussian around each node."""
    smeared = np.empty(nodes.size)
    part = np.empty(fine.size)
    most = logs.max()
    step = fine[1] - fine[0]
    for i in range(nodes.size):
        near = min(max(int((nodes[i] - fine[0]) / step + 0.5), 0), fine.size - 1)
        least = logs[near] - 0.5 * ((fine[near] - nodes[i]) / spread) ** 2
        # Farther away the Gaussian alone makes too little of the best of all.
        reach = int(spread * math.sqrt(2.0 * (most - least + _LOST)) / step) + 2
        start, end = max(near - reach, 0), min(near + reach + 1, fine.size)
        best = least
        for k in range(start, end):
            part[k] = logs[k] - 0.5 * ((fine[k] - nodes[i]) / spread) ** 2
            best = max(best, part[k])
        total = 0.0
        for k in range(start, end):
            if part[k] > best - _LOST:
                total += math.exp(part[k] - best)
        smeared[i] = best + math.log(total)
    return smeared
