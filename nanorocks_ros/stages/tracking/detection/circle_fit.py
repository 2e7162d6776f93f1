"""The outline of a bead with sub-pixel accuracy: a circle through its edges."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.numerics.compiled import compiled, kernel
from nanorocks_ros.stages.tracking.detection.bead_edges import (
    NEAR_PX,
    RAYS,
    Planes,
    Rays,
    add_edges,
    planes_of,
    room_for_rays,
)
from nanorocks_ros.stages.tracking.detection.pixel_classes import Picture

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_ROUNDS = 3
# A smaller outline has fewer pixels than rays: every other ray does.
_ALL_RAYS_FROM_PX = 8.0
# A step that needs no further one, [px].
_SETTLED_PX = 0.06
# Neighbouring rays see the same pixels; what a scatter of nothing would still hide, [px].
_CORRELATED = 1.6
_LEAST_SCATTER_PX = 0.06
# How far a circle without edges may be from where it was guessed, [px].
_GUESS_PX = 1.5
# Share of an outline that is enough.
_ENOUGH = 0.35


@kernel
def find_neighbours(discs: NDArray[np.float64], own: int, count: int, rays: Rays) -> int:
    """How many discs touch, hide or nearly touch one, while it moves a little: see `Rays`."""
    x, y, radius = discs[own, 0], discs[own, 1], discs[own, 2]
    n = 0
    for k in range(count):
        reach = discs[k, 2] + radius + NEAR_PX + _GUESS_PX
        dx, dy = discs[k, 0] - x, discs[k, 1] - y
        if dx * dx + dy * dy < reach * reach and k != own and n < rays.neighbours.shape[0]:
            near = discs[k, 2] + 0.5 * NEAR_PX
            rays.neighbours[n, 0], rays.neighbours[n, 1] = discs[k, 0], discs[k, 1]
            rays.neighbours[n, 2] = near * near
            n += 1
    return n


@kernel
def fit_circle(
    planes: Planes,
    hue_sign: float,
    disc: NDArray[np.float64],
    neighbours: int,
    expected: NDArray[np.float64],
    fit: NDArray[np.float64],
    rays: Rays,
) -> None:
    """Fit a circle to the outline of one bead among others.

    Parameters
    ----------
    planes : Planes
    hue_sign : float
        1 for a red, -1 for a blue, 0 for a gray bead.
    disc : ndarray (3,), [px]
        Column, row and radius; changed.
    neighbours : int
        Of `find_neighbours`, which are in `rays`.
    expected : ndarray (2,), [px]
        Radius and its standard deviation.
    fit : ndarray (3 or more,)
        Written: error of a coordinate and of the radius [px], share of the outline seen.
    rays : Rays
    """
    x, y, radius = disc[0], disc[1], disc[2]
    start_x, start_y = x, y
    every = 1 if radius >= _ALL_RAYS_FROM_PX else 2
    column_variance, row_variance, radius_variance = 0.0, 0.0, 0.0
    seen, scatter2 = 0, 0.0
    for turn in range(_ROUNDS):
        seen, total, sides, xx, xy, xr, yy, yr, rr = add_edges(
            planes, hue_sign, (x, y, radius), neighbours, every, turn > 0, rays
        )
        scatter2 = total / max(seen - 3, 1)
        prior = max(scatter2, _LEAST_SCATTER_PX * _LEAST_SCATTER_PX)
        # What is known of the size and of the place, as further edges of the same scatter.
        size_weight = prior / (expected[1] * expected[1])
        place_weight = prior / (_GUESS_PX * _GUESS_PX)
        xx += place_weight
        yy += place_weight
        rr += size_weight
        side_x = sides[0] + place_weight * (start_x - x)
        side_y = sides[1] + place_weight * (start_y - y)
        side_r = sides[2] + size_weight * (expected[0] - radius)
        # The inverse of the symmetric matrix.
        c_xx, c_xy, c_xr = yy * rr - yr * yr, xr * yr - xy * rr, xy * yr - xr * yy
        c_yy, c_yr, c_rr = xx * rr - xr * xr, xy * xr - xx * yr, xx * yy - xy * xy
        determinant = xx * c_xx + xy * c_xy + xr * c_xr
        c_xx, c_xy, c_xr = c_xx / determinant, c_xy / determinant, c_xr / determinant
        c_yy, c_yr, c_rr = c_yy / determinant, c_yr / determinant, c_rr / determinant
        step_x = c_xx * side_x + c_xy * side_y + c_xr * side_r
        step_y = c_xy * side_x + c_yy * side_y + c_yr * side_r
        step_r = c_xr * side_x + c_yr * side_y + c_rr * side_r
        x += min(max(step_x, -2.0), 2.0)
        y += min(max(step_y, -2.0), 2.0)
        radius = max(radius + min(max(step_r, -2.0), 2.0), 1.5)
        column_variance, row_variance, radius_variance = c_xx, c_yy, c_rr
        if turn > 0 and max(abs(step_x), max(abs(step_y), abs(step_r))) < _SETTLED_PX:
            break
    disc[0], disc[1], disc[2] = x, y, radius
    spread = _CORRELATED * (scatter2 + _LEAST_SCATTER_PX * _LEAST_SCATTER_PX)
    fit[0] = math.sqrt(0.5 * spread * (column_variance + row_variance))
    fit[1] = math.sqrt(spread * radius_variance)
    fit[2] = seen * every / RAYS


@compiled
def refit(
    picture: Picture,
    hue_sign: float,
    discs: NDArray[np.float64],
    first: int,
    count: int,
    expected: NDArray[np.float64],
    fits: NDArray[np.float64],
) -> None:
    """Fit the circles of one species again, now that all their neighbours are known.

    Parameters
    ----------
    picture, hue_sign, expected
        See `fit_circle`.
    discs : ndarray (n, 3), [px]
        Of all species; `count` of them from `first` on are replaced.
    fits : ndarray (count, 4)
        First three columns written, see `fit_circle`.
    """
    alone = discs[first : first + count].copy()
    _refit(planes_of(picture), hue_sign, discs, first, alone, expected, fits, room_for_rays())


@kernel
def _refit(
    planes: Planes,
    hue_sign: float,
    discs: NDArray[np.float64],
    first: int,
    alone: NDArray[np.float64],
    expected: NDArray[np.float64],
    fits: NDArray[np.float64],
    rays: Rays,
) -> None:
    """See `refit`; `alone` are the discs of the species, which know of no others."""
    count = alone.shape[0]
    for k in range(count):
        disc, fit = discs[first + k], fits[k]
        neighbours = find_neighbours(discs, first + k, discs.shape[0], rays)
        if not neighbours:
            continue
        x, y, radius = disc[0], disc[1], disc[2]
        fit_circle(planes, hue_sign, disc, neighbours, expected, fit, rays)
        if fit[2] < _ENOUGH and hue_sign != 0.0:
            # Edges against the other species show in the colour.
            alone[k, 0], alone[k, 1], alone[k, 2] = x, y, radius
            neighbours = find_neighbours(alone, k, count, rays)
            fit_circle(planes, hue_sign, alone[k], neighbours, expected, fit, rays)
            disc[0], disc[1], disc[2] = alone[k, 0], alone[k, 1], alone[k, 2]
