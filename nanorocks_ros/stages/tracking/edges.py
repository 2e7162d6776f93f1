"""Edges of a bead: where the darkness or the hue has a step, along rays from its middle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nanorocks_ros.physics.compiled import compiled, inlined, kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.pixels import Picture

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
# Places along a ray where a picture is looked at.
_MOST_SAMPLES = 7
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


class Samples(NamedTuple):
    """What a picture shows along rays: of all of them inside first, then further outside.

    Parameters
    ----------
    starts, steps : ndarrays (2, rays), [px]
        Of each ray: column and row of its end, and of one step along it.
    places : ndarray of int32, (places,)
        The pixel to the upper left of each place, counted from the first one, row by row.
    right, down : ndarrays (places,)
        Share of the way to the next pixel.
    corners : ndarray of int32, (4, places)
        Of the four pixels around: upper left, upper right, lower left, lower right.
    values : ndarray (places,)
        Between the pixels.
    outside, step, edges : ndarrays (rays,)
        Of each ray: the value outside, the step from there, and the distance of the edge.
    """

    starts: NDArray[np.float64]
    steps: NDArray[np.float64]
    places: NDArray[np.int32]
    right: NDArray[np.float64]
    down: NDArray[np.float64]
    corners: NDArray[np.int32]
    values: NDArray[np.float64]
    outside: NDArray[np.float64]
    step: NDArray[np.float64]
    edges: NDArray[np.float64]


@compiled
def room_for_rays() -> Rays:
    """Room that nothing is written in yet."""
    samples = Samples(
        np.empty((2, RAYS)),
        np.empty((2, RAYS)),
        np.empty(_MOST_SAMPLES * RAYS, dtype=np.int32),
        np.empty(_MOST_SAMPLES * RAYS),
        np.empty(_MOST_SAMPLES * RAYS),
        np.empty((4, _MOST_SAMPLES * RAYS), dtype=np.int32),
        np.empty(_MOST_SAMPLES * RAYS),
        np.empty(RAYS),
        np.empty(RAYS),
        np.empty(RAYS),
    )
    return Rays(
        np.empty((_MOST_NEIGHBOURS, 3)),
        np.empty((2, RAYS)),
        np.empty(RAYS, dtype=np.uint8),
        np.empty(RAYS, dtype=np.int64),
        np.empty(RAYS),
        np.empty(RAYS),
        samples,
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
def _look_along(
    pixels: NDArray[np.integer[Any]],
    width: int,
    sign: float,
    reach: int,
    count: int,
    samples: Samples,
) -> None:
    """Look at a picture along some rays: each step for many places at once."""
    start_x, start_y = samples.starts[0], samples.starts[1]
    step_x, step_y = samples.steps[0], samples.steps[1]
    columns = np.int32(width)
    for t in range(-reach, reach + 1):
        first = (t + reach) * count
        places = samples.places[first : first + count]
        right, down = samples.right[first : first + count], samples.down[first : first + count]
        for q in range(count):
            x, y = start_x[q] + t * step_x[q], start_y[q] + t * step_y[q]
            column, row = np.int32(x), np.int32(y)
            places[q] = row * columns + column
            right[q], down[q] = x - column, y - row
    one, below = np.uint64(1), np.uint64(width)
    upper_left, upper_right = samples.corners[0], samples.corners[1]
    lower_left, lower_right = samples.corners[2], samples.corners[3]
    right, down, values = samples.right, samples.down, samples.values
    for q in range((2 * reach + 1) * count):
        # Unsigned places need no look at whether they count from the end.
        k = np.uint64(samples.places[q])
        upper_left[q], upper_right[q] = pixels[k], pixels[k + one]
        lower_left[q], lower_right[q] = pixels[k + below], pixels[k + below + one]
    for q in range((2 * reach + 1) * count):
        upper = upper_left[q] * (1.0 - right[q]) + upper_right[q] * right[q]
        lower = lower_left[q] * (1.0 - right[q]) + lower_right[q] * right[q]
        values[q] = sign * (upper * (1.0 - down[q]) + lower * down[q])


@inlined
def _find_edges(
    reach: int, least: float, most_outside: float, count: int, samples: Samples
) -> None:
    """Distance of an edge from the end of each ray, [px]; NaN where there is none."""
    outside, step, edges = samples.outside, samples.step, samples.edges
    nearest, near = samples.values[:count], samples.values[count : 2 * count]
    last = 2 * reach * count
    far, farthest = samples.values[last - count : last], samples.values[last : last + count]
    for q in range(count):
        outside[q] = 0.5 * (farthest[q] + far[q])
        step[q] = 0.5 * (near[q] + nearest[q]) - outside[q]
        # The outermost samples are 1 and 0 by the choice of the levels.
        total = 1.0 - (reach + 0.5)
        total += min(max((near[q] - outside[q]) / step[q], 0.0), 1.0)
        edges[q] = total + min(max((far[q] - outside[q]) / step[q], 0.0), 1.0)
    for t in range(2, 2 * reach - 1):
        values = samples.values[t * count : (t + 1) * count]
        for q in range(count):
            edges[q] += min(max((values[q] - outside[q]) / step[q], 0.0), 1.0)
    most = 2.0 * most_outside
    for q in range(count):
        none = (far[q] > most) | (farthest[q] > most) | (outside[q] > most_outside)
        edges[q] = np.nan if none | (step[q] < least) else edges[q]


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
        k = np.uint64(rays.some[q])
        samples.starts[0, q], samples.starts[1, q] = rays.ends[0, k], rays.ends[1, k]
        samples.steps[0, q], samples.steps[1, q] = _COSINES[k], _SINES[k]
    _look_along(pixels, width, sign, reach, count, samples)
    _find_edges(reach, least, most_outside, count, samples)
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
