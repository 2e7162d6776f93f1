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


# Rows of the buffer in which a row of a body is worked out.
_SHARE, _WHITE, _ONE, _LIT, _ACROSS_DUST, _DOWN_DUST, _HIDDEN = range(7)
BUFFERS = 7


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
def grain_row(
    out: NDArray[np.float64],
    n: int,
    place: NDArray[np.float64],
    shape: NDArray[np.float64],
    levels: NDArray[np.float64],
    across: float,
    down: float,
    width: float,
) -> None:
    """Shares and light of a row of a grain, without branches so that it runs in lanes.

    Parameters
    ----------
    out : ndarray (7, n or more)
        Written: share of each pixel, light.
    place : ndarray (12,)
        With the turn of the grain in its matrix.
    shape : ndarray (SHAPE,)
    levels : ndarray (FACETS,)
        Light of each facet.
    across, down : float, [px]
        From the centre of the grain to that of the first pixel.
    width : float, [px]
    """
    xx, xy, yx, yy = place[MATRIX], place[MATRIX + 1], place[MATRIX + 2], place[MATRIX + 3]
    radius = place[RADIUS]
    a2, b2, a3, b3, a4, b4 = shape[0], shape[1], shape[2], shape[3], shape[4], shape[5]
    l0, l1, l2, l3, l4 = levels[0], levels[1], levels[2], levels[3], levels[4]
    for j in range(n):
        dx = across + j
        x, y = xx * dx + xy * down, yx * dx + yy * down
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
        out[_WHITE, j] = light


@kernel
def colour_grain(line: NDArray[np.uint16], buffer: NDArray[np.float64], colour: float) -> None:
    """Draw a row of a grain, as `grain_row` left it, in one channel."""
    for j in range(line.size):
        before = np.float64(line[j])
        value = before + buffer[_SHARE, j] * (colour * buffer[_WHITE, j] - before)
        line[j] = np.uint16(np.int32(value + 0.5))


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
    column, row = place[COLUMN], place[ROW]
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
    top, bottom = span(canvas.shape[1], row, place[HALF_HEIGHT] + 0.5 * width)
    left, end = span(canvas.shape[2], column, place[HALF_WIDTH] + 0.5 * width)
    for i in range(top, bottom):
        grain_row(
            buffer, end - left, turned, shape, levels, left + 0.5 - column, i + 0.5 - row, width
        )
        for channel in range(3):
            colour_grain(canvas[channel, i, left:end], buffer, look[channel])


@kernel
def bead_row(
    out: NDArray[np.float64],
    n: int,
    place: NDArray[np.float64],
    look: NDArray[np.float64],
    across: float,
    down: float,
    width: float,
) -> None:
    """Shares and light of a row of a bead, without branches so that it runs in lanes.

    The light is that of `drawing.shade`.

    Parameters
    ----------
    out : ndarray (7, n or more)
        Written: share of each pixel, white light, light in the colour of the bead, how it is
        lit, and the place on the bead, which has turned.
    place : ndarray (12,)
    look : ndarray (9,)
    across, down : float, [px]
        From the centre of the bead to that of the first pixel.
    width : float, [px]
    """
    xx, xy, yx, yy = place[MATRIX], place[MATRIX + 1], place[MATRIX + 2], place[MATRIX + 3]
    radius, cosine, sine = place[RADIUS], place[COSINE], place[SINE]
    ambient, diffuse, darkening = look[_AMBIENT], look[_DIFFUSE], look[_DARKENING]
    glow, sheen, highlight = look[_GLOW], look[_SHEEN], look[_HIGHLIGHT]
    for j in range(n):
        dx = across + j
        x, y = xx * dx + xy * down, yx * dx + yy * down
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
        out[_WHITE, j] = highlight * narrow
        out[_ONE, j] = light + glow * away * away * z + sheen * broad
        out[_LIT, j] = 0.5 + 0.5 * lambert
        out[_ACROSS_DUST, j] = x * cosine + y * sine
        out[_DOWN_DUST, j] = y * cosine - x * sine


@kernel
def colour_bead(
    line: NDArray[np.uint16], buffer: NDArray[np.float64], colour: float, chalk: float
) -> None:
    """Draw a row of a bead, as `bead_row` left it, in one channel."""
    for j in range(line.size):
        level = colour * buffer[_ONE, j] + buffer[_WHITE, j]
        level += buffer[_HIDDEN, j] * (chalk * buffer[_LIT, j] - level)
        before = np.float64(line[j])
        value = before + buffer[_SHARE, j] * (LEVEL * level - before)
        line[j] = np.uint16(np.int32(value + 0.5))


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
    column, row, cover = place[COLUMN], place[ROW], place[DUST]
    top, bottom = span(canvas.shape[1], row, place[HALF_HEIGHT] + 0.5 * width)
    left, end = span(canvas.shape[2], column, place[HALF_WIDTH] + 0.5 * width)
    size = dust.shape[0]
    for j in range(end - left):
        buffer[_HIDDEN, j] = 0.0
    for i in range(top, bottom):
        bead_row(buffer, end - left, place, look, left + 0.5 - column, i + 0.5 - row, width)
        if cover > 0.0:
            for j in range(end - left):
                y = int((buffer[_DOWN_DUST, j] + 1.0) * _DUST_SQUARES) + start
                x = int((buffer[_ACROSS_DUST, j] + 1.0) * _DUST_SQUARES) + start // size
                buffer[_HIDDEN, j] = min(cover * dust[y % size, x % size], 1.0)
        for channel in range(3):
            colour_bead(canvas[channel, i, left:end], buffer, look[channel], _CHALK[channel])


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
    widest = 0.0
    for k in range(order.size):
        widest = max(widest, places[k, HALF_WIDTH])
    buffer = np.empty((BUFFERS, int(2.0 * widest + width) + 3))
    turned, levels = np.empty(PLACE), np.empty(FACETS)
    for k in range(order.size):
        i = order[k]
        if kinds[i] == GRAIN:
            shape = shapes[i % shapes.shape[0]]
            draw_grain(canvas, places[i], looks[i], shape, width, buffer, turned, levels)
        else:
            draw_bead(canvas, places[i], looks[i], dust, i * 7919, width, buffer)


@kernel
def shadow_row(
    kept: NDArray[np.uint32],
    n: int,
    spot: NDArray[np.float64],
    across: float,
    down: float,
    strength: float,
) -> None:
    """Parts of 2^16 of the light that a shadow leaves in a row of pixels, (n or more,)."""
    radius, width = spot[2], spot[3]
    for j in range(n):
        dx = across + j
        share = covered(math.sqrt(dx * dx + down * down) - radius, width)
        kept[j] = np.uint32(np.int32(65536.0 * (1.0 - strength * share) - 0.5))


@kernel
def darken(line: NDArray[np.uint16], kept: NDArray[np.uint32]) -> None:
    """Leave so many parts of 2^16 of the light in a row of pixels."""
    for j in range(line.size):
        line[j] = np.uint16((np.uint32(line[j]) * kept[j]) >> np.uint32(16))


@kernel
def draw_shadows(
    canvas: NDArray[np.uint16],
    spots: NDArray[np.float64],
    bounds: NDArray[np.int64],
    strength: float,
    kept: NDArray[np.uint32],
) -> None:
    """Darken the floor where bodies keep the light away.

    Parameters
    ----------
    canvas : ndarray of uint16, (3, rows, columns)
        Changed.
    spots : ndarray (n, 4), [px]
        Column and row of a shadow, its radius, and the width of its outline.
    bounds : ndarray of int64, (n, 4), [px]
        First and last column and row (not included) that it can fall on: of the floor.
    strength : float
        Share of the light that the deepest shadow takes.
    kept : ndarray of uint32, (columns,)
        To work in.
    """
    for k in range(spots.shape[0]):
        spot = spots[k]
        reach = spot[2] + 0.5 * spot[3]
        top, bottom = span(bounds[k, 3], spot[1], reach)
        left, right = span(bounds[k, 1], spot[0], reach)
        left = max(left, bounds[k, 0])
        for i in range(max(top, bounds[k, 2]), bottom):
            shadow_row(kept, right - left, spot, left + 0.5 - spot[0], i + 0.5 - spot[1], strength)
            for channel in range(3):
                darken(canvas[channel, i, left:right], kept)
