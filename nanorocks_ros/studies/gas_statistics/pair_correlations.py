"""Pair correlation g(r) of projected places, against an ideal gas in the same tray.

g(r) is the number of pairs of beads at a distance over that of an ideal gas whose beads are
spread evenly over the places that the side walls leave them (`physics.ideal_gas`): the edges of
the tray are in both. Projected beads may come nearer than a diameter, one above the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.distance import cdist, pdist

from nanorocks_ros.physics.ideal_gas import pair_probabilities
from nanorocks_ros.studies.gas_statistics.jackknife import block_sums, jackknife

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.gas_statistics.random_arrangements import Places

# Width of a bin over the smallest sum of two radii, and largest distance over the largest.
_WIDTH, _REACH = 0.05, 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PairCorrelation:
    """Pair correlation of two species, or of one with itself.

    Parameters
    ----------
    species : tuple of 2 ints
    distance : ndarray (n_bins,), [m]
        Middle of each bin.
    value, error : ndarray (n_bins,)
        1 in an ideal gas; the error is from the scatter of the blocks.
    random : ndarray (n_bins,)
        Of beads at random places, which only exclude each other.
    """

    species: tuple[int, int]
    distance: NDArray[np.float64]
    value: NDArray[np.float64]
    error: NDArray[np.float64]
    random: NDArray[np.float64]


def accessible_lengths(tray: Tray, species: int) -> NDArray[np.float64]:
    """Lengths along x and y of the range of the centres of a species, (2,), [m]."""
    return np.array(tray.dimensions[:2]) - tray.species[species].diameter


def pair_correlations(
    frames: Sequence[Places],
    block: NDArray[np.int64],
    tray: Tray,
    random: Sequence[Places],
) -> tuple[PairCorrelation, ...]:
    """Pair correlations of all species, over a series of frames.

    Parameters
    ----------
    frames : sequence of m Places
    block : ndarray of int, (m,)
        Part of a cycle that each frame belongs to.
    tray : Tray
    random : sequence of Places
        Random arrangements to compare with.
    """
    correlations = []
    for pair in combinations_with_replacement(range(len(tray.species)), 2):
        first, second = pair
        touch = 0.5 * (tray.species[first].diameter + tray.species[second].diameter)
        rooms = accessible_lengths(tray, first), accessible_lengths(tray, second)
        reach = min(_REACH * touch, 0.5 * float(np.linalg.norm(rooms[0] + rooms[1])))
        edges = np.arange(0.0, reach, _WIDTH * touch)
        ideal = pair_probabilities(*rooms, edges)
        sums = block_sums(_counts(frames, pair, edges), block, int(block.max()) + 1)
        value, error = jackknife(sums, partial(_relative, ideal=ideal))
        correlations.append(
            PairCorrelation(
                species=pair,
                distance=0.5 * (edges[:-1] + edges[1:]),
                value=value,
                error=error,
                random=_relative(_counts(random, pair, edges).sum(axis=0), ideal),
            )
        )
    return tuple(correlations)


def _counts(
    frames: Sequence[Places], pair: tuple[int, int], edges: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Pairs in each bin, and in the last column all pairs, near or far."""
    counts = np.zeros((len(frames), edges.size))
    for row, frame in zip(counts, frames, strict=True):
        own, others = (frame.positions[frame.species == index] for index in pair)
        distances = pdist(own) if pair[0] == pair[1] else cdist(own, others).ravel()
        row[:-1] = np.histogram(distances, edges)[0]
        row[-1] = distances.size
    return counts


def _relative(total: NDArray[np.float64], ideal: NDArray[np.float64]) -> NDArray[np.float64]:
    relative: NDArray[np.float64] = total[:-1] / (max(total[-1], 1.0) * ideal)
    return relative
