"""How far beads came between three pictures, from their tracks."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined, kernel
from nanorocks_ros.numerics.median import median_of

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
# Pictures that the jitter takes.
_EVENLY_APART = 3

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


class Wanted(NamedTuple):
    """How far beads should come, on average of the squares, in half of a window.

    Parameters
    ----------
    square : float, [m^2]
    variances, place_variances : float
        At least so many times those of a coordinate: as it differs from picture to picture, and
        as a whole.
    beads : int
        Fewer say nothing.
    """

    square: float
    variances: float
    place_variances: float
    beads: int


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
    worst = _WORST * median_of(errors[:n])
    kept = 0
    for k in range(n):
        if errors[k] <= worst:
            found[kept] = found[k]
            kept += 1
    return found[:kept]


@kernel
def _common(
    ids: NDArray[np.int32],
    a: NDArray[np.int64],
    b: NDArray[np.int64],
    c: NDArray[np.int64],
    found: NDArray[np.int64],
) -> int:
    """How many beads are shown in all of three pictures; where each is in each, (3, n)."""
    i, j, k, n = 0, 0, 0, 0
    while i < a.size and j < b.size and k < c.size:
        x, y, z = ids[a[i]], ids[b[j]], ids[c[k]]
        largest = max(x, y, z)
        if x == largest and y == largest and z == largest:
            found[0, n], found[1, n], found[2, n] = a[i], b[j], c[k]
            n, i, j, k = n + 1, i + 1, j + 1, k + 1
            continue
        i += x < largest
        j += y < largest
        k += z < largest
    return n


@compiled
def jitter_of(series: Series, species: int) -> float:
    """Variance of a coordinate from picture to picture, as the places themselves show it, [m^2].

    Half of the beads fly straight through three pictures; a place off the middle of its
    neighbours has 3/2 of that variance. What all pictures are off by together is no part of it.
    Infinite when there are no three pictures evenly apart.
    """
    if series.stamps.size < _EVENLY_APART:
        return math.inf
    squares = np.empty(2 * series.ids.size)
    found = np.empty((3, series.ids.size), dtype=np.int64)
    n = 0
    first, second = _shown(series, 0, species), _shown(series, 1, species)
    for picture in range(series.stamps.size - 2):
        third = _shown(series, picture + 2, species)
        before = series.stamps[picture + 1] - series.stamps[picture]
        after = series.stamps[picture + 2] - series.stamps[picture + 1]
        if abs(before - after) <= _UNEVEN * before:
            count = _common(series.ids, first, second, third, found)
            n += _off_the_middle(series.places, found[:, :count], squares[n:])
        first, second = second, third
    if n == 0:
        return math.inf
    return float(median_of(squares[:n]) / (1.5 * _MEDIAN_SQUARE))


@kernel
def _off_the_middle(
    places: NDArray[np.float64], found: NDArray[np.int64], squares: NDArray[np.float64]
) -> int:
    """Squares of what the second place of each is off the middle of the others; how many."""
    n = 0
    for k in range(found.shape[1]):
        for axis in range(2):
            ends = places[found[0, k], axis] + places[found[2, k], axis]
            off = places[found[1, k], axis] - 0.5 * ends
            squares[n] = off * off
            n += 1
    return n


@inlined
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
    later = _shown(series, pictures[0], species)
    middle = _shown(series, pictures[1], species)
    earlier = _shown(series, pictures[2], species)
    found = np.empty((3, min(later.size, middle.size, earlier.size)), dtype=np.int64)
    n = _common(series.ids, later, middle, earlier, found)
    distances, variances = np.empty((3, n)), np.empty(n)
    if n == 0:
        return distances, math.nan, math.nan, math.nan
    square, variance = _measure(series, found, jitter, distances, variances)
    return distances, square / (2.0 * n), variance / n, median_of(variances)


@kernel
def _measure(
    series: Series,
    found: NDArray[np.int64],
    jitter: float,
    distances: NDArray[np.float64],
    variances: NDArray[np.float64],
) -> tuple[float, float]:
    """Write distances and variances of the beads found; sums over squares and variances."""
    square, variance = 0.0, 0.0
    for k in range(variances.size):
        distances[0, k] = _apart(series, found[0, k], found[1, k])
        distances[1, k] = _apart(series, found[1, k], found[2, k])
        distances[2, k] = _apart(series, found[0, k], found[2, k])
        square += distances[0, k] ** 2 + distances[1, k] ** 2
        total = 0.0
        for one in range(3):
            total += series.errors[found[one, k]] ** 2
        variances[k] = total / 3.0
        variance += min(variances[k], jitter)
    return square, variance


@compiled
def far_enough(
    series: Series, species: int, jitter: float, wanted: Wanted
) -> tuple[int, NDArray[np.float64], float, float, float]:
    """Distances over the shortest time in which beads come far enough, or the longest there is.

    Parameters
    ----------
    series, species, jitter
        See `distances_of`.
    wanted : Wanted

    Returns
    -------
    int
        Pictures between the later and the middle one, and between that and the earlier: it
        grows by a quarter from trial to trial. 0 when there are too few pictures or beads.
    distances, square, variance, place_variance
        See `distances_of`.
    """
    last = series.stamps.size - 1
    longest = last // 2
    lag, square, variance, place_variance = 0, math.nan, math.nan, math.nan
    distances = np.empty((3, 0))
    while lag < longest:
        tried = min(longest, max(lag + 1, lag * 5 // 4))
        pictures = (last, last - tried, last - 2 * tried)
        found, found_square, found_variance, found_place_variance = distances_of(
            series, pictures, species, jitter
        )
        if found.shape[1] < wanted.beads:
            break
        lag, distances = tried, found
        square, variance, place_variance = found_square, found_variance, found_place_variance
        enough = max(wanted.variances * variance, wanted.place_variances * place_variance)
        if square >= max(wanted.square, enough):
            break
    return lag, distances, square, variance, place_variance
