"""Circle fit: the outline of a bead with sub-pixel accuracy.

Tested by ``test/stages/tracking/detection/test_bead_detector.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.numerics.compiled import compiled, kernel
from nanorocks_ros.stages.tracking.detection.bead_edges import (
    EDGE_CLEARANCE_PX,
    MAX_REACH_PX,
    RAYS,
    SAMPLE_CLEARANCE_PX,
    EdgeMaps,
    Rays,
    allocate_rays,
    edge_maps,
    normal_equations,
)
from nanorocks_ros.stages.tracking.detection.pixel_classes import PixelMaps

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_ITERATIONS = 3
# Radius below which every other ray is used: the outline has fewer pixels than rays.
_LARGE_RADIUS_PX = 8.0
# Step below which the iteration has converged, [px].
_CONVERGED_PX = 0.06
# Variance factor, as neighbouring rays share pixels; and smallest scatter of an edge, [px].
_CORRELATION_FACTOR = 1.6
_MIN_SCATTER_PX = 0.06
# Standard error of the start position, [px].
_START_ERROR_PX = 1.5
# Visible share of the outline below which the fit is repeated without other species.
_MIN_VISIBLE_OUTLINE = 0.35


@kernel
def find_neighbours(discs: NDArray[np.float64], row: int, count: int, rays: Rays) -> int:
    """Write the discs that may hide edges of one disc to `rays`; return their number."""
    x, y, radius = discs[row, 0], discs[row, 1], discs[row, 2]
    n = 0
    for k in range(count):
        clearance = MAX_REACH_PX + SAMPLE_CLEARANCE_PX + _START_ERROR_PX
        reach = discs[k, 2] + radius + clearance
        dx, dy = discs[k, 0] - x, discs[k, 1] - y
        if dx * dx + dy * dy < reach * reach and k != row and n < rays.neighbours.shape[0]:
            of_edge, of_sample = discs[k, 2] + EDGE_CLEARANCE_PX, discs[k, 2] + SAMPLE_CLEARANCE_PX
            rays.neighbours[n, 0], rays.neighbours[n, 1] = discs[k, 0], discs[k, 1]
            rays.neighbours[n, 2], rays.neighbours[n, 3] = of_edge * of_edge, of_sample * of_sample
            n += 1
    return n


@kernel
def fit_circle(
    maps: EdgeMaps,
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
    maps : EdgeMaps
    hue_sign : float
        1 for a red, -1 for a blue, 0 for a gray bead.
    disc : ndarray (3,), [px]
        Column, row and radius; changed.
    neighbours : int
        Number of neighbours in `rays`, from `find_neighbours`.
    expected : ndarray (2,), [px]
        Radius and its standard deviation.
    fit : ndarray (3 or more,)
        Written: error of a coordinate and of the radius [px], visible share of the outline.
    rays : Rays
    """
    x, y, radius = disc[0], disc[1], disc[2]
    start_x, start_y = x, y
    stride = 1 if radius >= _LARGE_RADIUS_PX else 2
    column_variance, row_variance, radius_variance = 0.0, 0.0, 0.0
    seen, scatter2 = 0, 0.0
    for iteration in range(_ITERATIONS):
        seen, total, sides, xx, xy, xr, yy, yr, rr = normal_equations(
            maps, hue_sign, (x, y, radius), neighbours, stride, iteration > 0, rays
        )
        scatter2 = total / max(seen - 3, 1)
        prior = max(scatter2, _MIN_SCATTER_PX * _MIN_SCATTER_PX)
        # Priors of radius and position, as additional edges of the same scatter.
        size_weight = prior / (expected[1] * expected[1])
        position_weight = prior / (_START_ERROR_PX * _START_ERROR_PX)
        xx += position_weight
        yy += position_weight
        rr += size_weight
        side_x = sides[0] + position_weight * (start_x - x)
        side_y = sides[1] + position_weight * (start_y - y)
        side_r = sides[2] + size_weight * (expected[0] - radius)
        # Inverse of the symmetric matrix.
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
        if iteration > 0 and max(abs(step_x), max(abs(step_y), abs(step_r))) < _CONVERGED_PX:
            break
    disc[0], disc[1], disc[2] = x, y, radius
    spread = _CORRELATION_FACTOR * (scatter2 + _MIN_SCATTER_PX * _MIN_SCATTER_PX)
    fit[0] = math.sqrt(0.5 * spread * (column_variance + row_variance))
    fit[1] = math.sqrt(spread * radius_variance)
    fit[2] = seen * stride / RAYS


@compiled
def refit_circles(
    pixels: PixelMaps,
    hue_sign: float,
    discs: NDArray[np.float64],
    first: int,
    count: int,
    expected: NDArray[np.float64],
    fits: NDArray[np.float64],
) -> None:
    """Fit the circles of one species again, with all neighbours known.

    Parameters
    ----------
    pixels, hue_sign, expected
        See `fit_circle`.
    discs : ndarray (n, 3), [px]
        Discs of all species; `count` rows from `first` on are replaced.
    fits : ndarray (count, 4)
        The first three columns are written, see `fit_circle`.
    """
    same_species = discs[first : first + count].copy()
    _refit_circles(
        edge_maps(pixels), hue_sign, discs, first, same_species, expected, fits, allocate_rays()
    )


@kernel
def _refit_circles(
    maps: EdgeMaps,
    hue_sign: float,
    discs: NDArray[np.float64],
    first: int,
    same_species: NDArray[np.float64],
    expected: NDArray[np.float64],
    fits: NDArray[np.float64],
    rays: Rays,
) -> None:
    """See `refit_circles`; `same_species` are the discs of this species only."""
    count = same_species.shape[0]
    for k in range(count):
        disc, fit = discs[first + k], fits[k]
        neighbours = find_neighbours(discs, first + k, discs.shape[0], rays)
        if not neighbours:
            continue
        x, y, radius = disc[0], disc[1], disc[2]
        fit_circle(maps, hue_sign, disc, neighbours, expected, fit, rays)
        if fit[2] < _MIN_VISIBLE_OUTLINE and hue_sign != 0.0:
            # Edges against other species are visible in the hue.
            same_species[k, 0], same_species[k, 1], same_species[k, 2] = x, y, radius
            neighbours = find_neighbours(same_species, k, count, rays)
            fit_circle(maps, hue_sign, same_species[k], neighbours, expected, fit, rays)
            disc[0], disc[1], disc[2] = same_species[k, 0], same_species[k, 1], same_species[k, 2]
