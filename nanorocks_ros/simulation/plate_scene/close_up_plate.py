"""The empty tray from near: floor, walls, rim, and the plate around it.

The tray moves on its springs over what is around it; the camera moves all of it. Both are
shifted by any part of a pixel with Lanczos interpolation.

Tested by ``test/simulation/plate_scene/test_close_up.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, kernel
from nanorocks_ros.simulation.plate_scene.close_up_painting import FULL, TrayLayers, tray_layers

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.settings import SceneSettings
    from nanorocks_ros.simulation.plate_scene.scene_geometry import SceneGeometry

_TAPS = 6
# More is painted on all sides than a picture shows, [px]; shifts up to this are possible.
MARGIN = 32
FURTHEST_SHIFT = MARGIN - _TAPS
"""Limit of the shift of tray and camera together, [px]."""


class CloseUpPlate:
    """A canvas with the empty tray, as `MovingPlate` but of a single tray.

    Parameters
    ----------
    geometry : SceneGeometry
    scene : SceneSettings
    chalk : float
        Dust in the tray, 0 to 2.
    seed : int
        Of all random parts.
    """

    def __init__(
        self, geometry: SceneGeometry, scene: SceneSettings, *, chalk: float, seed: int
    ) -> None:
        layers = tray_layers(geometry, scene, margin=MARGIN, chalk=chalk, seed=seed)
        self._layers, self._scale = layers, geometry.scale
        self._still = np.empty_like(layers.around)
        cover(self._still, layers.around, layers.tray, layers.mask)
        shape = (3, *geometry.shape)
        self._empty, self._canvas, self._around, self._tray = (
            np.empty(shape, dtype=np.uint16) for _ in range(4)
        )
        self._mask = np.empty((1, *geometry.shape), dtype=np.uint16)
        self._drawn: tuple[float, ...] = ()

    @property
    def layers(self) -> TrayLayers:
        """What is drawn, with a margin of `MARGIN`."""
        return self._layers

    def displaced(
        self, displacement: tuple[float, float], shift: tuple[float, float] = (0.0, 0.0)
    ) -> NDArray[np.uint16]:
        """The canvas with the tray displaced [m] and the picture shifted [px].

        The caller draws on it.
        """
        drawn = (*displacement, *shift)
        if drawn != self._drawn:
            self._draw(displacement, shift)
            self._drawn = drawn
        self._canvas[:] = self._empty
        return self._canvas

    def _draw(self, displacement: tuple[float, float], shift: tuple[float, float]) -> None:
        across, down = (self._scale * part for part in displacement)
        if across == 0.0 and down == 0.0:
            shifted(self._empty, self._still, *shift)
            return
        moved = shift[0] + across, shift[1] + down
        shifted(self._around, self._layers.around, *shift)
        shifted(self._tray, self._layers.tray, *moved)
        shifted(self._mask, self._layers.mask, *moved)
        cover(self._empty, self._around, self._tray, self._mask)


def shifted(
    target: NDArray[np.uint16], source: NDArray[np.uint16], across: float, down: float
) -> None:
    """Shift a picture with a margin of `MARGIN`, limited to `FURTHEST_SHIFT`, [px].

    Parameters
    ----------
    target : ndarray of uint16, (channels, rows, columns)
        Written.
    source : ndarray of uint16, (channels, rows + 2 MARGIN, columns + 2 MARGIN)
    across, down : float, [px]
    """
    across, down = (min(max(s, -FURTHEST_SHIFT), FURTHEST_SHIFT) for s in (across, down))
    left, columns = _kernel_of(-across)
    top, rows = _kernel_of(-down)
    if columns is None and rows is None:
        height, width = target.shape[1:]
        target[:] = source[:, top : top + height, left : left + width]
        return
    flat = np.zeros(_TAPS, dtype=np.float32)
    flat[_TAPS // 2 - 1] = 1.0
    offset = _TAPS // 2 - 1
    _filtered(
        target,
        source,
        (top - offset, left - offset),
        flat if rows is None else rows,
        flat if columns is None else columns,
    )


def _kernel_of(place: float) -> tuple[int, NDArray[np.float32] | None]:
    """First source pixel and the weights of a shift; None for a whole number of pixels."""
    first = math.floor(place)
    part = place - first
    if part == 0.0:
        return MARGIN + first, None
    x = part - (np.arange(_TAPS) - (_TAPS // 2 - 1))
    weights = np.sinc(x) * np.sinc(x / (_TAPS // 2))
    return MARGIN + first, np.asarray(weights / weights.sum(), dtype=np.float32)


@compiled
def _filtered(
    target: NDArray[np.uint16],
    source: NDArray[np.uint16],
    corner: tuple[int, int],
    rows: NDArray[np.float32],
    columns: NDArray[np.float32],
) -> None:
    """Separable filter of six weights along columns and rows."""
    top, left = corner
    height, width = target.shape[1:]
    lines = np.empty((height + 5, width), dtype=np.float32)
    a, b, c, d, e, f = columns[0], columns[1], columns[2], columns[3], columns[4], columns[5]
    g, h, i, k, m, n = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5]
    half, low, high = np.float32(0.5), np.float32(0.0), np.float32(65535.0)
    for channel in range(target.shape[0]):
        for y in range(height + 5):
            line = source[channel, top + y, left : left + width + 5]
            out = lines[y]
            for x in range(width):
                out[x] = (
                    (a * np.float32(line[x]) + b * np.float32(line[x + 1]))
                    + (c * np.float32(line[x + 2]) + d * np.float32(line[x + 3]))
                    + (e * np.float32(line[x + 4]) + f * np.float32(line[x + 5]))
                )
        for y in range(height):
            row = target[channel, y]
            u, v, w = lines[y], lines[y + 1], lines[y + 2]
            p, q, r = lines[y + 3], lines[y + 4], lines[y + 5]
            for x in range(width):
                value = (g * u[x] + h * v[x]) + (i * w[x] + k * p[x]) + (m * q[x] + n * r[x])
                row[x] = np.uint16(np.int32(min(max(value + half, low), high)))


@compiled
def cover(
    target: NDArray[np.uint16],
    below: NDArray[np.uint16],
    above: NDArray[np.uint16],
    mask: NDArray[np.uint16],
) -> None:
    """Cover a picture with another where a mask says so.

    Parameters
    ----------
    target, below, above : ndarray of uint16, (3, rows, columns)
        The first is written.
    mask : ndarray of uint16, (1, rows, columns)
        `FULL`: only the picture above is seen.
    """
    for channel in range(3):
        for i in range(target.shape[1]):
            _cover_row(target[channel, i], below[channel, i], above[channel, i], mask[0, i])


@kernel
def _cover_row(
    target: NDArray[np.uint16],
    below: NDArray[np.uint16],
    above: NDArray[np.uint16],
    mask: NDArray[np.uint16],
) -> None:
    part, half = np.float32(1.0 / FULL), np.float32(0.5)
    for j in range(target.size):
        low = np.float32(below[j])
        value = low + part * np.float32(mask[j]) * (np.float32(above[j]) - low)
        target[j] = np.uint16(np.int32(value + half))
