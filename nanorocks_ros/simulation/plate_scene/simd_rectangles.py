"""Rectangles of pixels for SIMD loops in single precision.

The pixels of a body go through one long loop, since loops over its short rows would not be
vectorised. The rows of the rectangle are padded to a multiple of 8, so that drawing them is.

Tested by ``test/simulation/plate_scene/test_plate_camera.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

import numpy as np

from nanorocks_ros.numerics.compiled import inlined, kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

LEVEL = 64
"""Steps of a canvas to one gray level; brighter than white is kept up to 1023 levels."""

# Columns of a place, see `bodies.draw_bodies`; the matrix takes four.
COLUMN, ROW, HALF_WIDTH, HALF_HEIGHT, RADIUS, MATRIX = range(6)
COSINE, SINE, DUST = range(9, 12)
PLACE = 12

# Columns of a look, as the fields of experiment.materials.Look; 0 to 2 are blue, green and red.
AMBIENT, DIFFUSE, DARKENING, GLOW, SHEEN, HIGHLIGHT = range(3, 9)

# Rows of the buffer: place of a pixel, share of it that is covered, levels; of beads further how
# the place is lit and where it is on the bead.
X, Y, SHARE, LEVELS, LIT, ACROSS, DOWN = 0, 1, 2, 3, 6, 7, 8
BUFFERS = 9

LANES = 8
EIGHT = np.uint64(LANES)


def float32(value: float) -> float:
    """A number in single precision.

    Twice as many fit into a lane, and a literal among them would make them long again.
    """
    return cast('float', np.float32(value))


ZERO, HALF, ONE, TWO, THREE = (float32(value) for value in (0.0, 0.5, 1.0, 2.0, 3.0))
STEPS = float32(LEVEL)


@inlined
def coverage(beyond: float, width: float) -> float:
    """Fraction of a pixel that is covered, from its distance beyond an outline, [px].

    The step of `drawing.coverage`, without branches.
    """
    t = min(max(HALF - beyond / width, ZERO), ONE)
    return t * t * (THREE - TWO * t)


@inlined
def span(size: int, middle: float, reach: float) -> tuple[int, int]:
    """First pixel that a body can cover and the one after the last."""
    first = max(math.floor(middle - reach), 0)
    return first, min(math.floor(middle + reach) + 1, size)


@kernel
def fill_coordinates(
    out: NDArray[np.float32], rows: int, columns: int, across: float, down: float
) -> int:
    """Write the coordinates of the pixels of a rectangle; returns how many.

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
        for m in range(columns // LANES):
            for j in range(EIGHT):
                out[X, k + j] = np.float32(across + (LANES * m + np.int64(j)))
                out[Y, k + j] = np.float32(down + i)
            k += EIGHT
    return int(k)


@inlined
def drawn_rectangle(
    canvas: NDArray[np.uint16], place: NDArray[np.float32], width: float
) -> tuple[int, int, int, int]:
    """Rectangle in which a body is drawn: first column, first row, columns, rows."""
    top, bottom = span(canvas.shape[1], place[ROW], place[HALF_HEIGHT] + 0.5 * width)
    left, right = span(canvas.shape[2], place[COLUMN], place[HALF_WIDTH] + 0.5 * width)
    columns = max(right - left + LANES - 1, 0) // LANES * LANES
    # Where the canvas ends, it begins so much earlier.
    left = max(min(left, canvas.shape[2] - columns), 0)
    return left, top, min(columns, canvas.shape[2] // LANES * LANES), max(bottom - top, 0)


@kernel
def blend_body(
    canvas: NDArray[np.uint16],
    out: NDArray[np.float32],
    left: int,
    top: int,
    columns: int,
    rows: int,
) -> None:
    """Blend the levels of a buffer into a rectangle of a canvas by their coverage."""
    for channel in range(3):
        k = np.uint64(0)
        for i in range(top, top + rows):
            for m in range(columns // LANES):
                first = np.uint64(left + LANES * m)
                for j in range(EIGHT):
                    before = np.float32(canvas[channel, i, first + j])
                    share, level = out[SHARE, k + j], out[LEVELS + channel, k + j]
                    value = before + share * (level - before) + HALF
                    canvas[channel, i, first + j] = np.uint16(np.int32(value))
                k += EIGHT
