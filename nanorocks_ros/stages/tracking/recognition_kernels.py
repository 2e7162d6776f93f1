"""Sums over the discs of an image that tell how well beads are recognised, compiled.

Tested by ``test/stages/tracking/test_recognition_counts.py``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.numerics.compiled import compiled

SUMS_OF_TRACK = 8
"""Of a track: images, least and largest place (column, row), sums of radius and of its error, and
its species."""
COUNTS = 6
"""Of a species: discs tracked, discs seen, images in which all are seen, discs that overlap
another one more than beads can, known speeds, and those near the largest."""

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
def add_image(
    image: Discs,
    earlier: tuple[Discs, Discs],
    expected: NDArray[np.int64],
    least_distances: NDArray[np.float64],
    max_speed: float,
    track_sums: NDArray[np.float64],
    counts: NDArray[np.int64],
    displacements: NDArray[np.float64],
) -> None:
    """Add the discs of an image to the sums of their species and tracks.

    Parameters
    ----------
    image : Discs
    earlier : tuple of 2 Discs
        Of two images before, without discs where there was none.
    expected : ndarray of int64, (species,)
        Beads in the tray.
    least_distances : ndarray (species,)
        Of two discs of beads that touch, over the sum of their radii.
    max_speed : float, [m/s]
        Largest speed at which beads are linked.
    track_sums : ndarray (tracks, SUMS_OF_TRACK)
        Changed, as the next two.
    counts : ndarray of int64, (species, COUNTS)
    displacements : ndarray (species, 2, 3)
        Since each of the two images: number of displacements, their squares and what errors add
        to these.
    """
    for species in range(expected.size):
        tracked, seen, speeds, fast = _add_discs(image, species, max_speed, track_sums)
        own = counts[species]
        own[0] += tracked
        own[1] += seen
        own[2] += seen >= expected[species]
        own[3] += _overlapping(image, species, _OVERLAP * least_distances[species])
        own[4] += speeds
        own[5] += fast
        for lag in range(2):
            _add_displacements(image, earlier[lag], species, displacements[species, lag])


@compiled
def _add_discs(
    discs: Discs, species: int, max_speed: float, track_sums: NDArray[np.float64]
) -> tuple[int, int, int, int]:
    """Add discs to their tracks; how many are tracked and seen, and have known and high speeds."""
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
            _add_disc(discs, k, track_sums[discs.ids[k]])
    return tracked, seen, speeds, fast


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
    own[7] = discs.species[k]


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
def _add_displacements(
    later: Discs, earlier: Discs, species: int, sums: NDArray[np.float64]
) -> None:
    """Add the displacements of the discs of a species that two images show to `sums`, (3,)."""
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
