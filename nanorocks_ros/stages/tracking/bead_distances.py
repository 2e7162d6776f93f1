"""Mean distance that beads moved, from those of single beads between frames of their tracks.

Tested by ``test/stages/tracking/test_mean_speed.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Smallest ratio of displacements to the errors of positions at which a speed is reliable.
_RELIABLE_RATIO = 3.2
# Smallest share of a species that is taken for a sample of all of it.
_MIN_SAMPLE_SHARE = 0.3
HIDDEN_ERROR = 0.7
"""Error of the correction for hidden beads over the correction: in drawn films it left 0.2 to 1 of
itself."""


@dataclass(frozen=True, slots=True)
class PairDistances:
    """Distances and species of the beads seen at both ends of half of the window.

    `weights` is how many beads of its species each one stands for, `expected` the number of beads
    of each species in the tray.
    """

    distances: NDArray[np.float64]
    species: NDArray[np.int32]
    weights: NDArray[np.float64]
    expected: NDArray[np.int32]

    def mean_distance(self, variance: float, *, hidden: bool) -> float:
        """Mean over all beads in the tray: those of a species stand for the unseen ones of it.

        Parameters
        ----------
        variance : float, [m^2]
            Of a coordinate.
        hidden : bool
            Whether each bead stands for those that its surroundings hide.
        """
        each = self.weights if hidden else np.ones(self.weights.size)
        seen = np.bincount(self.species, minlength=self.expected.size)
        sums = np.bincount(self.species, each, minlength=self.expected.size)
        fewest = np.maximum(_MIN_SAMPLE_SHARE * self.expected, 1.0)
        weights = self.expected / np.maximum(seen, fewest) * seen / np.maximum(sums, 1.0)
        return _mean_distance(self.distances, variance, weights[self.species] * each)


@dataclass(frozen=True, slots=True)
class BeadDistances:
    """Distances of each bead in the later half of the window, in the earlier half and in both.

    `square` is the mean square distance in half of the window; see `displacements_between`.
    `halves` are the beads seen at both ends of the later and the earlier half, wherever they are
    at the other end of the window.
    """

    halves: tuple[PairDistances, ...]
    later: NDArray[np.float64]
    earlier: NDArray[np.float64]
    whole_window: NDArray[np.float64]
    square: float
    variance: float
    position_variance: float

    def exceed_errors(self) -> bool:
        """Whether displacements exceed the position errors, such as those from rotating chalk."""
        return self.square >= _RELIABLE_RATIO**2 * self.position_variance

    def speed(self, later_time: float, earlier_time: float) -> tuple[float, float]:
        """Mean speed and its error, from the times [s] of the later and the earlier half."""
        of_three = 0.5 * (
            _mean_distance(self.later, self.variance) / later_time
            + _mean_distance(self.earlier, self.variance) / earlier_time
        )
        full = _mean_distance(self.whole_window, self.variance) / (later_time + earlier_time)
        half, of_seen = (
            0.5
            * sum(
                part.mean_distance(self.variance, hidden=hidden) / time
                for part, time in zip(self.halves, (later_time, earlier_time), strict=True)
            )
            for hidden in (True, False)
        )
        # Collisions shorten the distance in proportion to the time, to first order.
        shortened = half * max(1.0 - full / of_three, 0.0) if of_three > 0.0 else 0.0
        noise_error = self._jitter_error(0.5 * (later_time + earlier_time) * half)
        per_time = 2.0 / (later_time + earlier_time)
        bead_scatter = np.hypot(self.later - self.earlier, 1e-3 * self.later) * per_time
        scatter = (
            0.5 * math.sqrt(_mean(bead_scatter * bead_scatter)) / math.sqrt(self.whole_window.size)
        )
        shared_error = self._shared_share() * half
        hidden_error = HIDDEN_ERROR * (half - of_seen)
        error = math.hypot(
            noise_error * per_time, 0.5 * shortened, scatter, shared_error, hidden_error
        )
        return max(half + shortened, 0.0), error

    def _shared_share(self) -> float:
        """Relative error of a distance from errors that positions share for some time."""
        shared_variance = max(self.position_variance - self.variance, 0.0)
        return 1.0 - math.sqrt(max(1.0 - 4.0 * shared_variance / max(self.square, 1e-18), 0.0))

    def _jitter_error(self, mean: float) -> float:
        """Error of a mean distance from noise, [m]; smaller for a long distance than for none."""
        square_error = 4.0 * self.variance / math.sqrt(self.whole_window.size)
        rest_error = min(math.sqrt(square_error), 0.5 * square_error / max(mean, 1e-12))
        return math.hypot(math.sqrt(2.0 * self.variance / self.whole_window.size), rest_error)


def _mean_distance(
    distances: NDArray[np.float64],
    variance: float,
    weights: NDArray[np.float64] | float = 1.0,
) -> float:
    """Mean distance corrected for Gaussian noise of both positions.

    Exact for a Maxwellian gas.
    """
    total = _mean(np.ones(distances.size) * weights)
    square = _mean(weights * distances * distances) / total
    corrected = square - 4.0 * variance
    if corrected <= 0.0:
        return 0.0
    return _mean(weights * distances) / total * math.sqrt(corrected / square)


def _mean(values: NDArray[np.float64]) -> float:
    """Mean of an array, faster than `numpy.mean` for short arrays."""
    return float(np.add.reduce(values)) / values.size
