"""Drawing of grains: an outline of a few lobes, and flat facets.

Tested by ``test/simulation/plate_scene/test_plate_camera.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import inlined, kernel
from nanorocks_ros.simulation.plate_scene.drawing.lamp import LAMP_X, LAMP_Y, LAMP_Z
from nanorocks_ros.simulation.plate_scene.simd_rectangles import (
    AMBIENT,
    COLUMN,
    COSINE,
    DIFFUSE,
    LEVELS,
    MATRIX,
    ONE,
    PLACE,
    RADIUS,
    ROW,
    SHARE,
    SINE,
    STEPS,
    TWO,
    ZERO,
    X,
    Y,
    blend_body,
    coverage,
    drawn_rectangle,
    fill_coordinates,
    float32,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Columns of a shape: cosine and sine terms of the outline for 2, 3 and 4 lobes, then facets as
# x, y, z of their normal and the brightness of their mineral.
LOBES = 6
FACETS = 5
SHAPE = LOBES + 4 * FACETS

_TINY, _BACK = float32(1e-9), float32(-2.0)


@inlined
def facet(
    best: float,
    light: float,
    point: tuple[float, float, float],
    shape: NDArray[np.float32],
    k: int,
    level: float,
) -> tuple[float, float]:
    """The facet that faces a point best, and its light, after a further facet."""
    n = LOBES + 4 * k
    along = point[0] * shape[n] + point[1] * shape[n + 1] + point[2] * shape[n + 2]
    return max(best, along), (level if along > best else light)


@kernel
def grain_pixels(
    out: NDArray[np.float32],
    n: int,
    place: NDArray[np.float32],
    shape: NDArray[np.float32],
    look: NDArray[np.float32],
    levels: NDArray[np.float32],
    width: float,
) -> None:
    """Coverage and light of the pixels of a grain, without branches so that SIMD applies.

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
        dx, dy = out[X, j], out[Y, j]
        x, y = xx * dx + xy * dy, yx * dx + yy * dy
        distance = math.sqrt(x * x + y * y) + _TINY
        scale = ONE / distance
        c1, s1 = x * scale, y * scale
        c2, s2 = c1 * c1 - s1 * s1, TWO * c1 * s1
        c3, s3 = c2 * c1 - s2 * s1, s2 * c1 + c2 * s1
        c4, s4 = c2 * c2 - s2 * s2, TWO * c2 * s2
        edge = ONE + a2 * c2 + b2 * s2 + a3 * c3 + b3 * s3 + a4 * c4 + b4 * s4
        inward = min(edge * scale, ONE)
        x, y = x * inward, y * inward
        point = x, y, math.sqrt(max(ONE - x * x - y * y, ZERO))
        best, light = facet(_BACK, l0, point, shape, 0, l0)
        best, light = facet(best, light, point, shape, 1, l1)
        best, light = facet(best, light, point, shape, 2, l2)
        best, light = facet(best, light, point, shape, 3, l3)
        best, light = facet(best, light, point, shape, 4, l4)
        out[SHARE, j] = coverage((distance - edge) * radius, width)
        out[LEVELS, j] = blue * light
        out[LEVELS + 1, j] = green * light
        out[LEVELS + 2, j] = red * light


@kernel
def draw_grain(
    canvas: NDArray[np.uint16],
    place: NDArray[np.float32],
    look: NDArray[np.float32],
    shape: NDArray[np.float32],
    width: float,
    buffer: NDArray[np.float32],
    turned: NDArray[np.float32],
    levels: NDArray[np.float32],
    lamp: NDArray[np.float32],
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
        lambert = max(
            right * lamp[LAMP_X] + down * lamp[LAMP_Y] + shape[n + 2] * lamp[LAMP_Z], ZERO
        )
        levels[k] = STEPS * (look[AMBIENT] + look[DIFFUSE] * lambert) * shape[n + 3]
    left, top, columns, rows = drawn_rectangle(canvas, place, width)
    n = fill_coordinates(buffer, rows, columns, left + 0.5 - place[COLUMN], top + 0.5 - place[ROW])
    grain_pixels(buffer, n, turned, shape, look, levels, width)
    blend_body(canvas, buffer, left, top, columns, rows)
