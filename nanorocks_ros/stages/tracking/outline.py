"""The outline of a bead with sub-pixel accuracy: edges along rays, and a circle through them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.physics.compiled import compiled
from nanorocks_ros.stages.tracking.pixels import Picture

if TYPE_CHECKING:
    from numpy.typing import NDArray

_RAYS = 32
_ANGLES = 2.0 * np.pi * (np.arange(_RAYS) + 0.5) / _RAYS
_COSINES, _SINES = np.cos(_ANGLES), np.sin(_ANGLES)

# Of 255: what counts as floor beyond the outline, and the least step of an edge.
_FLOOR_DARKNESS = 80.0
_LEAST_STEP = 60.0
# Gray levels of red minus blue across an edge between two species.
_LEAST_HUE_STEP = 30.0
_OTHER_HUE = 20.0
_ROUNDS = 3
# A smaller outline has fewer pixels than rays: every other ray does.
_ALL_RAYS_FROM_PX = 8.0
_MOST_NEIGHBOURS = 24
# Of a bead so large, edges are looked for within 3 px, else 2.
_FAR_FROM_PX = 6.0
# A step that needs no further one, [px].
_SETTLED_PX = 0.06
# An edge off the circle by so many pixels counts half.
_HALF_WEIGHT_PX = 0.35
# Neighbouring rays see the same pixels; what a scatter of nothing would still hide, [px].
_CORRELATED = 1.6
_LEAST_SCATTER_PX = 0.06
# How far a circle without edges may be from where it was guessed, [px].
_GUESS_PX = 1.5
# An edge nearer to another bead is no edge against the floor, [px].
_NEAR_PX = 5.0
# Share of an outline that does.
_ENOUGH = 0.35


@compiled
def _at(picture: NDArray[np.integer[Any]], column: float, row: float) -> float:
    """Value between pixels, from the centre of the first one on; within the picture."""
    j, i = int(column), int(row)
    u, v = column - j, row - i
    upper = picture[i, j] * (1.0 - u) + picture[i, j + 1] * u
    lower = picture[i + 1, j] * (1.0 - u) + picture[i + 1, j + 1] * u
    return float(upper * (1.0 - v) + lower * v)


@compiled
def _edge(
    picture: NDArray[np.integer[Any]],
    disc: NDArray[np.float64],
    ray: int,
    sign: float,
    least: float,
    most_outside: float,
) -> float:
    """Distance of an edge from the circle along a ray, [px]; NaN where there is none."""
    reach = 3 if disc[2] >= _FAR_FROM_PX else 2
    c, s = _COSINES[ray], _SINES[ray]
    # Pixel centres are at halves.
    x, y = disc[0] + disc[2] * c - 0.5, disc[1] + disc[2] * s - 0.5
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


@compiled
def _inverse(m: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Inverse of a symmetric, positive 3 x 3 matrix."""
    out[0, 0] = m[1, 1] * m[2, 2] - m[1, 2] * m[1, 2]
    out[0, 1] = m[0, 2] * m[1, 2] - m[0, 1] * m[2, 2]
    out[0, 2] = m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1]
    out[1, 1] = m[0, 0] * m[2, 2] - m[0, 2] * m[0, 2]
    out[1, 2] = m[0, 1] * m[0, 2] - m[0, 0] * m[1, 2]
    out[2, 2] = m[0, 0] * m[1, 1] - m[0, 1] * m[0, 1]
    determinant = m[0, 0] * out[0, 0] + m[0, 1] * out[0, 1] + m[0, 2] * out[0, 2]
    for a in range(3):
        for b in range(a, 3):
            out[a, b] /= determinant
            out[b, a] = out[a, b]


@compiled
def _neighbours(discs: NDArray[np.float64], own: int, count: int) -> NDArray[np.float64]:
    """The discs that touch, hide or nearly touch one, (k, 3), while it moves a little."""
    found = np.empty((_MOST_NEIGHBOURS, 3))
    n = 0
    for k in range(count):
        if k != own and n < _MOST_NEIGHBOURS:
            reach = discs[k, 2] + discs[own, 2] + _NEAR_PX + _GUESS_PX
            dx, dy = discs[k, 0] - discs[own, 0], discs[k, 1] - discs[own, 1]
            if dx * dx + dy * dy < reach * reach:
                found[n] = discs[k]
                n += 1
    return found[:n]


@compiled
def _hidden(disc: NDArray[np.float64], neighbours: NDArray[np.float64], ray: int) -> bool:
    """Whether the edge on this ray lies on or beside another bead."""
    x = disc[0] + disc[2] * _COSINES[ray]
    y = disc[1] + disc[2] * _SINES[ray]
    for k in range(neighbours.shape[0]):
        near = neighbours[k, 2] + 0.5 * _NEAR_PX
        dx, dy = neighbours[k, 0] - x, neighbours[k, 1] - y
        if dx * dx + dy * dy < near * near:
            return True
    return False


@compiled
def fit_circle(
    picture: Picture,
    hue_sign: float,
    discs: NDArray[np.float64],
    own: int,
    count: int,
    expected: NDArray[np.float64],
    fit: NDArray[np.float64],
) -> None:
    """Fit a circle to the outline of one bead among others.

    Parameters
    ----------
    picture : Picture
    hue_sign : float
        1 for a red, -1 for a blue, 0 for a gray bead.
    discs : ndarray (n, 3), [px]
        Column, row and radius of the beads known so far; that of number `own` is replaced.
    own, count : int
        `count` of the discs are filled in.
    expected : ndarray (2,), [px]
        Radius and its standard deviation.
    fit : ndarray (3 or more,)
        Written: error of a coordinate and of the radius [px], share of the outline seen.
    """
    start_x, start_y = discs[own, 0], discs[own, 1]
    neighbours = _neighbours(discs, own, count)
    every = 1 if discs[own, 2] >= _ALL_RAYS_FROM_PX else 2
    covariance, normal, right = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    seen, scatter2 = 0, 0.0
    for turn in range(_ROUNDS):
        seen, total = _add_edges(
            picture, hue_sign, discs[own], neighbours, every, turn > 0, normal, right
        )
        scatter2 = total / max(seen - 3, 1)
        prior = max(scatter2, _LEAST_SCATTER_PX * _LEAST_SCATTER_PX)
        # What is known of the size and of the place, as further edges of the same scatter.
        size_weight = prior / (expected[1] * expected[1])
        place_weight = prior / (_GUESS_PX * _GUESS_PX)
        normal[0, 0] += place_weight
        normal[1, 1] += place_weight
        right[0] += place_weight * (start_x - discs[own, 0])
        right[1] += place_weight * (start_y - discs[own, 1])
        normal[2, 2] += size_weight
        right[2] += size_weight * (expected[0] - discs[own, 2])
        _inverse(normal, covariance)
        longest = 0.0
        for a in range(3):
            step = 0.0
            for b in range(3):
                step += covariance[a, b] * right[b]
            longest = max(longest, abs(step))
            discs[own, a] += min(max(step, -2.0), 2.0)
        discs[own, 2] = max(discs[own, 2], 1.5)
        if turn > 0 and longest < _SETTLED_PX:
            break
    spread = _CORRELATED * (scatter2 + _LEAST_SCATTER_PX * _LEAST_SCATTER_PX)
    fit[0] = math.sqrt(0.5 * spread * (covariance[0, 0] + covariance[1, 1]))
    fit[1] = math.sqrt(spread * covariance[2, 2])
    fit[2] = seen * every / _RAYS


@compiled
def _add_edges(
    picture: Picture,
    hue_sign: float,
    disc: NDArray[np.float64],
    neighbours: NDArray[np.float64],
    every: int,
    robust: bool,
    normal: NDArray[np.float64],
    right: NDArray[np.float64],
) -> tuple[int, float]:
    """Normal equations of a circle through the edges; how many, and their weighted squares."""
    seen, total = 0, 0.0
    xx, xy, yy, xr, yr, rr = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    right[:] = 0.0
    for k in range(0, _RAYS, every):
        if _hidden(disc, neighbours, k):
            continue
        edge = _edge(picture.darkness, disc, k, 1.0, _LEAST_STEP, _FLOOR_DARKNESS)
        if edge != edge and hue_sign != 0.0:
            # Against another species it is the hue that has a step.
            edge = _edge(picture.hue, disc, k, hue_sign, _LEAST_HUE_STEP, _OTHER_HUE)
        if edge != edge:
            continue
        off = edge / _HALF_WEIGHT_PX
        weight = 1.0 / (1.0 + off * off) if robust else 1.0
        c, s = _COSINES[k], _SINES[k]
        seen += 1
        total += weight * edge * edge
        right[0] += weight * c * edge
        right[1] += weight * s * edge
        right[2] += weight * edge
        xx += weight * c * c
        xy += weight * c * s
        yy += weight * s * s
        xr += weight * c
        yr += weight * s
        rr += weight
    normal[0, 0], normal[0, 1], normal[0, 2] = xx, xy, xr
    normal[1, 1], normal[1, 2], normal[2, 2] = yy, yr, rr
    return seen, total


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
    fit = np.zeros(3)
    alone = discs[first : first + count].copy()
    for k in range(count):
        if not _neighbours(discs, first + k, discs.shape[0]).size:
            continue
        before = discs[first + k].copy()
        fit_circle(picture, hue_sign, discs, first + k, discs.shape[0], expected, fit)
        if fit[2] < _ENOUGH and hue_sign != 0.0:
            # Edges against the other species show in the colour.
            alone[k] = before
            fit_circle(picture, hue_sign, alone, k, count, expected, fit)
            discs[first + k] = alone[k]
        fits[k, :3] = fit
