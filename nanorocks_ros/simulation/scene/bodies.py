"""Beads and grains as the lens shows them: shaded, dusty, of their own shape, with shadows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.compiled import compiled, inlined, kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

LEVEL = 64
"""Steps of a canvas to one gray level; brighter than white is kept up to 1023 levels."""

# Kinds of bodies.
SPHERE, GRAIN = 0, 1

# Columns of a shape: cosine and sine terms of the outline for 2, 3 and 4 lobes, then facets as
# x, y, z of their normal and the brightness of their mineral.
LOBES = 6
FACETS = 5
SHAPE = LOBES + 4 * FACETS

# Columns of a place.
COLUMN, ROW, HALF_WIDTH, HALF_HEIGHT, RADIUS, MATRIX, COSINE, SINE, DUST = (
    0,
    1,
    2,
    3,
    4,
    5,
    9,
    10,
    11,
)
PLACE = 12

# Columns of the spot of a shadow, after those that it shares with a place.
_BLUR, _FLOOR = 5, 6

# Columns of a look, as the fields of materials.Look.
# Its first three are blue, green and red.
_AMBIENT, _DIFFUSE, _DARKENING, _GLOW, _SHEEN, _HIGHLIGHT = range(3, 9)

# Unit vector to the lamp; x right, y down, z up. Half way between it and the camera a mirror
# would show the lamp. (As in `drawing`.)
_LAMP_X, _LAMP_Y, _LAMP_Z, _LAMP_ACROSS = -0.36, -0.48, 0.80, 0.60
_HALF_LENGTH = math.sqrt(_LAMP_X**2 + _LAMP_Y**2 + (1.0 + _LAMP_Z) ** 2)
_HALF_X, _HALF_Y, _HALF_Z = (value / _HALF_LENGTH for value in (_LAMP_X, _LAMP_Y, 1.0 + _LAMP_Z))
_CHALK = np.array([226.0, 229.0, 231.0])

# Squares of the pattern of dust to the radius of a bead.
_DUST_SQUARES = 12.0


# Rows of the buffer in which the pixels of a body are worked out, all in one long loop: loops
# over the short rows of a body would not run in lanes.
_X, _Y, _SHARE, _LEVELS, _LIT, _ACROSS_DUST, _DOWN_DUST = 0, 1, 2, 3, 6, 7, 8
BUFFERS = 9
# Rows are filled up to a multiple of this, so that they are drawn in lanes too.
_LANES = 8
_EIGHT = np.uint64(_LANES)


@inlined
def covered(beyond: float, width: float) -> float:
    """Share of a pixel that is covered, from its distance beyond an outline so wide, [px].

    The step of `drawing.coverage`, without branches.
    """
    t = min(max(0.5 - beyond / width, 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


@inlined
def span(size: int, middle: float, reach: float) -> tuple[int, int]:
    """First pixel that a body can cover and the one after the last, on a canvas so large."""
    first = max(math.floor(middle - reach), 0)
    return first, min(math.floor(middle + reach) + 1, size)


@kernel
def lay_out(out: NDArray[np.float64], rows: int, columns: int, across: float, down: float) -> int:
    """Fill in the places of the pixels of a rectangle; how many there are.

    Parameters
    ----------
    out : ndarray (2 or more, n)
        Written: column and row from the centre of the body, [px].
    rows, columns : int
        The latter a multiple of 8.
    across, down : float, [px]
        Of the first pixel.
    """
    k = np.uint64(0)
    for i in range(rows):
        for m in range(columns // _LANES):
            for j in range(_EIGHT):
                out[_X, k + j] = across + (_LANES * m + np.int64(j))
                out[_Y, k + j] = down + i
            k += _EIGHT
    return int(k)


@inlined
def box(
    canvas: NDArray[np.uint16], place: NDArray[np.float64], width: float
) -> tuple[int, int, int, int]:
    """First column and row of the rectangle that a body is drawn in, its columns and rows."""
    top, bottom = span(canvas.shape[1], place[ROW], place[HALF_HEIGHT] + 0.5 * width)
    left, right = span(canvas.shape[2], place[COLUMN], place[HALF_WIDTH] + 0.5 * width)
    columns = max(right - left + _LANES - 1, 0) // _LANES * _LANES
    # Where the canvas ends, it begins so much earlier.
    left = max(min(left, canvas.shape[2] - columns), 0)
    return left, top, min(columns, canvas.shape[2] // _LANES * _LANES), max(bottom - top, 0)


@kernel
def compose(
    canvas: NDArray[np.uint16],
    out: NDArray[np.float64],
    left: int,
    top: int,
    columns: int,
    rows: int,
) -> None:
    """Let the shares and levels of a buffer cover a rectangle of a canvas."""
    for channel in range(3):
        k = np.uint64(0)
        for i in range(top, top + rows):
            for m in range(columns // _LANES):
                first = np.uint64(left + _LANES * m)
                for j in range(_EIGHT):
                    before = np.float64(canvas[channel, i, first + j])
                    share, level = out[_SHARE, k + j], out[_LEVELS + channel, k + j]
                    value = before + share * (level - before) + 0.5
                    canvas[channel, i, first + j] = np.uint16(np.int32(value))
                k += _EIGHT


@inlined
def facet(
    best: float,
    light: float,
    point: tuple[float, float, float],
    shape: NDArray[np.float64],
    k: int,
    level: float,
) -> tuple[float, float]:
    """The facet that faces a point best, and its light, after one more facet."""
    n = LOBES + 4 * k
    along = point[0] * shape[n] + point[1] * shape[n + 1] + point[2] * shape[n + 2]
    return max(best, along), (level if along > best else light)


@kernel
def grain_pixels(
    out: NDArray[np.float64],
    n: int,
    place: NDArray[np.float64],
    shape: NDArray[np.float64],
    look: NDArray[np.float64],
    levels: NDArray[np.float64],
    width: float,
) -> None:
    """Shares and light of the pixels of a grain, without branches so that it runs in lanes.

    Parameters
    ----------
    out : ndarray (9, n or more)
        Written: share of each pixel, levels.
    place : ndarray (12,)
        With the turn of the grain in its matrix.
    shape : ndarray (SHAPE,)
    look : ndarray (9,)
    levels : ndarray (FACETS,)
        Light of each facet.
    width : float, [px]
    """
    xx, xy, yx, yy = place[MATRIX], place[MATRIX + 1], place[MATRIX + 2], place[MATRIX + 3]
    radius = place[RADIUS]
    a2, b2, a3, b3, a4, b4 = shape[0], shape[1], shape[2], shape[3], shape[4], shape[5]
    blue, green, red = look[0], look[1], look[2]
    l0, l1, l2, l3, l4 = levels[0], levels[1], levels[2], levels[3], levels[4]
    for j in range(n):
        dx, dy = out[_X, j], out[_Y, j]
        x, y = xx * dx + xy * dy, yx * dx + yy * dy
        distance = math.sqrt(x * x + y * y) + 1e-9
        scale = 1.0 / distance
        c1, s1 = x * scale, y * scale
        c2, s2 = c1 * c1 - s1 * s1, 2.0 * c1 * s1
        c3, s3 = c2 * c1 - s2 * s1, s2 * c1 + c2 * s1
        c4, s4 = c2 * c2 - s2 * s2, 2.0 * c2 * s2
        edge = 1.0 + a2 * c2 + b2 * s2 + a3 * c3 + b3 * s3 + a4 * c4 + b4 * s4
        inward = min(edge * scale, 1.0)
        x, y = x * inward, y * inward
        point = x, y, math.sqrt(max(1.0 - x * x - y * y, 0.0))
        best, light = facet(-2.0, l0, point, shape, 0, l0)
        best, light = facet(best, light, point, shape, 1, l1)
        best, light = facet(best, light, point, shape, 2, l2)
        best, light = facet(best, light, point, shape, 3, l3)
        best, light = facet(best, light, point, shape, 4, l4)
        out[_SHARE, j] = covered((distance - edge) * radius, width)
        out[_LEVELS, j] = blue * light
        out[_LEVELS + 1, j] = green * light
        out[_LEVELS + 2, j] = red * light


@kernel
def draw_grain(
    canvas: NDArray[np.uint16],
    place: NDArray[np.float64],
    look: NDArray[np.float64],
    shape: NDArray[np.float64],
    width: float,
    buffer: NDArray[np.float64],
    turned: NDArray[np.float64],
    levels: NDArray[np.float64],
) -> None:
    """Draw a grain with facets; see `draw_bodies`."""
    cosine, sine = place[COSINE], place[SINE]
    for k in range(PLACE):
        turned[k] = place[k]
    for k in range(2):
        x, y = place[MATRIX + k], place[MATRIX + 2 + k]
        turned[MATRIX + k] = x * cosine + y * sine
        turned[MATRIX + 2 + k] = y * cosine - x * sine
    for k in range(FACETS):
        n = LOBES + 4 * k
        right = shape[n] * cosine - shape[n + 1] * sine
        down = shape[n] * sine + shape[n + 1] * cosine
        lambert = max(right * _LAMP_X + down * _LAMP_Y + shape[n + 2] * _LAMP_Z, 0.0)
        levels[k] = LEVEL * (look[_AMBIENT] + look[_DIFFUSE] * lambert) * shape[n + 3]
    left, top, columns, rows = box(canvas, place, width)
    n = lay_out(buffer, rows, columns, left + 0.5 - place[COLUMN], top + 0.5 - place[ROW])
    grain_pixels(buffer, n, turned, shape, look, levels, width)
    compose(canvas, buffer, left, top, columns, rows)


@kernel
def bead_pixels(
    out: NDArray[np.float64],
    n: int,
    place: NDArray[np.float64],
    look: NDArray[np.float64],
    width: float,
) -> None:
    """Shares and light of the pixels of a bead, without branches so that it runs in lanes.

    The light is that of `drawing.shade`.

    Parameters
    ----------
    out : ndarray (9, n or more)
        Written: share of each pixel, levels, how it is lit, and the place on the bead, which
        has turned.
    place : ndarray (12,)
    look : ndarray (9,)
    width : float, [px]
    """
    xx, xy, yx, yy = place[MATRIX], place[MATRIX + 1], place[MATRIX + 2], place[MATRIX + 3]
    radius, cosine, sine = place[RADIUS], place[COSINE], place[SINE]
    ambient, diffuse, darkening = look[_AMBIENT], look[_DIFFUSE], look[_DARKENING]
    glow, sheen, highlight = look[_GLOW], look[_SHEEN], LEVEL * look[_HIGHLIGHT]
    blue, green, red = LEVEL * look[0], LEVEL * look[1], LEVEL * look[2]
    for j in range(n):
        dx, dy = out[_X, j], out[_Y, j]
        x, y = xx * dx + xy * dy, yx * dx + yy * dy
        distance = math.sqrt(x * x + y * y)
        inward = 1.0 / max(distance, 1.0)
        x, y = x * inward, y * inward
        z = math.sqrt(max(1.0 - x * x - y * y, 0.0))
        lamp = x * _LAMP_X + y * _LAMP_Y
        lambert = max(lamp + z * _LAMP_Z, 0.0)
        mirror = max(x * _HALF_X + y * _HALF_Y + z * _HALF_Z, 0.0)
        mirror = mirror * mirror
        mirror = mirror * mirror
        broad = mirror * mirror
        narrow = broad * broad
        narrow = narrow * narrow
        away = max(-lamp / _LAMP_ACROSS, 0.0)
        light = (ambient + diffuse * lambert) * (1.0 - darkening * (1.0 - z) * (1.0 - z))
        out[_SHARE, j] = covered((distance - 1.0) * radius, width)
        light += glow * away * away * z + sheen * broad
        out[_LEVELS, j] = blue * light + highlight * narrow
        out[_LEVELS + 1, j] = green * light + highlight * narrow
        out[_LEVELS + 2, j] = red * light + highlight * narrow
        out[_LIT, j] = 0.5 + 0.5 * lambert
        out[_ACROSS_DUST, j] = x * cosine + y * sine
        out[_DOWN_DUST, j] = y * cosine - x * sine


@kernel
def put_dust(
    out: NDArray[np.float64], n: int, dust: NDArray[np.float32], start: int, cover: float
) -> None:
    """Hide the pixels that `bead_pixels` left under dust."""
    size = dust.shape[0]
    for j in range(n):
        y = int((out[_DOWN_DUST, j] + 1.0) * _DUST_SQUARES) + start
        x = int((out[_ACROSS_DUST, j] + 1.0) * _DUST_SQUARES) + start // size
        hidden = min(cover * dust[y % size, x % size], 1.0)
        for channel in range(3):
            level = out[_LEVELS + channel, j]
            chalk = LEVEL * _CHALK[channel] * out[_LIT, j]
            out[_LEVELS + channel, j] = level + hidden * (chalk - level)


@kernel
def draw_bead(
    canvas: NDArray[np.uint16],
    place: NDArray[np.float64],
    look: NDArray[np.float64],
    dust: NDArray[np.float32],
    start: int,
    width: float,
    buffer: NDArray[np.float64],
) -> None:
    """Draw a shaded sphere, or oval, under its dust; see `draw_bodies`."""
    left, top, columns, rows = box(canvas, place, width)
    n = lay_out(buffer, rows, columns, left + 0.5 - place[COLUMN], top + 0.5 - place[ROW])
    bead_pixels(buffer, n, place, look, width)
    if place[DUST] > 0.0:
        put_dust(buffer, n, dust, start, place[DUST])
    compose(canvas, buffer, left, top, columns, rows)


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
    """Draw bodies over what is there and over each other.

    Parameters
    ----------
    canvas : ndarray of uint16, (3, rows, columns), bgr, [1/64 gray levels]
        Changed.
    order : ndarray of int64, (n,)
        The lowest first.
    places : ndarray (n, 12)
        Column, row; half sides of the rectangle around the body; mean radius, [px]; matrix
        (2 x 2) from pixels to parts of the radius; cosine and sine of the angle that the body
        has turned by; share of dust.
    looks : ndarray (n, 9)
        Columns as the fields of `materials.Look`, levels below 1000.
    kinds : ndarray of int64, (n,)
        `SPHERE` or `GRAIN`.
    shapes : ndarray (n_shapes, SHAPE)
        Grains take one after the other.
    dust : ndarray of float32, (size, size)
        Where dust is on beads; each begins elsewhere in it.
    width : float, [px]
        Of the outlines.
    """
    most = 0.0
    for k in range(order.size):
        sides = places[k, HALF_WIDTH : HALF_HEIGHT + 1]
        across, down = 2.0 * sides[0] + width + 2.0 + _LANES, 2.0 * sides[1] + width + 2.0
        most = max(most, across * down)
    buffer = np.empty((BUFFERS, int(most) + _LANES))
    turned, levels = np.empty(PLACE), np.empty(FACETS)
    for k in range(order.size):
        i = order[k]
        if kinds[i] == GRAIN:
            shape = shapes[i % shapes.shape[0]]
            draw_grain(canvas, places[i], looks[i], shape, width, buffer, turned, levels)
        else:
            draw_bead(canvas, places[i], looks[i], dust, i * 7919, width, buffer)


@kernel
def shadow_pixels(
    out: NDArray[np.float64], n: int, spot: NDArray[np.float64], strength: float
) -> None:
    """Share of the light that a shadow leaves of the pixels laid out in a buffer."""
    radius, width = spot[RADIUS], spot[_BLUR]
    left, right = spot[_FLOOR] - spot[COLUMN], spot[_FLOOR + 1] - spot[COLUMN]
    top, bottom = spot[_FLOOR + 2] - spot[ROW], spot[_FLOOR + 3] - spot[ROW]
    for j in range(n):
        x, y = out[_X, j], out[_Y, j]
        share = strength * covered(math.sqrt(x * x + y * y) - radius, width)
        on_floor = (x > left) & (x < right) & (y > top) & (y < bottom)
        out[_SHARE, j] = 1.0 - share if on_floor else 1.0


@kernel
def darken(
    canvas: NDArray[np.uint16],
    out: NDArray[np.float64],
    left: int,
    top: int,
    columns: int,
    rows: int,
) -> None:
    """Leave a rectangle of a canvas the light that `shadow_pixels` found."""
    for channel in range(3):
        k = np.uint64(0)
        for i in range(top, top + rows):
            for m in range(columns // _LANES):
                first = np.uint64(left + _LANES * m)
                for j in range(_EIGHT):
                    light = np.float64(canvas[channel, i, first + j]) * out[_SHARE, k + j]
                    canvas[channel, i, first + j] = np.uint16(np.int32(light + 0.5))
                k += _EIGHT


@compiled
def draw_shadows(
    canvas: NDArray[np.uint16],
    spots: NDArray[np.float64],
    strength: float,
) -> None:
    """Darken the floor where bodies keep the light away.

    Parameters
    ----------
    canvas : ndarray of uint16, (3, rows, columns)
        Changed.
    spots : ndarray (n, 10), [px]
        Column and row of a shadow, its radius three times, the width of its outline; first and
        last column and row of the floor that it can fall on.
    strength : float
        Share of the light that the deepest shadow takes.
    """
    most = 0.0
    for k in range(spots.shape[0]):
        side = 2.0 * spots[k, HALF_WIDTH] + spots[k, _BLUR] + 2.0
        most = max(most, side * (side + _LANES))
    buffer = np.empty((BUFFERS, int(most) + _LANES))
    for k in range(spots.shape[0]):
        spot, width = spots[k], spots[k, _BLUR]
        left, top, columns, rows = box(canvas, spot, width)
        n = lay_out(buffer, rows, columns, left + 0.5 - spot[COLUMN], top + 0.5 - spot[ROW])
        shadow_pixels(buffer, n, spot, strength)
        darken(canvas, buffer, left, top, columns, rows)
