"""Beads and grains as the lens shows them: shaded, dusty, of their own shape, with shadows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.compiled import compiled
from nanorocks_ros.simulation.drawing import coverage, shade

if TYPE_CHECKING:
    from numpy.typing import NDArray

LEVEL = 64
"""Steps of a canvas to one gray level; brighter than white is kept up to 1023 levels."""
_MOST = 65535.0

# Kinds of bodies.
SPHERE, GRAIN = 0, 1

# Columns of a shape: cosine and sine terms of the outline for 2, 3 and 4 lobes, then facets as
# x, y, z of their normal and the brightness of their mineral.
LOBES = 6
FACETS = 6
SHAPE = LOBES + 4 * FACETS

# Columns of a turn: cosine and sine of the angle that a body has turned by.
_COSINE, _SINE = 0, 1

# Unit vector to the lamp; x right, y down, z up (as in `drawing`).
_LAMP_X, _LAMP_Y, _LAMP_Z = -0.36, -0.48, 0.80
_CHALK = np.array([226.0, 229.0, 231.0])


@compiled
def outline(shape: NDArray[np.float64], x: float, y: float) -> float:
    """Radius of a grain in the direction of a point, in mean radii."""
    square = x * x + y * y
    if square < 1e-12:
        return 1.0
    c2, s2 = (x * x - y * y) / square, 2.0 * x * y / square
    scale = 1.0 / math.sqrt(square)
    c1, s1 = x * scale, y * scale
    c3, s3 = c2 * c1 - s2 * s1, s2 * c1 + c2 * s1
    c4, s4 = c2 * c2 - s2 * s2, 2.0 * c2 * s2
    return float(
        1.0
        + shape[0] * c2
        + shape[1] * s2
        + shape[2] * c3
        + shape[3] * s3
        + shape[4] * c4
        + shape[5] * s4
    )


@compiled
def facet_light(
    shape: NDArray[np.float64],
    look: NDArray[np.float64],
    turn: NDArray[np.float64],
    x: float,
    y: float,
) -> float:
    """Light from a grain at a point of its disc; 1 is its full colour."""
    z = math.sqrt(max(1.0 - x * x - y * y, 0.0))
    x, y = x * turn[0] + y * turn[1], y * turn[0] - x * turn[1]
    best, found = -2.0, LOBES
    for k in range(LOBES, SHAPE, 4):
        along = x * shape[k] + y * shape[k + 1] + z * shape[k + 2]
        if along > best:
            best, found = along, k
    a, b, c = shape[found], shape[found + 1], shape[found + 2]
    # The facet turns with the grain, the lamp stays.
    right, down = a * turn[0] - b * turn[1], a * turn[1] + b * turn[0]
    lambert = max(right * _LAMP_X + down * _LAMP_Y + c * _LAMP_Z, 0.0)
    return float((look[3] + look[4] * lambert) * shape[found + 3])


@compiled
def dusted(
    dust: NDArray[np.float32], start: int, turn: NDArray[np.float64], x: float, y: float
) -> float:
    """Share of a point of a bead that is under dust, from a pattern that turns with the bead."""
    size = dust.shape[0]
    right = x * turn[0] + y * turn[1]
    down = y * turn[0] - x * turn[1]
    i = (int((down + 1.0) * 12.0) + start) % size
    j = (int((right + 1.0) * 12.0) + start // size) % size
    return float(dust[i, j])


@compiled
def bead_colour(
    look: NDArray[np.float64],
    dust: NDArray[np.float32],
    start: int,
    place: NDArray[np.float64],
    x: float,
    y: float,
) -> tuple[float, float, float]:
    """Blue, green and red of a bead at a point of its disc, under its dust."""
    blue, green, red = shade(look, x, y)
    if place[11] > 0.0:
        hidden = min(place[11] * dusted(dust, start, place[9:11], x, y), 1.0)
        z = math.sqrt(max(1.0 - x * x - y * y, 0.0))
        lit = 0.5 + 0.5 * max(x * _LAMP_X + y * _LAMP_Y + z * _LAMP_Z, 0.0)
        blue += hidden * (_CHALK[0] * lit - blue)
        green += hidden * (_CHALK[1] * lit - green)
        red += hidden * (_CHALK[2] * lit - red)
    return blue, green, red


@compiled
def span(canvas_size: int, middle: float, reach: float) -> tuple[int, int]:
    """First pixel that a body can cover and the one after the last, on a canvas so large."""
    first = max(math.floor(middle - reach), 0)
    return first, min(math.floor(middle + reach) + 1, canvas_size)


@compiled
def largest_lobes(kind: int, shape: NDArray[np.float64]) -> float:
    """By how much an outline can leave the circle, in radii."""
    most = 0.0
    if kind == GRAIN:
        for k in range(0, LOBES, 2):
            most += math.sqrt(shape[k] * shape[k] + shape[k + 1] * shape[k + 1])
    return most


@compiled
def draw_body(
    canvas: NDArray[np.uint16],
    place: NDArray[np.float64],
    look: NDArray[np.float64],
    kind: int,
    shape: NDArray[np.float64],
    dust: NDArray[np.float32],
    start: int,
    width: float,
) -> None:
    """Draw one body over what is there.

    Parameters
    ----------
    canvas : ndarray of uint16, (rows, columns, 3), [1/64 gray levels]
        Changed.
    place : ndarray (12,)
        Column, row; half sides of the rectangle around it; mean radius, [px]; matrix (2 x 2)
        from pixels to parts of the radius; cosine and sine of the angle it has turned by;
        share of dust.
    look : ndarray (9,)
    kind : int
    shape : ndarray (SHAPE,)
    dust : ndarray of float32, (size, size)
    start : int
        Where in the pattern of dust this body begins.
    width : float, [px]
        Of the outline.
    """
    column, row, radius = place[0], place[1], place[4]
    turn = place[9:11]
    half = 0.5 * width
    top, bottom = span(canvas.shape[0], row, place[3] + half)
    left, right = span(canvas.shape[1], column, place[2] + half)
    lobes = largest_lobes(kind, shape)
    # Beyond the first there is nothing of the body; within the second it covers all.
    outer = 1.0 + lobes + half / radius
    inner = max(1.0 - lobes - half / radius, 0.0)
    for i in range(top, bottom):
        down = i + 0.5 - row
        for j in range(left, right):
            across = j + 0.5 - column
            x = place[5] * across + place[6] * down
            y = place[7] * across + place[8] * down
            square = x * x + y * y
            if square > outer * outer:
                continue
            share, inward = 1.0, 1.0
            if square > inner * inner:
                distance, edge = math.sqrt(square), 1.0
                if kind == GRAIN:
                    own_x, own_y = x * turn[0] + y * turn[1], y * turn[0] - x * turn[1]
                    edge = outline(shape, own_x, own_y)
                share = coverage(distance * radius, edge * radius, width)
                if share <= 0.0:
                    continue
                inward = 1.0 / max(distance, edge)
            x, y = x * inward, y * inward
            if kind == GRAIN:
                light = facet_light(shape, look, turn, x, y)
                blue, green, red = look[0] * light, look[1] * light, look[2] * light
            else:
                blue, green, red = bead_colour(look, dust, start, place, x, y)
            mix(canvas, i, j, 0, blue, share)
            mix(canvas, i, j, 1, green, share)
            mix(canvas, i, j, 2, red, share)


@compiled
def mix(
    canvas: NDArray[np.uint16], i: int, j: int, channel: int, level: float, share: float
) -> None:
    """Let a level cover a share of a pixel."""
    before = np.float64(canvas[i, j, channel])
    value = before + share * (level * LEVEL - before)
    canvas[i, j, channel] = np.uint16(min(max(value, 0.0), _MOST) + 0.5)


@compiled
def draw_bodies(
    canvas: NDArray[np.uint16],
    order: NDArray[np.int64],
    places: NDArray[np.float64],
    looks: NDArray[np.float64],
    kinds: NDArray[np.int64],
    shapes: NDArray[np.float64],
    dust: NDArray[np.float32],
    width: float,
) -> None:
    """Draw bodies in an order, the lowest first; arrays hold one row for each, see `draw_body`.

    Parameters
    ----------
    shapes : ndarray (n_shapes, SHAPE)
        Grains take one after the other.
    """
    for k in range(order.size):
        i = order[k]
        shape = shapes[i % shapes.shape[0]]
        draw_body(canvas, places[i], looks[i], kinds[i], shape, dust, i * 7919, width)


@compiled
def draw_shadows(
    canvas: NDArray[np.uint16],
    spots: NDArray[np.float64],
    bounds: NDArray[np.int64],
    strength: float,
) -> None:
    """Darken the floor where bodies keep the light away.

    Parameters
    ----------
    canvas : ndarray of uint16, (rows, columns, 3)
        Changed.
    spots : ndarray (n, 4), [px]
        Column and row of a shadow, its radius, and the width of its outline.
    bounds : ndarray (4,), [px]
        First and last column and row (not included) that it can fall on: of the floor.
    strength : float
        Share of the light that the deepest shadow takes.
    """
    for k in range(spots.shape[0]):
        column, row, radius, width = spots[k, 0], spots[k, 1], spots[k, 2], spots[k, 3]
        reach = radius + 0.5 * width
        top, bottom = span(bounds[3], row, reach)
        left, right = span(bounds[1], column, reach)
        top, left = max(top, bounds[2]), max(left, bounds[0])
        for i in range(top, bottom):
            down = i + 0.5 - row
            for j in range(left, right):
                across = j + 0.5 - column
                square = across * across + down * down
                if square >= reach * reach:
                    continue
                share = strength * coverage(math.sqrt(square), radius, width)
                for channel in range(3):
                    light = np.float64(canvas[i, j, channel]) * (1.0 - share)
                    canvas[i, j, channel] = np.uint16(light + 0.5)
