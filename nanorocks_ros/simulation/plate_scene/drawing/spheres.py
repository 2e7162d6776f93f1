"""Drawing of beads: spheres and ovals with shading, a highlight, and dust.

Tested by ``test/simulation/plate_scene/test_plate_camera.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import kernel
from nanorocks_ros.simulation.plate_scene.drawing.lamp import (
    HALF_X,
    HALF_Y,
    HALF_Z,
    LAMP_ACROSS,
    LAMP_X,
    LAMP_Y,
    LAMP_Z,
)
from nanorocks_ros.simulation.plate_scene.simd_rectangles import (
    ACROSS,
    AMBIENT,
    COLUMN,
    COSINE,
    DARKENING,
    DIFFUSE,
    DOWN,
    DUST,
    GLOW,
    HALF,
    HIGHLIGHT,
    LEVELS,
    LIT,
    MATRIX,
    ONE,
    RADIUS,
    ROW,
    SHARE,
    SHEEN,
    SINE,
    STEPS,
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

_CHALK = np.array([226.0, 229.0, 231.0], dtype=np.float32)

# Squares of the pattern of dust to the radius of a bead.
_DUST_SQUARES = float32(12.0)


@kernel
def bead_pixels(
    out: NDArray[np.float32],
    n: int,
    place: NDArray[np.float32],
    look: NDArray[np.float32],
    lamp: NDArray[np.float32],
    width: float,
) -> None:
    """Coverage and light of the pixels of a bead, without branches so that SIMD applies.

    The light is that of `drawing.shade`.

    Parameters
    ----------
    out : ndarray (9, n or more)
        Written: share of each pixel, levels, how it is lit, and the place on the bead, which
        has turned.
    place : ndarray (12,)
    look : ndarray (9,)
    lamp : ndarray (7,)
        See `Lamp.row`.
    width : float, [px]
    """
    xx, xy, yx, yy = place[MATRIX], place[MATRIX + 1], place[MATRIX + 2], place[MATRIX + 3]
    radius, cosine, sine = place[RADIUS], place[COSINE], place[SINE]
    ambient, diffuse, darkening = look[AMBIENT], look[DIFFUSE], look[DARKENING]
    glow, sheen, highlight = look[GLOW], look[SHEEN], STEPS * look[HIGHLIGHT]
    blue, green, red = STEPS * look[0], STEPS * look[1], STEPS * look[2]
    lamp_x, lamp_y, lamp_z = lamp[LAMP_X], lamp[LAMP_Y], lamp[LAMP_Z]
    half_x, half_y, half_z = lamp[HALF_X], lamp[HALF_Y], lamp[HALF_Z]
    lamp_across = lamp[LAMP_ACROSS]
    for j in range(n):
        dx, dy = out[X, j], out[Y, j]
        x, y = xx * dx + xy * dy, yx * dx + yy * dy
        distance = math.sqrt(x * x + y * y)
        inward = ONE / max(distance, ONE)
        x, y = x * inward, y * inward
        z = math.sqrt(max(ONE - x * x - y * y, ZERO))
        along = x * lamp_x + y * lamp_y
        lambert = max(along + z * lamp_z, ZERO)
        mirror = max(x * half_x + y * half_y + z * half_z, ZERO)
        mirror = mirror * mirror
        mirror = mirror * mirror
        broad = mirror * mirror
        narrow = broad * broad
        narrow = narrow * narrow
        away = max(-along / lamp_across, ZERO)
        light = (ambient + diffuse * lambert) * (ONE - darkening * (ONE - z) * (ONE - z))
        out[SHARE, j] = coverage((distance - ONE) * radius, width)
        light += glow * away * away * z + sheen * broad
        out[LEVELS, j] = blue * light + highlight * narrow
        out[LEVELS + 1, j] = green * light + highlight * narrow
        out[LEVELS + 2, j] = red * light + highlight * narrow
        out[LIT, j] = HALF + HALF * lambert
        out[ACROSS, j] = x * cosine + y * sine
        out[DOWN, j] = y * cosine - x * sine


@kernel
def put_dust(
    out: NDArray[np.float32], n: int, dust: NDArray[np.float32], start: int, cover: float
) -> None:
    """Put dust over the pixels of `bead_pixels`."""
    size = dust.shape[0]
    for j in range(n):
        y = int((out[DOWN, j] + ONE) * _DUST_SQUARES) + start
        x = int((out[ACROSS, j] + ONE) * _DUST_SQUARES) + start // size
        hidden = min(cover * dust[y % size, x % size], ONE)
        for channel in range(3):
            level = out[LEVELS + channel, j]
            chalk = STEPS * _CHALK[channel] * out[LIT, j]
            out[LEVELS + channel, j] = level + hidden * (chalk - level)


@kernel
def draw_bead(
    canvas: NDArray[np.uint16],
    place: NDArray[np.float32],
    look: NDArray[np.float32],
    dust: NDArray[np.float32],
    start: int,
    width: float,
    buffer: NDArray[np.float32],
    lamp: NDArray[np.float32],
) -> None:
    """Draw a shaded sphere, or oval, under its dust; see `draw_bodies`."""
    left, top, columns, rows = drawn_rectangle(canvas, place, width)
    n = fill_coordinates(buffer, rows, columns, left + 0.5 - place[COLUMN], top + 0.5 - place[ROW])
    bead_pixels(buffer, n, place, look, lamp, width)
    if place[DUST] > 0.0:
        put_dust(buffer, n, dust, start, place[DUST])
    blend_body(canvas, buffer, left, top, columns, rows)
