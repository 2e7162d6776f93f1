"""Drawing of all bodies of the scene, from the lowest to the highest.

Tested by ``test/simulation/plate_scene/test_plate_camera.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.simulation.plate_scene.drawing.grains import FACETS, draw_grain
from nanorocks_ros.simulation.plate_scene.drawing.spheres import draw_bead
from nanorocks_ros.simulation.plate_scene.simd_rectangles import (
    BUFFERS,
    HALF_HEIGHT,
    HALF_WIDTH,
    LANES,
    PLACE,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Kinds of bodies.
SPHERE, GRAIN = 0, 1


@compiled
def draw_bodies(
    canvas: NDArray[np.uint16],
    order: NDArray[np.int64],
    places: NDArray[np.float32],
    looks: NDArray[np.float32],
    kinds: NDArray[np.int64],
    shapes: NDArray[np.float32],
    dust: NDArray[np.float32],
    width: float,
    lamp: NDArray[np.float32],
) -> None:
    """Draw bodies over the canvas and over each other.

    Parameters
    ----------
    canvas : ndarray of uint16, (3, rows, columns), bgr, [1/64 gray levels]
        Changed.
    order : ndarray of int64, (n,)
        The lowest first.
    places : ndarray of float32, (n, 12)
        Column, row; half sides of the rectangle around the body; mean radius, [px]; matrix
        (2 x 2) from pixels to parts of the radius; cosine and sine of the angle that the body
        has turned by; share of dust.
    looks : ndarray of float32, (n, 9)
        Columns as the fields of `experiment.materials.Look`, levels below 1000.
    kinds : ndarray of int64, (n,)
        `SPHERE` or `GRAIN`.
    shapes : ndarray of float32, (n_shapes, SHAPE)
        Grains take one after the other.
    dust : ndarray of float32, (size, size)
        Pattern of dust; each bead starts at another place of it.
    width : float32, [px]
        Of the outlines.
    lamp : ndarray of float32, (7,)
        See `Lamp.row`.
    """
    max_pixels = 0.0
    for k in range(order.size):
        sides = places[k, HALF_WIDTH : HALF_HEIGHT + 1]
        across, down = 2.0 * sides[0] + width + 2.0 + LANES, 2.0 * sides[1] + width + 2.0
        max_pixels = max(max_pixels, across * down)
    buffer = np.empty((BUFFERS, int(max_pixels) + LANES), dtype=np.float32)
    turned = np.empty(PLACE, dtype=np.float32)
    levels = np.empty(FACETS, dtype=np.float32)
    for k in range(order.size):
        i = order[k]
        if kinds[i] == GRAIN:
            shape = shapes[i % shapes.shape[0]]
            draw_grain(canvas, places[i], looks[i], shape, width, buffer, turned, levels, lamp)
        else:
            draw_bead(canvas, places[i], looks[i], dust, i * 7919, width, buffer, lamp)
