"""Drawing of shaded spheres with smooth outlines, and sensor noise.

Tested by ``test/simulation/tray_camera/test_tray_renderer.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.counter_rng import hashed, nearly_normal
from nanorocks_ros.numerics.stable_sort import stable_argsort

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Columns of a look, as the fields of experiment.materials.Look.
_BLUE, _GREEN, _RED, _AMBIENT, _DIFFUSE, _DARKENING, _GLOW, _SHEEN, _HIGHLIGHT = range(9)

# Unit vector to the lamp, upper left of the picture and above it; x right, y down, z up.
_LAMP = np.array([-0.36, -0.48, 0.80])
_LAMP_ACROSS = 0.60
# Half way between the lamp and the camera, where a mirror would show the lamp.
_HALF_LENGTH = math.sqrt(0.36 * 0.36 + 0.48 * 0.48 + 1.80 * 1.80)
_HALF = np.array([-0.36 / _HALF_LENGTH, -0.48 / _HALF_LENGTH, 1.80 / _HALF_LENGTH])


@compiled
def shade(look: NDArray[np.float64], x: float, y: float) -> tuple[float, float, float]:
    """Colour of a sphere of radius 1 at a place of its disc, (blue, green, red)."""
    z = math.sqrt(max(1.0 - x * x - y * y, 0.0))
    lambert = max(x * _LAMP[0] + y * _LAMP[1] + z * _LAMP[2], 0.0)
    mirror = max(x * _HALF[0] + y * _HALF[1] + z * _HALF[2], 0.0)
    broad = mirror * mirror
    broad *= broad
    broad *= broad
    narrow = broad * broad
    narrow *= narrow
    narrow *= narrow
    away = max(-(x * _LAMP[0] + y * _LAMP[1]) / _LAMP_ACROSS, 0.0)
    outline = 1.0 - look[_DARKENING] * (1.0 - z) * (1.0 - z)
    light = (look[_AMBIENT] + look[_DIFFUSE] * lambert) * outline
    light += look[_GLOW] * away * away * z + look[_SHEEN] * broad
    white = look[_HIGHLIGHT] * narrow
    return look[_BLUE] * light + white, look[_GREEN] * light + white, look[_RED] * light + white


@compiled
def coverage(distance: float, radius: float, width: float) -> float:
    """Fraction of a pixel that a disc covers, from the distance to its centre, all in [px].

    The outline is a smooth step of the given width, symmetric about the true radius, so
    that neither the area nor the centroid of the disc is moved by it.
    """
    t = (radius - distance) / width + 0.5
    if t <= 0.0:
        return 0.0
    if t >= 1.0:
        return 1.0
    return t * t * (3.0 - 2.0 * t)


@compiled
def draw_bead(
    canvas: NDArray[np.float32], disc: NDArray[np.float64], look: NDArray[np.float64], width: float
) -> None:
    """Draw one sphere over the canvas.

    Parameters
    ----------
    canvas : ndarray of float32, (rows, columns, 3), [gray levels]
        Changed.
    disc : ndarray (3,), [px]
        Column, row and radius; pixel (0, 0) is the square from 0 to 1.
    look : ndarray (9,)
    width : float, [px]
        Of the outline.
    """
    column, row, radius = disc[0], disc[1], disc[2]
    reach = radius + 0.5 * width
    top = max(math.floor(row - reach), 0)
    bottom = min(math.floor(row + reach) + 1, canvas.shape[0])
    left = max(math.floor(column - reach), 0)
    right = min(math.floor(column + reach) + 1, canvas.shape[1])
    for i in range(top, bottom):
        y = i + 0.5 - row
        for j in range(left, right):
            x = j + 0.5 - column
            distance = math.sqrt(x * x + y * y)
            share = coverage(distance, radius, width)
            if share > 0.0:
                inward = 1.0 / max(distance, radius)
                blue, green, red = shade(look, x * inward, y * inward)
                canvas[i, j, 0] += share * (blue - canvas[i, j, 0])
                canvas[i, j, 1] += share * (green - canvas[i, j, 1])
                canvas[i, j, 2] += share * (red - canvas[i, j, 2])


@compiled
def draw_beads(
    canvas: NDArray[np.float32],
    discs: NDArray[np.float64],
    heights: NDArray[np.float64],
    looks: NDArray[np.float64],
    width: float,
) -> None:
    """Draw spheres from the lowest to the highest.

    Parameters
    ----------
    canvas : ndarray of float32, (rows, columns, 3), [gray levels]
        Changed.
    discs : ndarray (n, 3), [px]
        Column, row and radius.
    heights : ndarray (n,)
        Of the centres, in any unit.
    looks : ndarray (n, 9)
    width : float, [px]
    """
    order = stable_argsort(heights)
    for k in range(order.size):
        draw_bead(canvas, discs[order[k]], looks[order[k]], width)


@compiled
def to_levels(value: float) -> int:
    """Gray level of the sensor: rounded and limited to 0 to 255."""
    return int(min(max(value, 0.0), 255.0) + 0.5)


@compiled
def expose(
    canvas: NDArray[np.float32], picture: NDArray[np.uint8], noise: float, key: np.uint64
) -> None:
    """Convert a drawing to gray levels, with independent noise for every pixel and channel.

    Parameters
    ----------
    canvas : ndarray of float32, (rows, columns, 3), [gray levels]
    picture : ndarray of uint8, (rows, columns, 3)
        Written.
    noise : float, [gray levels]
        Standard deviation.
    key : uint64
        Of the frame.
    """
    counter = 0
    for i in range(canvas.shape[0]):
        for j in range(canvas.shape[1]):
            for channel in range(3):
                value = np.float64(canvas[i, j, channel])
                if noise > 0.0:
                    value += noise * nearly_normal(key, counter)
                picture[i, j, channel] = to_levels(value)
                counter += 1


@compiled
def copy_surface(picture: NDArray[np.uint8], tile: NDArray[np.uint8], key: np.uint64) -> None:
    """Fill a picture with pieces of a noisy strip, each row from a random place.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, columns, 3)
        Written.
    tile : ndarray of uint8, (length, 3)
        Longer than a row.
    key : uint64
        Of the frame.
    """
    columns = picture.shape[1]
    places = np.uint64(tile.shape[0] - columns + 1)
    for i in range(picture.shape[0]):
        start = np.int64(hashed(key, i) % places)
        picture[i] = tile[start : start + columns]
