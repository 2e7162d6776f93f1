"""Paths of the beads of a tray over the last frames, and how much they bend.

Tested by ``test/stages/tracking/test_camera_motion.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from collections import deque

    from numpy.typing import NDArray

# Beads this much further from each other than their radii touch: a share of that, and [px].
_GAP_SHARE, _GAP_PX = 0.04, 0.5


@dataclass(frozen=True, slots=True)
class Moment:
    """Beads of a frame in the frame of the tray, and the row of each in the frame before."""

    time: float
    positions: NDArray[np.float64]
    radii: NDArray[np.float64]
    before: NDArray[np.int64]
    displacement: NDArray[np.float64]


def paths_of(
    moments: deque[Moment], lags: tuple[int, ...]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions some frames ago of the beads seen since then, (lags, n, 2), and their radii."""
    last = moments[-1]
    rows = [np.arange(len(last.positions))]
    for k in range(lags[-1]):
        # A row more for beads that have none: index -1.
        before = np.append(moments[-1 - k].before, -1)
        rows.append(before[rows[-1]])
    seen = rows[-1] >= 0
    positions = np.stack([moments[-1 - k].positions[rows[k][seen]] for k in lags])
    return positions, last.radii[seen]


def bend(
    later: NDArray[np.float64],
    middle: NDArray[np.float64],
    earlier: NDArray[np.float64],
    ratio: float,
) -> NDArray[np.float64]:
    """Distance of the later position from where straight motion would have led."""
    return later - middle - ratio * (middle - earlier)


@compiled
def nearest_rows(
    positions: NDArray[np.float64], before: NDArray[np.float64], rows: NDArray[np.int64]
) -> None:
    """Row of each bead in the frame before: that nearest to it, if it is also nearest to that.

    -1 for a bead that has none.
    """
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
