"""Paths of the beads of a tray over the last frames, and how much they bend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from collections import deque

    from numpy.typing import NDArray

Positions = tuple['NDArray[np.float64]', ...]

# Beads this much further from each other than their radii touch: a share of that, and [px].
_GAP_SHARE, _GAP_PX = 0.04, 0.5


@dataclass(frozen=True, slots=True)
class Moment:
    """Beads of a frame in the frame of the tray, and the row of each in the frames before.

    `links`: ndarray of int32, (frames, n + 1), row of each bead so many frames ago, -1 where it
    was not seen since; the last column is -1, so that index -1 stays -1.
    """

    time: float
    positions: NDArray[np.float64]
    radii: NDArray[np.float64]
    links: NDArray[np.int32]
    displacement: NDArray[np.float64]


@compiled
def links_to(
    positions: NDArray[np.float64], before: NDArray[np.float64], links: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Links of a frame, by the places of its beads, (n, 2), and of those before, (m, 2).

    `links` are those of the frame before; see `links_from`.
    """
    return links_from(nearest_rows(positions, before), links)


@compiled
def links_from(before: NDArray[np.int64], links: NDArray[np.int32]) -> NDArray[np.int32]:
    """Links of a frame, from the row of each bead in the frame before and the links of that.

    Parameters
    ----------
    before : ndarray (n,)
        -1 for a bead that has none.
    links : ndarray of int32, (frames, m + 1)
        No frames for the first frame of a recording.
    """
    longer = np.full((links.shape[0] + 1, before.size + 1), -1, np.int32)
    for k in range(before.size):
        longer[0, k] = k
        if before[k] >= 0:
            longer[1:, k] = links[:, before[k]]
    return longer


def positions_at(moments: deque[Moment], lags: tuple[int, ...]) -> Positions:
    """Positions of all beads so many frames ago, one array for each of the lags."""
    return tuple(moments[-1 - k].positions for k in lags)


@compiled
def paths_of(
    positions: Positions,
    links: NDArray[np.int32],
    lags: tuple[int, ...],
    radii: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions some frames ago of the beads seen since then, (lags, n, 2), and their radii.

    Parameters
    ----------
    positions : tuple of ndarrays (beads, 2)
        So many frames ago as `lags` say, which ascend.
    links, radii
        Of the last frame; see `Moment`.
    """
    seen = np.flatnonzero(links[lags[-1], :-1] >= 0)
    paths = np.empty((len(lags), seen.size, 2))
    for number in range(len(lags)):
        for k in range(seen.size):
            paths[number, k] = positions[number][links[lags[number], seen[k]]]
    return paths, radii[seen]


@compiled
def body_bends(
    paths: NDArray[np.float64], radii: NDArray[np.float64], ratio: float
) -> NDArray[np.float64]:
    """Mean bend of each group of beads that touch, (bodies, 2).

    Parameters
    ----------
    paths : ndarray (3, n, 2)
        Positions at three moments, the last one first.
    radii : ndarray (n,)
    ratio : float
        Of the time between the later two moments to that between the earlier two.
    """
    bends = paths[0] - paths[1] - ratio * (paths[1] - paths[2])
    return body_means(bends, paths[0], radii)


def bend(
    later: NDArray[np.float64],
    middle: NDArray[np.float64],
    earlier: NDArray[np.float64],
    ratio: float,
) -> NDArray[np.float64]:
    """Distance of the later position from where straight motion would have led."""
    return later - middle - ratio * (middle - earlier)


@compiled
def column_medians(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Median of each column; numpy takes ten times as long for so few values."""
    medians = np.empty(values.shape[1])
    for column in range(values.shape[1]):
        medians[column] = np.median(values[:, column])
    return medians


@compiled
def nearest_rows(positions: NDArray[np.float64], before: NDArray[np.float64]) -> NDArray[np.int64]:
    """Row of each bead in the frame before: that nearest to it, if it is also nearest to that.

    -1 for a bead that has none.
    """
    rows = np.empty(positions.shape[0], dtype=np.int64)
    taken = np.full(before.shape[0], -1, np.int64)
    nearest = np.full(before.shape[0], np.inf)
    for k in range(positions.shape[0]):
        rows[k] = -1
        best = np.inf
        for j in range(before.shape[0]):
            dx = positions[k, 0] - before[j, 0]
            dy = positions[k, 1] - before[j, 1]
            square = dx * dx + dy * dy
            if square < best:
                best, rows[k] = square, j
        j = rows[k]
        if j >= 0 and best < nearest[j]:
            if taken[j] >= 0:
                rows[taken[j]] = -1
            taken[j], nearest[j] = k, best
        else:
            rows[k] = -1
    return rows


@compiled
def body_means(
    bends: NDArray[np.float64], positions: NDArray[np.float64], radii: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Mean bend of each group of beads that touch, weighted by their volumes, (bodies, 2)."""
    n = radii.size
    bodies = np.arange(n)
    for k in range(n):
        for j in range(k):
            reach = (1.0 + _GAP_SHARE) * (radii[k] + radii[j]) + _GAP_PX
            dx = positions[k, 0] - positions[j, 0]
            dy = positions[k, 1] - positions[j, 1]
            if dx * dx + dy * dy < reach * reach and bodies[j] != bodies[k]:
                merged, kept = bodies[k], bodies[j]
                for m in range(n):
                    if bodies[m] == merged:
                        bodies[m] = kept
    sums, weights = np.zeros((n, 2)), np.zeros(n)
    for k in range(n):
        volume = radii[k] ** 3
        weights[bodies[k]] += volume
        sums[bodies[k], 0] += volume * bends[k, 0]
        sums[bodies[k], 1] += volume * bends[k, 1]
    count = 0
    means = np.empty((n, 2))
    for k in range(n):
        if weights[k] > 0.0:
            means[count] = sums[k] / weights[k]
            count += 1
    return means[:count]
