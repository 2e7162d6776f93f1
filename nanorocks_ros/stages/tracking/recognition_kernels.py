"""Sums over the discs of an image that tell how well beads are recognised, compiled.

Tested by ``test/stages/tracking/test_recognition_counts.py``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.numerics.compiled import compiled

SUMS_OF_TRACK = 7
"""Of a track: images, least and largest place (column, row), sums of radius and of its error."""

# Discs of beads that touch are apart by the sum of their radii in space; edges err by some of it.
_OVERLAP = 0.8
# Speeds above this part of the limit: faster beads have lost their tracks.
_NEAR_LIMIT = 0.8


class Discs(NamedTuple):
    """The discs of an image; see `Tracks`, whose numbers rise."""

    ids: NDArray[np.int32]
    species: NDArray[np.int32]
    positions: NDArray[np.float64]
    errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    velocities: NDArray[np.float64]
    seen: NDArray[np.bool_]


@compiled
def add_frame(
    discs: Discs,
    species: int,
    least_distance: float,
    max_speed: float,
    sums: NDArray[np.float64],
) -> tuple[int, int, int, int, int]:
    """Add the discs of a species to the sums of their tracks.

    Parameters
    ----------
    discs : Discs
    species : int
    least_distance : float
        Of two discs of beads that touch, over the sum of their radii.
    max_speed : float, [m/s]
        Largest speed at which beads are linked.
    sums : ndarray (tracks, SUMS_OF_TRACK)
        Changed.

    Returns
    -------
    tuple of 5 int
        Discs that are tracked, that are seen, that overlap another one more than beads can; known
        speeds, and those near the largest.
    """
    tracked, seen, speeds, fast = 0, 0, 0, 0
    for k in range(discs.ids.size):
        if discs.species[k] != species:
            continue
        tracked += 1
        speed = _length(discs.velocities[k, 0], discs.velocities[k, 1])
        speeds += math.isfinite(speed)
        fast += speed > _NEAR_LIMIT * max_speed
        if discs.seen[k]:
            seen += 1
            _add_disc(discs, k, sums[discs.ids[k]])
    return tracked, seen, _overlapping(discs, species, _OVERLAP * least_distance), speeds, fast


@compiled
def _length(x: float, y: float) -> float:
    return math.sqrt(x * x + y * y)


@compiled
def _add_disc(discs: Discs, k: int, own: NDArray[np.float64]) -> None:
    own[0] += 1.0
    for axis in range(2):
        own[1 + axis] = min(own[1 + axis], discs.positions[k, axis])
        own[3 + axis] = max(own[3 + axis], discs.positions[k, axis])
    own[5] += discs.radii[k]
    own[6] += discs.errors[k]


@compiled
def _overlapping(discs: Discs, species: int, share: float) -> int:
    """Discs seen that are nearer to another one than this share of the sum of their radii."""
    own = np.empty(discs.ids.size, dtype=np.int64)
    count = 0
    for k in range(discs.ids.size):
        if _counts(discs, k, species):
            own[count] = k
            count += 1
    overlaps = np.zeros(count, dtype=np.bool_)
    for m in range(count):
        k = own[m]
        for n in range(m):
            j = own[n]
            limit = share * (discs.radii[k] + discs.radii[j])
            # Most discs are too far apart along one axis alone.
            x = discs.positions[k, 0] - discs.positions[j, 0]
            if abs(x) < limit:
                y = discs.positions[k, 1] - discs.positions[j, 1]
                if _length(x, y) < limit:
                    overlaps[m] = overlaps[n] = True
    return int(overlaps.sum())


@compiled
def _counts(discs: Discs, k: int, species: int) -> bool:
    return bool(discs.seen[k] and discs.species[k] == species)


@compiled
def add_displacements(
    later: Discs, earlier: Discs, species: int, sums: NDArray[np.float64]
) -> None:
    """Add the displacements of the discs of a species that two images show.

    Parameters
    ----------
    later, earlier : Discs
    species : int
    sums : ndarray (3,)
        Number of displacements, their squares and what errors add to these; changed.
    """
    j = 0
    for k in range(later.ids.size):
        while j < earlier.ids.size and earlier.ids[j] < later.ids[k]:
            j += 1
        if j == earlier.ids.size:
            return
        same = earlier.ids[j] == later.ids[k]
        if same and _counts(later, k, species) and _counts(earlier, j, species):
            for axis in range(2):
                sums[1] += (later.positions[k, axis] - earlier.positions[j, axis]) ** 2
            sums[0] += 1.0
            sums[2] += 2.0 * (later.errors[k] ** 2 + earlier.errors[j] ** 2)
