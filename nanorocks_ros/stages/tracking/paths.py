"""How far beads came between three pictures, from their tracks."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.physics.compiled import compiled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

# Times the usual error of a place, with which a bead is still used.
_WORST = 5.0
# By how much the distances in time of three pictures may differ to measure the jitter.
_UNEVEN = 0.2
# Of a Gaussian of unit variance, the median of the squares.
_MEDIAN_SQUARE = 0.4549

ALL = -1
"""Beads of every species."""


class Series(NamedTuple):
    """Tracks of one tray in a series of m pictures, one after the other in the same arrays.

    Parameters
    ----------
    stamps : ndarray of int64, (m,), [ns]
    first : ndarray of int64, (m + 1,)
        Where the beads of each picture begin.
    ids, species : ndarray of int32, (n,)
        Numbers rise within each picture.
    seen : ndarray of bool, (n,)
    places : ndarray (n, 2), [m]
        Past the camera: the tray may swing under the beads.
    errors : ndarray (n,), [m]
    """

    stamps: NDArray[np.int64]
    first: NDArray[np.int64]
    ids: NDArray[np.int32]
    species: NDArray[np.int32]
    seen: NDArray[np.bool_]
    places: NDArray[np.float64]
    errors: NDArray[np.float64]


def joined(tracks: Sequence[Tracks]) -> Series:
    """The same records, at least one, in one set of arrays."""
    counts = [one.ids.size for one in tracks]
    moved = np.repeat(np.array([one.displacement for one in tracks]), counts, axis=0)
    return Series(
        stamps=np.array([one.stamp_ns for one in tracks], dtype=np.int64),
        first=np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]),
        ids=np.concatenate([one.ids for one in tracks]),
        species=np.concatenate([one.species for one in tracks]),
        seen=np.concatenate([one.seen for one in tracks]),
        places=np.concatenate([one.positions for one in tracks]) + moved,
        errors=np.concatenate([one.position_errors for one in tracks]),
    )


@compiled
def _shown(series: Series, picture: int, species: int) -> NDArray[np.int64]:
    """The beads of a picture that are seen, where they are placed well enough."""
    first, last = series.first[picture], series.first[picture + 1]
    found = np.empty(last - first, dtype=np.int64)
    errors = np.empty(last - first)
    n = 0
    for k in range(first, last):
        if series.seen[k] and (species == ALL or series.species[k] == species):
            found[n], errors[n] = k, series.errors[k]
            n += 1
    if n == 0:
        return found[:0]
    # A bead half hidden is placed badly; who is hidden does not depend on the speed.
    worst = _WORST * np.median(errors[:n])
    kept = 0
    for k in range(n):
        if errors[k] <= worst:
            found[kept] = found[k]
            kept += 1
    return found[:kept]


@compiled
def _common(
    series: Series, pictures: tuple[int, int, int], species: int
) -> tuple[NDArray[np.int64], int]:
    """The beads shown in all of three pictures: where each is in each, (3, n), and n."""
    a = _shown(series, pictures[0], species)
    b = _shown(series, pictures[1], species)
    c = _shown(series, pictures[2], species)
    found = np.empty((3, min(a.size, b.size, c.size)), dtype=np.int64)
    i, j, k, n = 0, 0, 0, 0
    while i < a.size and j < b.size and k < c.size:
        x, y, z = series.ids[a[i]], series.ids[b[j]], series.ids[c[k]]
        largest = max(x, y, z)
        if x == largest and y == largest and z == largest:
            found[0, n], found[1, n], found[2, n] = a[i], b[j], c[k]
            n, i, j, k = n + 1, i + 1, j + 1, k + 1
            continue
        i += x < largest
        j += y < largest
        k += z < largest
    return found, n


@compiled
def jitter_of(series: Series, species: int) -> float:
    """Variance of a coordinate from picture to picture, as the places themselves show it, [m^2].

    Half of the beads fly straight through three pictures; a place off the middle of its
    neighbours has 3/2 of that variance. What all pictures are off by together is no part of it.
    Infinite when there are no three pictures evenly apart.
    """
    squares = np.empty(2 * series.ids.size)
    n = 0
    for picture in range(series.stamps.size - 2):
        before = series.stamps[picture + 1] - series.stamps[picture]
        after = series.stamps[picture + 2] - series.stamps[picture + 1]
        if abs(before - after) > _UNEVEN * before:
            continue
        found, count = _common(series, (picture, picture + 1, picture + 2), species)
        for k in range(count):
            for axis in range(2):
                ends = series.places[found[0, k], axis] + series.places[found[2, k], axis]
                off = series.places[found[1, k], axis] - 0.5 * ends
                squares[n] = off * off
                n += 1
    if n == 0:
        return math.inf
    return float(np.median(squares[:n]) / (1.5 * _MEDIAN_SQUARE))


@compiled
def _apart(series: Series, here: int, there: int) -> float:
    dx = series.places[here, 0] - series.places[there, 0]
    dy = series.places[here, 1] - series.places[there, 1]
    return math.sqrt(dx * dx + dy * dy)


@compiled
def distances_of(
    series: Series, pictures: tuple[int, int, int], species: int, jitter: float
) -> tuple[NDArray[np.float64], float, float, float]:
    """How far each bead came that was seen in three pictures.

    Parameters
    ----------
    series : Series
    pictures : tuple of 3 ints
        Later, middle, earlier.
    species : int
        Index of the species, or ALL.
    jitter : float, [m^2]
        Errors that places share from picture to picture move no bead: variances are no more.

    Returns
    -------
    distances : ndarray (3, n), [m]
        Of each bead from the middle to the later, from the earlier to the middle, from the
        earlier to the later picture.
    square : float, [m^2]
        Mean of the squares of the first two; NaN without beads, as are the others.
    variance : float, [m^2]
        Mean variance of a coordinate of a place, as far as it differs from picture to picture.
    place_variance : float, [m^2]
        Median of the whole.
    """
    found, n = _common(series, pictures, species)
    distances, variances = np.empty((3, n)), np.empty(n)
    if n == 0:
        return distances, math.nan, math.nan, math.nan
    square, variance = 0.0, 0.0
    for k in range(n):
        distances[0, k] = _apart(series, found[0, k], found[1, k])
        distances[1, k] = _apart(series, found[1, k], found[2, k])
        distances[2, k] = _apart(series, found[0, k], found[2, k])
        square += distances[0, k] ** 2 + distances[1, k] ** 2
        total = 0.0
        for one in range(3):
            total += series.errors[found[one, k]] ** 2
        variances[k] = total / 3.0
        variance += min(variances[k], jitter)
    return distances, square / (2.0 * n), variance / n, float(np.median(variances))
