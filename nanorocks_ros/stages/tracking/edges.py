"""Edges of a bead: where the darkness or the hue has a step, along rays from its middle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nanorocks_ros.physics.compiled import compiled, inlined

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
# An edge off the circle by so many pixels counts half.
_HALF_WEIGHT_PX = 0.35


class Rays(NamedTuple):
    """Room for the fits of one circle after the other.

    Parameters
    ----------
    neighbours : ndarray (most, 3), [px]
        Of the discs around: column, row, and the square of the distance within which an edge is
        hidden.
    ends : ndarray (2, rays), [px]
        Column and row where each ray crosses the circle.
    hidden : ndarray of uint8, (rays,)
        1 where it does so on or beside another bead.
    """

    neighbours: NDArray[np.float64]
    ends: NDArray[np.float64]
    hidden: NDArray[np.uint8]


@compiled
def room_for_rays() -> Rays:
    """Room that nothing is written in yet."""
    return Rays(
        np.empty((_MOST_NEIGHBOURS, 3)),
        np.empty((2, RAYS)),
        np.empty(RAYS, dtype=np.uint8),
    )


@inlined
def _at(picture: NDArray[np.integer[Any]], column: float, row: float) -> float:
    """Value between pixels, from the centre of the first one on; within the picture."""
    j, i = int(column), int(row)
    u, v = column - j, row - i
    # Unsigned places need no look at whether they count from the end.
    left, top, one = np.uint64(j), np.uint64(i), np.uint64(1)
    right, bottom = left + one, top + one
    upper = picture[top, left] * (1.0 - u) + picture[top, right] * u
    lower = picture[bottom, left] * (1.0 - u) + picture[bottom, right] * u
    return float(upper * (1.0 - v) + lower * v)


@inlined
def _edge(
    picture: NDArray[np.integer[Any]],
    end: tuple[float, float],
    ray: int,
    reach: int,
    sign: float,
    least: float,
    most_outside: float,
) -> float:
    """Distance of an edge from the end of a ray, along it, [px]; NaN where there is none."""
    c, s = _COSINES[ray], _SINES[ray]
    # Pixel centres are at halves.
    x, y = end[0] - 0.5, end[1] - 0.5
    left, right = x - reach * abs(c), x + reach * abs(c)
    top, bottom = y - reach * abs(s), y + reach * abs(s)
    if left < 0.0 or top < 0.0:
        return np.nan
    if right + 1.0 >= picture.shape[1] or bottom + 1.0 >= picture.shape[0]:
        return np.nan
    most = 2.0 * most_outside
    farthest = sign * _at(picture, x + reach * c, y + reach * s)
    far = sign * _at(picture, x + (reach - 1) * c, y + (reach - 1) * s)
    outside = 0.5 * (farthest + far)
    if far > most or farthest > most or outside > most_outside:
        return np.nan
    near = sign * _at(picture, x - (reach - 1) * c, y - (reach - 1) * s)
    nearest = sign * _at(picture, x - reach * c, y - reach * s)
    step = 0.5 * (near + nearest) - outside
    if step < least:
        return np.nan
    # The outermost samples are 1 and 0 by the choice of the levels.
    total = 1.0 - (reach + 0.5)
    total += min(max((near - outside) / step, 0.0), 1.0)
    total += min(max((far - outside) / step, 0.0), 1.0)
    for t in range(2 - reach, reach - 1):
        value = sign * _at(picture, x + t * c, y + t * s)
        total += min(max((value - outside) / step, 0.0), 1.0)
    return total


@inlined
def lay_rays(x: float, y: float, radius: float, neighbours: int, rays: Rays) -> None:
    """Where the rays of a circle end, and whether that is on or beside another bead."""
    columns, rows, hidden = rays.ends[0], rays.ends[1], rays.hidden
    for k in range(RAYS):
        columns[k], rows[k] = x + radius * _COSINES[k], y + radius * _SINES[k]
        hidden[k] = 0
    for n in range(neighbours):
        other_x, other_y, near2 = (
            rays.neighbours[n, 0],
            rays.neighbours[n, 1],
            rays.neighbours[n, 2],
        )
        for k in range(RAYS):
            dx, dy = other_x - columns[k], other_y - rows[k]
            hidden[k] |= np.uint8(dx * dx + dy * dy < near2)


@inlined
def add_edges(
    picture: Picture, hue_sign: float, radius: float, every: int, robust: bool, rays: Rays
) -> tuple[int, float, tuple[float, float, float], float, float, float, float, float, float]:
    """Normal equations of a circle through the edges.

    Returns
    -------
    int, float
        How many edges, and their weighted squares.
    tuple of 3 floats
        Right sides, of column, row and radius.
    floats
        Upper triangle of the matrix, row by row.
    """
    seen, total = 0, 0.0
    xx, xy, yy, xr, yr, rr = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    side_x, side_y, side_r = 0.0, 0.0, 0.0
    reach = 3 if radius >= _FAR_FROM_PX else 2
    for k in range(0, RAYS, every):
        if rays.hidden[k]:
            continue
        end = rays.ends[0, k], rays.ends[1, k]
        edge = _edge(picture.darkness, end, k, reach, 1.0, _LEAST_STEP, _FLOOR_DARKNESS)
        if edge != edge and hue_sign != 0.0:
            # Against another species it is the hue that has a step.
            edge = _edge(picture.hue, end, k, reach, hue_sign, _LEAST_HUE_STEP, _OTHER_HUE)
        if edge != edge:
            continue
        off = edge / _HALF_WEIGHT_PX
        weight = 1.0 / (1.0 + off * off) if robust else 1.0
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
