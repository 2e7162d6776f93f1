"""Shadows of the bodies on the floor.

Tested by ``test/simulation/plate_scene/test_plate_camera.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, kernel
from nanorocks_ros.simulation.plate_scene.simd_rectangles import (
    BUFFERS,
    COLUMN,
    EIGHT,
    HALF,
    HALF_WIDTH,
    LANES,
    ONE,
    RADIUS,
    ROW,
    SHARE,
    X,
    Y,
    coverage,
    drawn_rectangle,
    fill_coordinates,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Columns of a spot, after those that it shares with a place.
_BLUR, _FLOOR = 5, 6


@kernel
def shadow_pixels(
    out: NDArray[np.float32], n: int, spot: NDArray[np.float32], strength: float
) -> None:
    """Fraction of the light that a shadow leaves, for the pixels of a buffer."""
    radius, width = spot[RADIUS], spot[_BLUR]
    left, right = spot[_FLOOR] - spot[COLUMN], spot[_FLOOR + 1] - spot[COLUMN]
    top, bottom = spot[_FLOOR + 2] - spot[ROW], spot[_FLOOR + 3] - spot[ROW]
    for j in range(n):
        x, y = out[X, j], out[Y, j]
        share = strength * coverage(math.sqrt(x * x + y * y) - radius, width)
        on_floor = (x > left) & (x < right) & (y > top) & (y < bottom)
        out[SHARE, j] = ONE - share if on_floor else ONE


@kernel
def darken(
    canvas: NDArray[np.uint16],
    out: NDArray[np.float32],
    left: int,
    top: int,
    columns: int,
    rows: int,
) -> None:
    """Multiply a rectangle of a canvas by the light of `shadow_pixels`."""
    for channel in range(3):
        k = np.uint64(0)
        for i in range(top, top + rows):
            for m in range(columns // LANES):
                first = np.uint64(left + LANES * m)
                for j in range(EIGHT):
                    light = np.float32(canvas[channel, i, first + j]) * out[SHARE, k + j]
                    canvas[channel, i, first + j] = np.uint16(np.int32(light + HALF))
                k += EIGHT


@compiled
def draw_shadows(
    canvas: NDArray[np.uint16],
    spots: NDArray[np.float32],
    strength: float,
) -> None:
    """Darken the floor in the shadows of bodies.

    Parameters
    ----------
    canvas : ndarray of uint16, (3, rows, columns)
        Changed.
    spots : ndarray of float32, (n, 10), [px]
        Column and row of a shadow, its radius three times, the width of its outline; first and
        last column and row of the floor that it can fall on.
    strength : float32
        Share of the light that the deepest shadow takes.
    """
    max_pixels = 0.0
    for k in range(spots.shape[0]):
        side = 2.0 * spots[k, HALF_WIDTH] + spots[k, _BLUR] + 2.0
        max_pixels = max(max_pixels, side * (side + LANES))
    buffer = np.empty((BUFFERS, int(max_pixels) + LANES), dtype=np.float32)
    for k in range(spots.shape[0]):
        spot, width = spots[k], spots[k, _BLUR]
        left, top, columns, rows = drawn_rectangle(canvas, spot, width)
        n = fill_coordinates(
            buffer, rows, columns, left + 0.5 - spot[COLUMN], top + 0.5 - spot[ROW]
        )
        shadow_pixels(buffer, n, spot, strength)
        darken(canvas, buffer, left, top, columns, rows)
