"""Residual variance of positions about straight flights, estimated from the flights.

Tested by ``test/stages/contacts/test_contact_finder.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.median import median_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Number of flights in the estimate, smallest number of positions in a flight, and shortest path in
# errors of a position: a bead at rest always has the same position error.
_MAX_FLIGHTS, _MIN_POINTS, _MIN_PATH = 200, 8, 8.0
_MIN_FLIGHTS = 10


class ResidualVariance(NamedTuple):
    """Variance of positions about straight flights over the stated variance, for each species.

    Parameters
    ----------
    samples : ndarray (species, flights)
        Ring buffer of the last flights.
    counts : ndarray of int64, (species,)
        Number of flights so far.
    variances : ndarray (species,)
        Median of the samples; 1 before there are 10.
    """

    samples: NDArray[np.float64]
    counts: NDArray[np.int64]
    variances: NDArray[np.float64]

    @classmethod
    def initial(cls, species: int) -> ResidualVariance:
        """State before the first flight."""
        return cls(
            np.zeros((species, _MAX_FLIGHTS)),
            np.zeros(species, dtype=np.int64),
            np.ones(species),
        )


@compiled
def add_flight(residuals: ResidualVariance, species: int, flight: NDArray[np.float64]) -> None:
    """Add the reduced chi square of a flight; stated errors include what frames share, too."""
    points = flight[8]
    squared_speed = flight[3] * flight[3] + flight[4] * flight[4]
    if points < _MIN_POINTS or squared_speed < _MIN_PATH * _MIN_PATH * flight[6]:
        return
    count = residuals.counts[species]
    residuals.samples[species, count % _MAX_FLIGHTS] = flight[7] / (2.0 * points - 4.0)
    residuals.counts[species] = count + 1
    if count + 1 >= _MIN_FLIGHTS:
        samples = residuals.samples[species, : min(count + 1, _MAX_FLIGHTS)]
        residuals.variances[species] = median_of(samples)
