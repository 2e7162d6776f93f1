"""Edges of a bead: steps of the darkness or the hue along rays from its centre.

Tested by ``test/stages/tracking/detection/test_bead_detector.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined
from nanorocks_ros.stages.tracking.detection.ray_samples import (
    Samples,
    allocate_samples,
    find_edges,
    sample_rays,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.detection.pixel_classes import PixelMaps

RAYS = 32
"""Number of directions in which edges of a bead are searched."""
MAX_CURVATURE, CURVATURES = 0.5, 33
"""Largest 1 / radius at which biases by blur are known [1/px], and number of curvatures from 0."""
EDGE_CLEARANCE_PX, SAMPLE_CLEARANCE_PX = 2.5, 2.0
"""Smallest distances of an edge, and of the outermost sample beside it, from another bead, [px].

A sample in the blurred outline of another bead passes for a darker floor and moves the edge
inward: beads of 13 px seemed 0.11 px further from others at gaps of 2 to 3 px.
"""
MAX_REACH_PX = 3
"""Largest distance along a ray within which an edge is searched, [px]."""

_ANGLES = 2.0 * np.pi * (np.arange(RAYS) + 0.5) / RAYS
COSINES, SINES = np.cos(_ANGLES), np.sin(_ANGLES)
"""Directions of the rays."""
# Red minus blue at an edge between two species, in gray levels: smallest step, and largest value
# outside.
_MIN_HUE_STEP = 30.0
_MAX_OUTSIDE_HUE = 20.0
_MAX_NEIGHBOURS = 24
# Radius from which edges are searched within 3 px; within 2 px below.
_LARGE_RADIUS_PX = 6.0
# Distance of an edge from the circle at which its weight is one half, [px].
_HALF_WEIGHT_PX = 0.35


class EdgeMaps(NamedTuple):
    """Flattened maps of a `PixelMaps` in which edges are searched.

    Parameters
    ----------
    darkness : ndarray of uint8, (pixels,)
    hue : ndarray of int16, (pixels,)
    shifts, biases
        See `PixelMaps`.
    rows, columns : int
    min_step, max_outside : float
        See `PixelMaps.edge_levels`.
    """

    darkness: NDArray[np.uint8]
    hue: NDArray[np.int16]
    shifts: NDArray[np.float64]
    biases: NDArray[np.float64]
    rows: int
    columns: int
    min_step: float
    max_outside: float


@compiled
def edge_maps(pixels: PixelMaps) -> EdgeMaps:
    """Flatten the maps in which edges are searched."""
    rows, columns = pixels.darkness.shape
    min_step, max_outside = pixels.edge_levels
    return EdgeMaps(
        pixels.darkness.reshape(-1),
        pixels.hue.reshape(-1),
        pixels.shifts,
        pixels.biases,
        rows,
        columns,
        min_step,
        max_outside,
    )


def edges_between(profiles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Edges that `find_edges` finds on profiles, (n,): distances from the middle, [px].

    Parameters
    ----------
    profiles : ndarray (n, 2 reach + 1)
        Levels 1 px apart, from the inside to the outside.
    """
    reach = profiles.shape[1] // 2
    outside = profiles[:, -2:].mean(axis=1, keepdims=True)
    step = profiles[:, :2].mean(axis=1, keepdims=True) - outside
    with np.errstate(divide='ignore', invalid='ignore'):
        shares = np.clip((profiles - outside) / step, 0.0, 1.0)
    shares[:, 0], shares[:, -1] = 1.0, 0.0
    return np.asarray(shares.sum(axis=1) - (reach + 0.5))


class Rays(NamedTuple):
    """Work space of a circle fit.

    Parameters
    ----------
    neighbours : ndarray (24, 4), [px]
        Discs around: column, row, and the squared distances within which an edge is hidden and
        within which the sample outside it is.
    ends : ndarray (2, rays), [px]
        Column and row where each ray crosses the circle; the first pixel is centred at (0, 0).
    hidden : ndarray of uint8, (rays,)
        1 where that is on or beside another bead, or at the border of the image.
    active : ndarray of int64, (rays,)
        Indices of the rays in work.
    edges, weights : ndarrays (rays,)
        Distance of the edge from the circle [px], NaN without an edge, and its weight.
    samples : Samples
    """

    neighbours: NDArray[np.float64]
    ends: NDArray[np.float64]
    hidden: NDArray[np.uint8]
    active: NDArray[np.int64]
    edges: NDArray[np.float64]
    weights: NDArray[np.float64]
    samples: Samples


@compiled
def allocate_rays() -> Rays:
    """Allocate uninitialised arrays."""
    return Rays(
        np.empty((_MAX_NEIGHBOURS, 4)),
        np.empty((2, RAYS)),
        np.empty(RAYS, dtype=np.uint8),
        np.empty(RAYS, dtype=np.int64),
        np.empty(RAYS),
        np.empty(RAYS),
        allocate_samples(RAYS),
    )


@inlined
def _place_rays(
    disc: tuple[float, float, float],
    reach: int,
    maps: EdgeMaps,
    neighbours: int,
    rays: Rays,
) -> None:
    """Compute the ends of the rays of a circle, and whether an edge is hidden there."""
    columns, rows, hidden = rays.ends[0], rays.ends[1], rays.hidden
    x, y, radius = disc
    for k in range(RAYS):
        columns[k], rows[k] = x + radius * COSINES[k], y + radius * SINES[k]
        hidden[k] = 0
    for n in range(neighbours):
        edge_square, sample_square = rays.neighbours[n, 2], rays.neighbours[n, 3]
        other_x, other_y = rays.neighbours[n, 0], rays.neighbours[n, 1]
        for k in range(RAYS):
            dx, dy = other_x - columns[k], other_y - rows[k]
            hidden[k] |= np.uint8(dx * dx + dy * dy < edge_square)
            dx, dy = dx - reach * COSINES[k], dy - reach * SINES[k]
            hidden[k] |= np.uint8(dx * dx + dy * dy < sample_square)
    for k in range(RAYS):
        # Pixel centres are at halves.
        column, row = columns[k] - 0.5, rows[k] - 0.5
        column_reach, row_reach = reach * abs(COSINES[k]), reach * abs(SINES[k])
        outside_image = (column - column_reach < 0.0) | (row - row_reach < 0.0)
        outside_image |= (column + column_reach + 1.0 >= maps.columns) | (
            row + row_reach + 1.0 >= maps.rows
        )
        columns[k], rows[k] = column, row
        hidden[k] |= np.uint8(outside_image)


@inlined
def _find_edges(
    pixels: NDArray[np.integer[Any]],
    width: int,
    levels: tuple[float, float, float],
    reach: int,
    stride: int,
    rays: Rays,
) -> None:
    """Search the edges that are neither hidden nor found yet, on every `stride`-th ray.

    `levels` are the sign of the step, the smallest step and the largest value outside.
    """
    count = 0
    for k in range(0, RAYS, stride):
        rays.active[count] = k
        count += (rays.hidden[k] == 0) & (rays.edges[k] != rays.edges[k])
    if not count:
        return
    sign, min_step, max_outside = levels
    samples = rays.samples
    for q in range(count):
        ray = np.uint64(rays.active[q])
        samples.starts[0, q], samples.starts[1, q] = rays.ends[0, ray], rays.ends[1, ray]
        samples.steps[0, q], samples.steps[1, q] = COSINES[ray], SINES[ray]
    sample_rays(pixels, width, sign, reach, count, samples)
    find_edges(reach, min_step, max_outside, count, samples)
    for q in range(count):
        rays.edges[rays.active[q]] = samples.edges[q]


@inlined
def _bias_by_blur(biases: NDArray[np.float64], radius: float) -> float:
    """Distance of the edge from the outline, interpolated over the curvature, [px]."""
    column = min(1.0 / radius, MAX_CURVATURE) / MAX_CURVATURE * (CURVATURES - 1)
    left = min(int(column), CURVATURES - 2)
    return float(biases[left] + (column - left) * (biases[left + 1] - biases[left]))


@inlined
def normal_equations(
    maps: EdgeMaps,
    hue_sign: float,
    disc: tuple[float, float, float],
    neighbours: int,
    stride: int,
    robust: bool,
    rays: Rays,
) -> tuple[int, float, tuple[float, float, float], float, float, float, float, float, float]:
    """Normal equations of a circle fit through the edges.

    Parameters
    ----------
    maps, hue_sign, neighbours, rays
        See `fit_circle`.
    disc : tuple of 3 floats, [px]
    stride : int
        Every `stride`-th ray is used.
    robust : bool
        Whether edges far from the circle get a smaller weight.

    Returns
    -------
    int, float
        Number of edges, and their weighted squared distances.
    tuple of 3 floats
        Right-hand sides for column, row and radius.
    floats
        Upper triangle of the matrix, row by row.
    """
    reach = MAX_REACH_PX if disc[2] >= _LARGE_RADIUS_PX else MAX_REACH_PX - 1
    _place_rays(disc, reach, maps, neighbours, rays)
    edges, weights = rays.edges, rays.weights
    for k in range(RAYS):
        edges[k] = np.nan
    _find_edges(
        maps.darkness, maps.columns, (1.0, maps.min_step, maps.max_outside), reach, stride, rays
    )
    bias, shifts = _bias_by_blur(maps.biases[reach - 2], disc[2]), maps.shifts[reach - 2]
    for k in range(RAYS):
        edges[k] -= bias + shifts[k]
    if hue_sign != 0.0:
        # Against a bead of another species the hue has a step.
        _find_edges(
            maps.hue,
            maps.columns,
            (hue_sign, _MIN_HUE_STEP, _MAX_OUTSIDE_HUE),
            reach,
            stride,
            rays,
        )
    for k in range(RAYS):
        off = edges[k] / _HALF_WEIGHT_PX
        weights[k] = 1.0 / (1.0 + off * off) if robust else 1.0
    seen, total = 0, 0.0
    xx, xy, yy, xr, yr, rr = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    side_x, side_y, side_r = 0.0, 0.0, 0.0
    for k in range(0, RAYS, stride):
        edge, weight = edges[k], weights[k]
        if edge != edge:
            continue
        c, s = COSINES[k], SINES[k]
        seen += 1
        total += weight * edge * edge
        side_x += weight * c * edge
        side_y += weight * s * edge
        side_r += weight * edge
        xx += weight * c * c
        xy += weight * c * s
        yy += weight * s * s
        xr += weight * c
        yr += weight * s
        rr += weight
    return seen, total, (side_x, side_y, side_r), xx, xy, xr, yy, yr, rr
