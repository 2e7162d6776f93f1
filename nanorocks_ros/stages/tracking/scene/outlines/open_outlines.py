"""Discs that are the end of something longer that moves, such as a finger.

Tested by ``test/stages/tracking/scene/outlines/test_open_outlines.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Outlines with edges on less than this share are looked at.
_MOST_SUPPORT = 0.8
_RAYS = 24
# Places along a ray that all have the colour of the inside, in radii, and what they may differ by,
# over the difference of inside and around.
_PLACES, _SAME_COLOUR = (0.85, 1.0, 1.15, 1.3), 0.4
# Successive open rays of an end. A smeared bead is open on the other side as well.
_LEAST_OPEN = 4


def ends_of_others(
    color: NDArray[np.uint8],
    moving: NDArray[np.uint8],
    discs: NDArray[np.float64],
    support: NDArray[np.float64],
    colours: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> NDArray[np.bool_]:
    """Which discs go on beyond their outline, on one side, and not in another disc.

    Parameters
    ----------
    color : ndarray of uint8, (rows, columns, 3), bgr
    moving : ndarray of uint8, (rows, columns)
        1 where the picture differs from the background: a wall of the colour of the beads is not
        part of a bead that touches it.
    discs : ndarray (n, 3)
        Column, row, radius.
    support : ndarray (n,)
        Share of each outline that has edges.
    colours : tuple of 2 ndarrays (n, 3)
        Inside and around.
    """
    ends = support < _MOST_SUPPORT
    open_rays = _open_rays(color, moving, discs[ends], (colours[0][ends], colours[1][ends]))
    ends[ends] = _are_ends(open_rays)
    for k in np.flatnonzero(ends):
        # Few are left: a neighbour explains the other ones.
        others = np.delete(discs, k, axis=0)
        x, y = _places(discs[k : k + 1], _PLACES[-1])
        away = np.hypot(x[0, :, None] - others[:, 0], y[0, :, None] - others[:, 1])
        rays = _open_rays(color, moving, discs[k : k + 1], (colours[0][k], colours[1][k]))
        ends[k] = _are_ends(rays & (away > others[:, 2]).all(axis=1))[0]
    return np.asarray(ends)


def _open_rays(
    color: NDArray[np.uint8],
    moving: NDArray[np.uint8],
    discs: NDArray[np.float64],
    colours: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> NDArray[np.bool_]:
    """Rays on which the inside goes on beyond the outline, (n, _RAYS)."""
    inside, around = (np.atleast_2d(values) for values in colours)
    limits = _SAME_COLOUR * np.linalg.norm(inside - around, axis=1)
    rows, columns = moving.shape
    are_open = np.ones((len(discs), _RAYS), dtype=bool)
    for part in reversed(_PLACES):
        x, y = _places(discs, part)
        are_open &= (x >= 0.0) & (x <= columns - 1.0) & (y >= 0.0) & (y <= rows - 1.0)
        column = np.clip(np.rint(x), 0, columns - 1).astype(np.intp)
        row = np.clip(np.rint(y), 0, rows - 1).astype(np.intp)
        are_open &= moving[row, column] > 0
        off = np.linalg.norm(color[row, column] - inside[:, None], axis=2)
        are_open &= off < limits[:, None]
    return are_open


def _places(
    discs: NDArray[np.float64], part: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Columns and rows at this part of the radius on each ray, (n, _RAYS)."""
    turns = 2.0 * math.pi * np.arange(_RAYS) / _RAYS
    ways = part * discs[:, 2:]
    return discs[:, :1] + ways * np.cos(turns), discs[:, 1:2] + ways * np.sin(turns)


def _are_ends(are_open: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether enough successive rays are open, and none of those opposite, (n,)."""
    runs = np.all([np.roll(are_open, k, axis=1) for k in range(_LEAST_OPEN)], axis=0)
    opposite = are_open & np.roll(are_open, _RAYS // 2, axis=1)
    return np.asarray(runs.any(axis=1) & ~opposite.any(axis=1))
