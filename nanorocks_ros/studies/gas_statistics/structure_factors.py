"""Structure factor of projected places in a tray with walls, and the onset of clustering.

Waves with a knot of their slope at every wall, cos(n pi x / H_x) cos(m pi y / H_y) over the places
that the walls leave to the centres, have the mean 0 in an ideal gas between the walls, and their
squares have the mean 1: no correction for edges is needed.

In beads that only exclude each other the long waves have S < 1, clusters of n beads have up to
S = n. Clustering has begun when S of the long waves is, to the end of the cycle, above that of
beads at random places without overlap.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.studies.gas_statistics.jackknife import block_sums, jackknife
from nanorocks_ros.studies.gas_statistics.pair_correlations import accessible_lengths

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.gas_statistics.random_arrangements import Places

# Largest wave number times the mean diameter, and that of the waves that show clusters.
_MOST_K, _LONG_K = 12.0, 2.0
_N_BINS = 24
# Excess of the long waves from the onset on, of the mean and of each block, in standard errors.
_SIGMAS, _EACH_SIGMAS = 4.0, 1.0
_LEAST_BEADS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class StructureFactor:
    """Structure factor of the beads of a tray, all species together.

    Parameters
    ----------
    wave_number : ndarray (n_bins,), [1/m]
        Mean of the waves in each bin.
    value, error : ndarray (n_bins,)
        1 in an ideal gas; the error is from the scatter of the blocks.
    random : ndarray (n_bins,)
        Of beads at random places, which only exclude each other.
    """

    wave_number: NDArray[np.float64]
    value: NDArray[np.float64]
    error: NDArray[np.float64]
    random: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Clustering:
    """Structure factor of the long waves of one cycle over time.

    Parameters
    ----------
    cycle : int
    time : ndarray (n,), [s]
        Mean time of each block since the shaking event.
    value : ndarray (n,)
        Mean over the long waves.
    random, random_deviation : float
        Mean and standard deviation of the same in single random arrangements.
    onset : float, [s]
        Start of the first block from which on, to the end, every block exceeds `random` by its
        deviation, and their mean by four standard errors; NaN where there is none.
    """

    cycle: int
    time: NDArray[np.float64]
    value: NDArray[np.float64]
    random: float
    random_deviation: float
    onset: float


class Waves:
    """The waves of a tray between its walls.

    Parameters
    ----------
    tray : Tray
    """

    def __init__(self, tray: Tray) -> None:
        self._tray = tray
        counts = np.array([kind.count for kind in tray.species], dtype=np.float64)
        rooms = np.array([accessible_lengths(tray, index) for index in range(counts.size)])
        self._rooms = rooms
        mean = counts @ rooms / counts.sum()
        diameter = float(counts @ [kind.diameter for kind in tray.species] / counts.sum())
        most = _MOST_K / diameter
        self._orders = (most * mean / math.pi).astype(int) + 1
        along, across = (
            math.pi * np.arange(order) / room
            for order, room in zip(self._orders, mean, strict=True)
        )
        numbers = np.hypot(along[:, np.newaxis], across)
        self.used = (numbers > 0.0) & (numbers <= most)
        self.wave_numbers = numbers[self.used]
        """Of each wave, (n_waves,), [1/m]."""
        self.long = self.wave_numbers <= _LONG_K / diameter
        """Whether a wave shows clusters, (n_waves,)."""

    def powers(self, frames: Sequence[Places]) -> NDArray[np.float64]:
        """S of each wave in each frame, (n_frames, n_waves); NaN without two beads.

        Of beads that are not seen only the number counts: the pairs that are seen stand for all.
        """
        rows = np.full((len(frames), self.wave_numbers.size), math.nan)
        for row, frame in zip(rows, frames, strict=True):
            if frame.species.size >= _LEAST_BEADS:
                row[:] = self._powers(frame.positions, frame.species)
        return rows

    def _powers(
        self, positions: NDArray[np.float64], species: NDArray[np.int32]
    ) -> NDArray[np.float64]:
        n = species.size
        diameters = np.array([kind.diameter for kind in self._tray.species])[species]
        scaled = (positions - 0.5 * diameters[:, np.newaxis]) / self._rooms[species]
        factors = []
        for axis, order in enumerate(self._orders):
            waves = np.cos(math.pi * scaled[:, axis : axis + 1] * np.arange(order))
            waves[:, 1:] *= math.sqrt(2.0)
            factors.append(waves)
        sums = (factors[0].T @ factors[1])[self.used]
        squares = ((factors[0] ** 2).T @ (factors[1] ** 2))[self.used]
        pairs = (sums**2 - squares) / (n * (n - 1.0))
        powers: NDArray[np.float64] = 1.0 + (max(self._tray.count, n) - 1.0) * pairs
        return powers


def structure_factor(
    waves: Waves,
    powers: NDArray[np.float64],
    block: NDArray[np.int64],
    random: NDArray[np.float64],
) -> StructureFactor:
    """Mean structure factor over all frames, in bins of the wave number.

    Parameters
    ----------
    waves : Waves
    powers : ndarray (m, n_waves)
        Of each frame.
    block : ndarray of int, (m,)
        Part of a cycle that each frame belongs to.
    random : ndarray (n, n_waves)
        Of random arrangements.
    """
    edges = np.linspace(0.0, float(waves.wave_numbers.max()) * (1.0 + 1e-9), _N_BINS + 1)
    place = np.digitize(waves.wave_numbers, edges) - 1
    filled = np.unique(place)
    members = (place == filled[:, np.newaxis]) / np.bincount(place)[filled, np.newaxis]
    known = np.isfinite(powers).all(axis=1)
    rows = np.column_stack((powers[known] @ members.T, np.ones(int(known.sum()))))
    value, error = jackknife(
        block_sums(rows, block[known], int(block.max()) + 1), lambda total: total[:-1] / total[-1]
    )
    return StructureFactor(
        wave_number=members @ waves.wave_numbers,
        value=value,
        error=error,
        random=members @ random.mean(axis=0),
    )


def clustering(
    waves: Waves,
    powers: NDArray[np.float64],
    times: NDArray[np.float64],
    block: NDArray[np.int64],
    random: NDArray[np.float64],
    cycle: int,
) -> Clustering:
    """The long waves of one cycle over time, and when they show clusters.

    Parameters
    ----------
    waves : Waves
    powers : ndarray (m, n_waves)
    times : ndarray (m,), [s]
        Since the shaking event.
    block : ndarray of int, (m,)
        Each of as many collisions: waves of different blocks are independent.
    random : ndarray (n, n_waves)
        Of random arrangements.
    cycle : int
    """
    long = powers[:, waves.long].mean(axis=1)
    single = random[:, waves.long].mean(axis=1)
    mean, deviation = float(single.mean()), float(single.std(ddof=1))
    known = np.isfinite(long)
    rows = [np.flatnonzero(known & (block == number)) for number in np.unique(block[known])]
    value = np.array([long[row].mean() for row in rows])
    onset = math.nan
    for place in range(value.size):
        excess = value[place:] - mean
        least = _SIGMAS * deviation / math.sqrt(excess.size)
        if excess.min() > _EACH_SIGMAS * deviation and excess.mean() > least:
            onset = float(times[rows[place][0]])
            break
    return Clustering(
        cycle=cycle,
        time=np.array([times[row].mean() for row in rows]),
        value=value,
        random=mean,
        random_deviation=deviation,
        onset=onset,
    )
