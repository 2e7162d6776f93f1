"""Painting of the empty tray from near, with edges exact to a fraction of a pixel.

Tested by ``test/simulation/plate_scene/test_close_up.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.simulation.plate_scene.drawing.chalk import dusted_floor
from nanorocks_ros.simulation.plate_scene.drawing.lamp import Lamp
from nanorocks_ros.simulation.plate_scene.empty_plate import (
    CHAMFER,
    FLOOR,
    PIXEL_BLUR,
    TOP,
    streaks,
)
from nanorocks_ros.simulation.plate_scene.simd_rectangles import LEVEL

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.settings import SceneSettings
    from nanorocks_ros.simulation.plate_scene.scene_geometry import SceneGeometry

    Field = NDArray[np.float64]

FULL = 1 << 14
"""Value of a mask where nothing below is seen."""

# Light on the wall of a cell relative to the plate's top, and the part that depends on its side.
_WALL, _WALL_SLANT = 0.62, 0.45


class TrayLayers(NamedTuple):
    """The empty tray and what is around it.

    Parameters
    ----------
    around, tray : ndarray of uint16, (3, rows, columns), bgr, [1/64 gray levels]
    mask : ndarray of uint16, (1, rows, columns)
        How much of the tray and its rim is seen, up to `FULL`.
    """

    around: NDArray[np.uint16]
    tray: NDArray[np.uint16]
    mask: NDArray[np.uint16]


class _Box(NamedTuple):
    """A rectangle in the picture, [px]."""

    left: float
    top: float
    right: float
    bottom: float

    def grown(self, width: float) -> _Box:
        return _Box(self.left - width, self.top - width, self.right + width, self.bottom + width)

    def magnified(self, factor: float, axis: Field) -> _Box:
        x, y = axis
        return _Box(
            x + factor * (self.left - x),
            y + factor * (self.top - y),
            x + factor * (self.right - x),
            y + factor * (self.bottom - y),
        )


class _Grid(NamedTuple):
    """Centres of the pixels that are painted, [px] of the picture."""

    x: Field
    y: Field

    @property
    def shape(self) -> tuple[int, int]:
        return self.y.shape[0], self.x.shape[1]


def tray_layers(
    geometry: SceneGeometry, scene: SceneSettings, *, margin: int, chalk: float, seed: int
) -> TrayLayers:
    """Paint the only tray of a scene and its surroundings.

    Parameters
    ----------
    geometry : SceneGeometry
        Of a close-up.
    scene : SceneSettings
    margin : int, [px]
        Painted on all sides beyond the picture.
    chalk : float
        Dust in the tray, 0 to 2.
    seed : int
        Of all random parts.
    """
    rows, columns = geometry.shape
    y, x = np.ogrid[-margin + 0.5 : rows + margin, -margin + 0.5 : columns + margin]
    grid, lamp = _Grid(x, y), Lamp(scene)
    rng = np.random.default_rng(seed)
    number = scene.trays[0]
    left, top = geometry.corner(number)
    sides = geometry.sides(number)
    floor = _Box(left, top, left + sides[0], top + sides[1])
    opening = floor.magnified(geometry.rim_magnification(number), geometry.axis)
    around = _surface(grid, geometry, scene, rng)[..., np.newaxis] * (scene.plate_shade * TOP)
    tray = _floor(grid, floor, geometry, scene, rng) * _floor_light(grid, floor, geometry, lamp)
    colour = tray[..., np.newaxis] * (scene.floor_shade * FLOOR)
    if chalk > 0.0:
        colour = _dusted(colour, grid, floor, chalk * 1.0, geometry.scale, rng)
    if opening != floor:
        walls = _faces(grid, opening, _WALL * (1.0 + _WALL_SLANT * lamp.facing))
        colour = _over(walls * around, colour, _covered(grid, floor))
    width = scene.rim_width if scene.rim_width > 0.0 else CHAMFER
    light = lamp.rim(scene.rim_shade) if scene.rim_width > 0.0 else lamp.chamfer
    rim = _faces(grid, opening, np.array(light)) * around
    colour = _over(rim, colour, _covered(grid, opening))
    outer = opening.grown(width * geometry.scale)
    mask = np.rint(_covered(grid, outer) * FULL)
    return TrayLayers(_levels(around), _levels(colour), mask.astype(np.uint16)[np.newaxis])


def _over(outside: Field, inside: Field, share: Field) -> Field:
    """The inside where its share is 1, the outside where that is 0."""
    return np.asarray(outside + share[..., np.newaxis] * (inside - outside))


def _covered(grid: _Grid, box: _Box) -> Field:
    """Share of each pixel that a rectangle covers, seen with the width of a pixel."""
    across, down = _between(grid.x, box.left, box.right), _between(grid.y, box.top, box.bottom)
    return np.asarray(across * down)


def _between(place: Field, low: float, high: float) -> Field:
    width = PIXEL_BLUR * math.sqrt(2.0)
    error_function = np.vectorize(math.erf)
    rises, falls = error_function((place - low) / width), error_function((place - high) / width)
    return np.asarray(0.5 * (rises - falls))


def _faces(grid: _Grid, opening: _Box, light: Field) -> Field:
    """Light on the four sides around an opening, (rows, columns, 1): mitred at its corners."""
    x, y = grid
    depths = np.broadcast_arrays(
        opening.left - x, opening.top - y, x - opening.right, y - opening.bottom
    )
    side = np.argmax(np.stack(depths), axis=0)
    return np.asarray(np.asarray(light)[side][..., np.newaxis])


def _surface(
    grid: _Grid, geometry: SceneGeometry, scene: SceneSettings, rng: np.random.Generator
) -> Field:
    """Brushed metal with the pattern of the settings, about 1."""
    shape, brush = grid.shape, 0.002 * geometry.scale
    light = 1.0 + 0.018 * streaks(shape, rng, brush, 0.6) + 0.01 * streaks(shape, rng, 1, 1)
    light = light + 0.03 * streaks(shape, rng, 8.0 * brush, 5.0 * brush)
    return np.asarray(light + _pattern(shape, geometry, scene, rng), dtype=np.float64)


def _floor(
    grid: _Grid,
    floor: _Box,
    geometry: SceneGeometry,
    scene: SceneSettings,
    rng: np.random.Generator,
) -> Field:
    """The milled floor with the pattern of the settings, about 1."""
    shape, mill = grid.shape, 0.003 * geometry.scale
    light = 1.0 + 0.012 * streaks(shape, rng, 0.8, 0.8) + 0.02 * streaks(shape, rng, mill, mill)
    return np.asarray(light + _pattern(shape, geometry, scene, rng), dtype=np.float64)


def _pattern(
    shape: tuple[int, int],
    geometry: SceneGeometry,
    scene: SceneSettings,
    rng: np.random.Generator,
) -> Field:
    length = max(scene.floor_texture_length * geometry.scale, 0.5)
    pattern = scene.floor_texture * streaks(shape, rng, length, length)
    return np.asarray(np.maximum(pattern, -0.8), dtype=np.float64)


def _floor_light(grid: _Grid, floor: _Box, geometry: SceneGeometry, lamp: Lamp) -> Field:
    scale = geometry.scale
    sides = (floor.right - floor.left) / scale, (floor.bottom - floor.top) / scale
    # Beyond the walls, where it is not seen, the light is that at the wall.
    x = np.clip((grid.x - floor.left) / scale, 0.0, sides[0])
    y = np.clip((grid.y - floor.top) / scale, 0.0, sides[1])
    return lamp.floor_light(x, y, sides)


def _dusted(
    colour: Field, grid: _Grid, floor: _Box, chalk: float, scale: float, rng: np.random.Generator
) -> Field:
    columns = slice(*np.searchsorted(grid.x[0], (floor.left, floor.right)))
    rows = slice(*np.searchsorted(grid.y[:, 0], (floor.top, floor.bottom)))
    dusted = colour.copy()
    part = np.asarray(colour[rows, columns], dtype=np.float32)
    dusted[rows, columns] = dusted_floor(part, chalk, scale, rng)
    return dusted


def _levels(colour: Field) -> NDArray[np.uint16]:
    levels = np.clip(colour, 0.0, 255.0) * LEVEL + 0.5
    return np.ascontiguousarray(levels.astype(np.uint16).transpose(2, 0, 1))
