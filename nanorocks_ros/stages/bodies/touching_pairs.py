"""Compiled search for pairs of visible beads that may touch."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.stable_sort import stable_argsort

MAX_DISTANCE = 1.03
"""Largest distance of two beads that may touch, in sums of radii, but for errors."""

# Errors of positions and radii that this distance may be larger by.
_DISTANCE_SIGMAS = 2.0
# Relative error of a radius from an uneven outline and the light.
_OUTLINE_ERROR = 0.02
SHIFT = 32
"""Bits of the number of the second bead in a key."""


class SeenBeads(NamedTuple):
    """Visible beads of one frame.

    Parameters
    ----------
    ids : ndarray of int64, (n,)
        Ascending.
    positions : ndarray (n, 2), [m]
        Any common origin.
    errors, radii, radius_errors : ndarray (n,), [m]
    variances : ndarray (n,), [m^2/s^2]
        Mean square of a velocity component of a free bead of this kind at this position.
    height : float, [m]
        Height of the tray.
    """

    ids: NDArray[np.int64]
    positions: NDArray[np.float64]
    errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    variances: NDArray[np.float64]
    height: float


@compiled
def touching_pairs(
    beads: SeenBeads,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Find the pairs that may touch: keys and rows of both beads, each (n,).

    Their distance in the image is at most the sum of the radii, and at least what the height of
    the tray allows for beads above each other.
    """
    n = beads.ids.size
    variances = np.empty(n)
    largest_reach = 0.0
    for i in range(n):
        error = beads.radius_errors[i]
        outline_error = _OUTLINE_ERROR * beads.radii[i] if error > 0.0 else 0.0
        variances[i] = (
            error * error + outline_error * outline_error + beads.errors[i] * beads.errors[i]
        )
        largest_reach = max(
            largest_reach,
            MAX_DISTANCE * beads.radii[i] + _DISTANCE_SIGMAS * math.sqrt(variances[i]),
        )
    # Sorted by column, so that only beads nearby are compared.
    order = stable_argsort(beads.positions[:, 0].copy())
    keys, first, second = np.empty((3, 4 * n), dtype=np.int64)
    count = 0
    for rank in range(n):
        for other_rank in range(rank + 1, n):
            i, j = min(order[rank], order[other_rank]), max(order[rank], order[other_rank])
            x = beads.positions[order[other_rank], 0] - beads.positions[order[rank], 0]
            if x >= 2.0 * largest_reach:
                break
            if not _may_touch(beads, variances, x, i, j):
                continue
            if count == keys.size:
                keys, first, second = _doubled(keys), _doubled(first), _doubled(second)
            keys[count] = (beads.ids[i] << SHIFT) | beads.ids[j]
            first[count], second[count] = i, j
            count += 1
    by_key = stable_argsort(keys[:count])
    return keys[by_key], first[by_key], second[by_key]


@compiled
def _doubled(values: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate((values, np.empty_like(values)))


@compiled
def _may_touch(
    beads: SeenBeads, variances: NDArray[np.float64], dx: float, i: int, j: int
) -> bool:
    """Whether two beads may touch, `dx` apart along a row of the image."""
    dy = beads.positions[j, 1] - beads.positions[i, 1]
    distance = math.sqrt(dx * dx + dy * dy)
    radii = beads.radii[i] + beads.radii[j]
    slack = _DISTANCE_SIGMAS * math.sqrt(variances[i] + variances[j])
    if distance >= MAX_DISTANCE * radii + slack:
        return False
    height_difference = max(beads.height - radii, 0.0)
    return (
        distance
        > math.sqrt(max(radii * radii - height_difference * height_difference, 0.0)) / MAX_DISTANCE
        - slack
    )
