"""How places scatter about straight flights: learnt from the flights themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Flights from which the scatter of places is learnt, their fewest places, and how far they lead
# in errors of a place: beads at rest are always misplaced alike.
_FLIGHTS, _FEWEST_PLACES, _LEAST_WAY = 200, 8, 8.0
_FEWEST_FLIGHTS = 10


class Scatter(NamedTuple):
    """How places scatter about straight flights, over what their errors say, by species.

    Parameters
    ----------
    known : ndarray (species, flights)
        Of the last flights, one after the other and then round again.
    counts : ndarray of int64, (species,)
        Flights so far.
    variances : ndarray (species,)
        Their median.
    """

    known: NDArray[np.float64]
    counts: NDArray[np.int64]
    variances: NDArray[np.float64]

    @classmethod
    def unknown(cls, species: int) -> Scatter:
        """Before the first flight."""
        return cls(
            np.zeros((species, _FLIGHTS)),
            np.zeros(species, dtype=np.int64),
            np.ones(species),
        )


@compiled
def learn(scatter: Scatter, species: int, flight: NDArray[np.float64]) -> None:
    """Scatter of places over what their errors say; those hold what pictures share, too."""
    used = flight[8]
    speed2 = flight[3] * flight[3] + flight[4] * flight[4]
    if used < _FEWEST_PLACES or speed2 < _LEAST_WAY * _LEAST_WAY * flight[6]:
        return
    count = scatter.counts[species]
    scatter.known[species, count % _FLIGHTS] = flight[7] / (2.0 * used - 4.0)
    scatter.counts[species] = count + 1
    if count + 1 >= _FEWEST_FLIGHTS:
        known = scatter.known[species, : min(count + 1, _FLIGHTS)]
        scatter.variances[species] = np.median(known)
