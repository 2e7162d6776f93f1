"""Edges of a bead: where the darkness or the hue has a step, along rays from its middle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined
from nanorocks_ros.stages.tracking.detection.ray_samples import (
    Samples,
    find_edges,
    look_along,
    room_for_samples,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.detection.pixel_classes import Picture

RAYS = 32
"""Directions in which the edge of a bead is looked for."""
NEAR_PX = 5.0
"""An edge nearer to another bead is no edge against the floor, [px]."""

_ANGLES = 2.0 * np.pi * (np.arange(RAYS) + 0.5) / RAYS
_COSINES, _SINES = np.cos(_ANGLES), np.sin(_ANGLES)
# Of 255: what counts as floor beyond the outline, and the least step of an edge.
_FLOOR_DARKNESS = 80.0
_LEAST_STEP = 60.0
# Gray levels of red minus blue across an edge between two species.
_LEAST_HUE_STEP = 30.0
_OTHER_HUE = 20.0
_MOST_NEIGHBOURS = 24
# Of a bead so large, edges are looked for within 3 px, else 2.
_FAR_FROM_PX = 6.0
# An edge off the circle by so many pixels counts half.
_HALF_WEIGHT_PX = 0.35


class Planes(NamedTuple):
    """The parts of a `Picture` that have edges, row by row.

    Parameters
    ----------
    darkness : ndarray of uint8, (pixels,)
    hue : ndarray of int16, (pixels,)
    rows, columns : int
    """

    darkness: NDArray[np.uint8]
    hue: NDArray[np.int16]
    rows: int
    columns: int


@compiled
def planes_of(picture: Picture) -> Planes:
    """Where to look for edges."""
    rows, columns = picture.darkness.shape
    return Planes(picture.darkness.reshape(-1), picture.hue.reshape(-1), rows, columns)


class Rays(NamedTuple):
    """Room for the fits of one circle after the other.

    Parameters
    ----------
    neighbours : ndarray (most, 3), [px]
        Of the discs around: column, row, and the square of the distance within which an edge is
        hidden.
    ends : ndarray (2, rays), [px]
        Column and row where each ray crosses the circle, from the centre of the first pixel on.
    hidden : ndarray of uint8, (rays,)
        1 where it does so on or beside another bead, or at the end of the picture.
    some : ndarray of int64, (rays,)
        Numbers of the rays that are being looked at.
    edges, weights : ndarrays (rays,)
        Distance of the edge from the circle [px], NaN where there is none, and its weight.
    samples : Samples
    """

    neighbours: NDArray[np.float64]
    ends: NDArray[np.float64]
    hidden: NDArray[np.uint8]
    some: NDArray[np.int64]
    edges: NDArray[np.float64]
    weights: NDArray[np.float64]
    samples: Samples


@compiled
def room_for_rays() -> Rays:
    """Room that nothing is written in yet."""
    return Rays(
        np.empty((_MOST_NEIGHBOURS, 3)),
        np.empty((2, RAYS)),
        np.empty(RAYS, dtype=np.uint8),
        np.empty(RAYS, dtype=np.int64),
        np.empty(RAYS),
        np.empty(RAYS),
        room_for_samples(RAYS),
    )


@inlined
def _lay_rays(
    disc: tuple[float, float, float],
    reach: int,
    planes: Planes,
    neighbours: int,
    rays: Rays,
) -> None:
    """Where the rays of a circle end, and whether an edge can be seen there."""
    columns, rows, hidden = rays.ends[0], rays.ends[1], rays.hidden
    x, y, radius = disc
    for k in range(RAYS):
        columns[k], rows[k] = x + radius * _COSINES[k], y + radius * _SINES[k]
        hidden[k] = 0
    for n in range(neighbours):
        near2 = rays.neighbours[n, 2]
        other_x, other_y = rays.neighbours[n, 0], rays.neighbours[n, 1]
        for k in range(RAYS):
            dx, dy = other_x - columns[k], other_y - rows[k]
            hidden[k] |= np.uint8(dx * dx + dy * dy < near2)
    for k in range(RAYS):
        # Pixel centres are at halves.
        column, row = columns[k] - 0.5, rows[k] - 0.5
        aside, along = reach * abs(_COSINES[k]), reach * abs(_SINES[k])
        beyond = (column - aside < 0.0) | (row - along < 0.0)
        beyond |= (column + aside + 1.0 >= planes.columns) | (row + along + 1.0 >= planes.rows)
        columns[k], rows[k] = column, row
        hidden[k] |= np.uint8(beyond)


@inlined
def _edges_in(
    pixels: NDArray[np.integer[Any]],
    width: int,
    levels: tuple[float, float, float],
    reach: int,
    every: int,
    rays: Rays,
) -> None:
    """Look for the edges that are neither hidden nor found yet, of every so many-th ray.

    `levels` are the sign of the step, the least one and the most outside.
    """
    count = 0
    for k in range(0, RAYS, every):
        rays.some[count] = k
        count += (rays.hidden[k] == 0) & (rays.edges[k] != rays.edges[k])
    if not count:
        return
    sign, least, most_outside = levels
    samples = rays.samples
    for q in range(count):
        ray = np.uint64(rays.some[q])
        samples.starts[0, q], samples.starts[1, q] = rays.ends[0, ray], rays.ends[1, ray]
        samples.steps[0, q], samples.steps[1, q] = _COSINES[ray], _SINES[ray]
    look_along(pixels, width, sign, reach, count, samples)
    find_edges(reach, least, most_outside, count, samples)
    for q in range(count):
        rays.edges[rays.some[q]] = samples.edges[q]


@inlined
def add_edges(
    planes: Planes,
    hue_sign: float,
    disc: tuple[float, float, float],
    neighbours: int,
    every: int,
    robust: bool,
    rays: Rays,
) -> tuple[int, float, tuple[float, float, float], float, float, float, float, float, float]:
    """Normal equations of a circle through the edges.

    Parameters
    ----------
    planes, hue_sign, neighbours, rays
        See `fit_circle`.
    disc : tuple of 3 floats, [px]
    every : int
        Of so many rays one is used.
    robust : bool
        Whether edges far from the circle weigh less.

    Returns
    -------
    int, float
        How many edges, and their weighted squares.
    tuple of 3 floats
        Right sides, of column, row and radius.
    floats
        Upper triangle of the matrix, row by row.
    """
    reach = 3 if disc[2] >= _FAR_FROM_PX else 2
    _lay_rays(disc, reach, planes, neighbours, rays)
    edges, weights = rays.edges, rays.weights
    for k in range(RAYS):
        edges[k] = np.nan
    _edges_in(
        planes.darkness, planes.columns, (1.0, _LEAST_STEP, _FLOOR_DARKNESS), reach, every, rays
    )
    if hue_sign != 0.0:
        # Against another species it is the hue that has a step.
        _edges_in(
            planes.hue, planes.columns, (hue_sign, _LEAST_HUE_STEP, _OTHER_HUE), reach, every, rays
        )
    for k in range(RAYS):
        off = edges[k] / _HALF_WEIGHT_PX
        weights[k] = 1.0 / (1.0 + off * off) if robust else 1.0
    seen, total = 0, 0.0
    xx, xy, yy, xr, yr, rr = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    side_x, side_y, side_r = 0.0, 0.0, 0.0
    for k in range(0, RAYS, every):
        edge, weight = edges[k], weights[k]
        if edge != edge:
            continue
        c, s = _COSINES[k], _SINES[k]
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
