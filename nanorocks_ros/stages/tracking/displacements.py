"""Displacements of beads between two or three frames, from their tracks."""

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

# Largest position error of a bead that is used, over the median of its species.
_MAX_ERROR_RATIO = 5.0
# Largest relative difference of the two intervals between three frames for the noise.
_MAX_INTERVAL_DIFFERENCE = 0.2
# Median of the square of a Gaussian variable of unit variance.
_MEDIAN_SQUARE = 0.4549
# Smallest number of frames that the noise can be measured from.
_MIN_NOISE_FRAMES = 3

ALL_SPECIES = -1
"""Beads of every species."""


class TrackSeries(NamedTuple):
    """Tracks of one tray in m successive frames, concatenated.

    Parameters
    ----------
    stamps : ndarray of int64, (m,), [ns]
    first : ndarray of int64, (m + 1,)
        First row of each frame.
    ids, species : ndarray of int32, (n,)
        Numbers ascend within each frame.
    seen : ndarray of bool, (n,)
    positions : ndarray (n, 2), [m]
        In the camera frame: the tray may swing under the beads.
    errors, radii : ndarray (n,), [m]
    displacements : ndarray (m, 2), [m]
        Of the tray in each frame.
    """

    stamps: NDArray[np.int64]
    first: NDArray[np.int64]
    ids: NDArray[np.int32]
    species: NDArray[np.int32]
    seen: NDArray[np.bool_]
    positions: NDArray[np.float64]
    errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    displacements: NDArray[np.float64]


class MinDisplacement(NamedTuple):
    """Smallest mean square displacement of the beads in half of a window.

    Parameters
    ----------
    square : float, [m^2]
    variances, position_variances : float
        Smallest ratio to the variance of a coordinate: of the part that differs between frames,
        and of the whole.
    beads : int
        Smallest number of beads.
    """

    square: float
    variances: float
    position_variances: float
    beads: int


def join_tracks(tracks: Sequence[Tracks]) -> TrackSeries:
    """Concatenate records, at least one."""
    counts = [record.ids.size for record in tracks]
    displacements = np.array([record.displacement for record in tracks])
    moved = np.repeat(displacements, counts, axis=0)
    return TrackSeries(
        stamps=np.array([record.stamp_ns for record in tracks], dtype=np.int64),
        first=np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]),
        ids=np.concatenate([record.ids for record in tracks]),
        species=np.concatenate([record.species for record in tracks]),
        seen=np.concatenate([record.seen for record in tracks]),
        positions=np.concatenate([record.positions for record in tracks]) + moved,
        errors=np.concatenate([record.position_errors for record in tracks]),
        radii=np.concatenate([record.radii for record in tracks]),
        displacements=displacements,
    )


@compiled
def usable_beads(series: TrackSeries, frame: int, species: int) -> NDArray[np.int64]:
    """Rows of the visible beads of a frame with small position errors, each in its species."""
    first, last = series.first[frame], series.first[frame + 1]
    rows = np.empty(last - first, dtype=np.int64)
    n, kinds = 0, 0
    for k in range(first, last):
        if series.seen[k] and (species == ALL_SPECIES or series.species[k] == species):
            rows[n] = k
            n += 1
            kinds = max(kinds, series.species[k] + 1)
    # The position of a half hidden bead is poor; being hidden does not depend on the speed.
    max_errors, errors = np.empty(kinds), np.empty(n)
    for kind in range(kinds):
        own = 0
        for row in rows[:n]:
            if series.species[row] == kind:
                errors[own] = series.errors[row]
                own += 1
        max_errors[kind] = _MAX_ERROR_RATIO * median_of(errors[:own]) if own else 0.0
    kept = 0
    for row in rows[:n]:
        if series.errors[row] <= max_errors[series.species[row]]:
            rows[kept] = row
            kept += 1
    return rows[:kept]


@kernel
def _common_beads(
    ids: NDArray[np.int32],
    a: NDArray[np.int64],
    b: NDArray[np.int64],
    c: NDArray[np.int64],
    rows: NDArray[np.int64],
) -> int:
    """Write the rows of the beads present in three frames, (3, n); return their number."""
    i, j, k, n = 0, 0, 0, 0
    while i < a.size and j < b.size and k < c.size:
        x, y, z = ids[a[i]], ids[b[j]], ids[c[k]]
        largest = max(x, y, z)
        if x == largest and y == largest and z == largest:
            rows[0, n], rows[1, n], rows[2, n] = a[i], b[j], c[k]
            n, i, j, k = n + 1, i + 1, j + 1, k + 1
            continue
        i += x < largest
        j += y < largest
        k += z < largest
    return n


@compiled
def position_noise(series: TrackSeries, species: int) -> float:
    """Variance of a coordinate between frames, measured from the positions, [m^2].

    Half of the beads fly straight through three frames. The distance of the middle position from
    the midpoint of the others has 3/2 of the variance. Errors that all frames share do not count.
    Infinite without three frames at equal intervals.
    """
    if series.stamps.size < _MIN_NOISE_FRAMES:
        return math.inf
    squares = np.empty(2 * series.ids.size)
    rows = np.empty((3, series.ids.size), dtype=np.int64)
    n = 0
    first, second = usable_beads(series, 0, species), usable_beads(series, 1, species)
    for frame in range(series.stamps.size - 2):
        third = usable_beads(series, frame + 2, species)
        before = series.stamps[frame + 1] - series.stamps[frame]
        after = series.stamps[frame + 2] - series.stamps[frame + 1]
        if abs(before - after) <= _MAX_INTERVAL_DIFFERENCE * before:
            count = _common_beads(series.ids, first, second, third, rows)
            n += _midpoint_residuals(series.positions, rows[:, :count], squares[n:])
        first, second = second, third
    if n == 0:
        return math.inf
    return float(median_of(squares[:n]) / (1.5 * _MEDIAN_SQUARE))


@kernel
def _midpoint_residuals(
    positions: NDArray[np.float64], rows: NDArray[np.int64], squares: NDArray[np.float64]
) -> int:
    """Write the squared residuals of the middle positions; return their number."""
    n = 0
    for k in range(rows.shape[1]):
        for axis in range(2):
            ends = positions[rows[0, k], axis] + positions[rows[2, k], axis]
            residual = positions[rows[1, k], axis] - 0.5 * ends
            squares[n] = residual * residual
            n += 1
    return n


@inlined
def _distance(series: TrackSeries, row: int, other: int) -> float:
    dx = series.positions[row, 0] - series.positions[other, 0]
    dy = series.positions[row, 1] - series.positions[other, 1]
    return math.sqrt(dx * dx + dy * dy)


@compiled
def displacements_between(
    series: TrackSeries, frames: tuple[int, int, int], species: int, noise: float
) -> tuple[NDArray[np.float64], float, float, float]:
    """Distances that each bead moved between three frames in which it is visible.

    Parameters
    ----------
    series : TrackSeries
    frames : tuple of 3 ints
        Later, middle, earlier.
    species : int
        Index of the species, or ALL.
    noise : float, [m^2]
        Upper limit of the variances: errors that frames share do not displace a bead.

    Returns
    -------
    distances : ndarray (3, n), [m]
        For each bead from the middle to the later, from the earlier to the middle, and from the
        earlier to the later frame.
    square : float, [m^2]
        Mean square of the first two; NaN without beads, like the others.
    variance : float, [m^2]
        Mean variance of a coordinate, as far as it differs between frames.
    position_variance : float, [m^2]
        Median of the whole variance of a coordinate.
    """
    later = usable_beads(series, frames[0], species)
    middle = usable_beads(series, frames[1], species)
    earlier = usable_beads(series, frames[2], species)
    rows = np.empty((3, min(later.size, middle.size, earlier.size)), dtype=np.int64)
    n = _common_beads(series.ids, later, middle, earlier, rows)
    distances, variances = np.empty((3, n)), np.empty(n)
    if n == 0:
        return distances, math.nan, math.nan, math.nan
    square, variance = _write_distances(series, rows, noise, distances, variances)
    return distances, square / (2.0 * n), variance / n, median_of(variances)


@kernel
def _write_distances(
    series: TrackSeries,
    rows: NDArray[np.int64],
    noise: float,
    distances: NDArray[np.float64],
    variances: NDArray[np.float64],
) -> tuple[float, float]:
    """Write distances and variances of the beads; return the sums of squares and variances."""
    square, variance = 0.0, 0.0
    for k in range(variances.size):
        distances[0, k] = _distance(series, rows[0, k], rows[1, k])
        distances[1, k] = _distance(series, rows[1, k], rows[2, k])
        distances[2, k] = _distance(series, rows[0, k], rows[2, k])
        square += distances[0, k] ** 2 + distances[1, k] ** 2
        total = 0.0
        for frame in range(3):
            total += series.errors[rows[frame, k]] ** 2
        variances[k] = total / 3.0
        variance += min(variances[k], noise)
    return square, variance


@compiled
def pair_displacements(
    series: TrackSeries, later: int, earlier: int, species: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Distances that each bead moved between two frames in which it is visible.

    Parameters
    ----------
    series : TrackSeries
    later, earlier : int
        Frames.
    species : int
        Index of the species, or `ALL_SPECIES`.

    Returns
    -------
    distances : ndarray (n,), [m]
    rows : ndarray of int64, (2, n)
        Of these beads in the later and in the earlier frame.
    """
    first, second = usable_beads(series, later, species), usable_beads(series, earlier, species)
    rows = np.empty((3, min(first.size, second.size)), dtype=np.int64)
    n = _common_beads(series.ids, first, second, second, rows)
    distances = np.empty(n)
    for k in range(n):
        distances[k] = _distance(series, rows[0, k], rows[1, k])
    return distances, rows[:2, :n]


@compiled
def displacements_beyond_noise(
    series: TrackSeries, species: int, noise: float, minimum: MinDisplacement
) -> tuple[int, NDArray[np.float64], float, float, float]:
    """Distances over the shortest lag at which displacements exceed the noise, or the longest lag.

    Parameters
    ----------
    series, species, noise
        See `displacements_between`.
    minimum : MinDisplacement

    Returns
    -------
    int
        Lag in frames between the later and the middle frame, and between that and the earlier. It
        grows by a quarter from trial to trial; 0 with too few frames or beads.
    distances, square, variance, position_variance
        See `displacements_between`.
    """
    last = series.stamps.size - 1
    max_lag = last // 2
    lag, square, variance, position_variance = 0, math.nan, math.nan, math.nan
    distances = np.empty((3, 0))
    while lag < max_lag:
        new_lag = min(max_lag, max(lag + 1, lag * 5 // 4))
        frames = (last, last - new_lag, last - 2 * new_lag)
        new_distances, new_square, new_variance, new_position_variance = displacements_between(
            series, frames, species, noise
        )
        if new_distances.shape[1] < minimum.beads:
            break
        lag, distances = new_lag, new_distances
        square, variance, position_variance = new_square, new_variance, new_position_variance
        noise_square = max(
            minimum.variances * variance, minimum.position_variances * position_variance
        )
        if square >= max(minimum.square, noise_square):
            break
    return lag, distances, square, variance, position_variance
