"""The empty scene: the aluminium plate with its cells and housing, through the lens.

Painted once in the rectified picture at twice the scale, then remapped through the lens.

Tested by ``test/simulation/plate_scene/test_plate_camera.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.experiment.plate import PLATE
from nanorocks_ros.simulation.plate_scene.drawing.chalk import dusted_floor
from nanorocks_ros.simulation.plate_scene.drawing.lamp import Lamp
from nanorocks_ros.simulation.plate_scene.simd_rectangles import LEVEL

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.plate import Region
    from nanorocks_ros.settings import SceneSettings
    from nanorocks_ros.simulation.plate_scene.scene_geometry import SceneGeometry

    Picture = NDArray[np.float32]

# Blue, green, red; aluminium is nearly gray.
TOP = np.array([141.0, 139.0, 135.0], np.float32)
FLOOR = np.array([160.0, 158.0, 154.0], np.float32)
_HOUSING = np.array([33.0, 31.0, 30.0], np.float32)

# Painted at so many times the scale of the picture.
_FINE = 2
# What is painted around the plate, [m].
_SURROUNDINGS = 0.004
# Chamfer of a cell, and of the plate itself, [m].
CHAMFER, _EDGE = 0.0005, 0.0009
# Places of the screws on the plate and their radius, [m].
_SCREWS = ((3, 3), (77, 3), (3, 77), (77, 77), (3, 34), (77, 34), (14, 67), (66, 67))
_SCREW = 0.0016
# Standard deviation of noise that is enlarged rather than blurred further, [px].
_SMOOTH = 3.0
PIXEL_BLUR = 0.36
"""Standard deviation of the blur of a pixel's own width, [px]."""


def empty_scene(
    geometry: SceneGeometry, scene: SceneSettings, *, chalk: dict[int, float], seed: int
) -> NDArray[np.uint16]:
    """The scene without beads.

    Parameters
    ----------
    geometry : SceneGeometry
    scene : SceneSettings
    chalk : dict of int to float
        Dust in each tray, 0 to 2.
    seed : int
        Of all random parts.

    Returns
    -------
    ndarray of uint16, (3, rows, columns), bgr, [1/64 gray levels]
    """
    rng = np.random.default_rng(seed)
    left, top, _, _ = geometry.plate
    margin = round(_SURROUNDINGS * geometry.scale)
    corner = np.array([left - margin, top - margin])
    painting = _Painting(geometry, scene, margin, rng)
    for number, region in geometry.regions.items():
        # Each cell has its own random numbers: dust in one changes nothing in another.
        dice = np.random.default_rng([seed, number])
        painting.cell(region, corner, chalk.get(number, 0.0), dice)
    painted, opaque = painting.finished(np.hypot(PIXEL_BLUR, scene.defocus_px) * _FINE)
    rows, columns = geometry.shape
    grid = np.mgrid[0:rows, 0:columns][::-1].transpose(1, 2, 0) + 0.5
    source = ((geometry.camera.rectified(grid) - corner) * _FINE - 0.5).astype(np.float32)
    colour, opacity = (
        cv2.remap(layer, source[..., 0], source[..., 1], cv2.INTER_LINEAR, borderValue=0)
        for layer in (painted, opaque)
    )
    around = _housing(geometry.shape, rng)
    blended = around + opacity[..., np.newaxis] * (colour - around)
    levels = np.asarray(np.clip(blended, 0.0, 255.0) * LEVEL + 0.5, dtype=np.uint16)
    return np.ascontiguousarray(levels.transpose(2, 0, 1))


def streaks(
    shape: tuple[int, int], rng: np.random.Generator, along: float, across: float
) -> Picture:
    """Noise of standard deviation 1 with given correlation lengths along and across rows, [px]."""
    # Smooth noise is computed on a coarse grid and enlarged.
    steps = max(int(across / _SMOOTH), 1), max(int(along / _SMOOTH), 1)
    small = shape[0] // steps[0] + 2, shape[1] // steps[1] + 2
    raw = rng.standard_normal(small, dtype=np.float32)
    smooth = cv2.GaussianBlur(raw, (0, 0), sigmaX=along / steps[1], sigmaY=across / steps[0])
    size = small[1] * steps[1], small[0] * steps[0]
    large = cv2.resize(smooth / smooth.std(), size, interpolation=cv2.INTER_CUBIC)
    return np.asarray(large[: shape[0], : shape[1]], dtype=np.float32)


class _Painting:
    """Painting of the plate in the rectified picture, at `_FINE` times its scale."""

    def __init__(
        self,
        geometry: SceneGeometry,
        scene: SceneSettings,
        margin: int,
        rng: np.random.Generator,
    ) -> None:
        self._scene, self._lamp = scene, Lamp(scene)
        self._metre = geometry.scale * _FINE
        size = [round(side * geometry.scale + 2 * margin) * _FINE for side in PLATE]
        self._rows, self._columns = np.ogrid[0.5 : size[1], 0.5 : size[0]]
        shape = size[1], size[0]
        brushed = 1.0 + 0.022 * streaks(shape, rng, 60.0, 0.8) + 0.012 * streaks(shape, rng, 2, 2)
        brushed += 0.03 * streaks(shape, rng, 400.0, 250.0)
        if scene.floor_texture > 0.0:
            brushed += self._pattern(shape, rng.spawn(1)[0])
        top = scene.plate_shade * TOP
        self._image: Picture = np.asarray(brushed[..., np.newaxis] * top, dtype=np.float32)
        self._opaque = np.zeros(shape, dtype=np.float32)
        edge = float(margin * _FINE)
        self._edges = edge, edge, size[0] - edge, size[1] - edge
        low = margin * _FINE
        self._opaque[low : size[1] - low, low : size[0] - low] = 1.0
        self._bevel(*self._edges, -_EDGE, self._lamp.edge)
        for across, down in _SCREWS:
            self._screw(edge + across * 1e-3 * self._metre, edge + down * 1e-3 * self._metre)

    def cell(
        self,
        region: Region,
        corner: NDArray[np.float64],
        chalk: float,
        rng: np.random.Generator,
    ) -> None:
        """Paint a cell: a chamfer, a floor, the shadow of its walls."""
        left, top = (
            (place - c) * _FINE for place, c in zip((region.x, region.y), corner, strict=True)
        )
        right, bottom = left + region.width * _FINE, top + region.height * _FINE
        # In a hole, the faces away from the lamp (upper left) are the lit ones.
        if self._scene.rim_width > 0.0:
            rim = self._lamp.rim(self._scene.rim_shade)
            self._bevel(left, top, right, bottom, self._scene.rim_width, rim)
        else:
            self._bevel(left, top, right, bottom, CHAMFER, self._lamp.chamfer)
        rows = slice(round(top), round(bottom))
        columns = slice(round(left), round(right))
        shape = rows.stop - rows.start, columns.stop - columns.start
        milled = 1.0 + 0.012 * streaks(shape, rng, 1.5, 1.5)
        milled += 0.02 * streaks(shape, rng, 90.0, 60.0)
        milled += 0.018 * self._mill_marks(shape, rng)
        if self._scene.floor_texture > 0.0:
            milled += self._pattern(shape, rng.spawn(1)[0])
        light = milled * self._wall_shadow(shape)
        floor = light[..., np.newaxis] * (self._scene.floor_shade * FLOOR)
        if chalk > 0.0:
            floor = dusted_floor(floor, chalk, self._metre, rng)
            self._dust_around(left, top, right, bottom, chalk, rng)
        self._image[rows, columns] = floor

    def finished(self, blur: float) -> tuple[Picture, Picture]:
        """The painting and its opacity, both blurred."""
        # The margin has the colour of the plate, so that blur does not change that of its edge.
        image, opaque = (
            np.asarray(cv2.GaussianBlur(layer, (0, 0), blur), dtype=np.float32)
            for layer in (self._image, self._opaque)
        )
        return image, opaque

    def _bevel(
        self,
        left: float,
        top: float,
        right: float,
        bottom: float,
        width: float,
        light: tuple[float, float, float, float],
    ) -> None:
        """Light on four slanted faces: left, top, right, bottom; inside if `width` is negative."""
        reach = width * self._metre
        image, depths = self._around(left, top, right, bottom, max(reach, 0.0))
        outside, face = depths.max(axis=0), depths.argmax(axis=0)
        band = (outside > min(reach, 0.0)) & (outside <= max(reach, 0.0))
        factor = np.asarray(light, dtype=np.float32)[face[band]]
        image[band] *= factor[:, np.newaxis]

    def _around(
        self, left: float, top: float, right: float, bottom: float, reach: float
    ) -> tuple[Picture, Picture]:
        """The painting around a rectangle, and the distance outside each of its sides."""
        low, high = max(int(left - reach) - 1, 0), max(int(top - reach) - 1, 0)
        columns = slice(low, int(right + reach) + 2)
        rows = slice(high, int(bottom + reach) + 2)
        x, y = self._columns[:, columns], self._rows[rows]
        depths = np.stack(np.broadcast_arrays(left - x, top - y, x - right, y - bottom))
        image = np.asarray(self._image[rows, columns], dtype=np.float32)
        return image, np.asarray(depths, dtype=np.float32)

    def _mill_marks(self, shape: tuple[int, int], rng: np.random.Generator) -> Picture:
        """Arcs of a milling cutter along the cell."""
        y, x = np.ogrid[0.5 : shape[0], 0.5 : shape[1]]
        spacing, radius = 0.0011 * self._metre, 0.006 * self._metre
        bow = np.sqrt(np.maximum(radius**2 - (y - 0.5 * shape[0]) ** 2, 0.0))
        marks = np.cos(2.0 * np.pi * (x - bow) / spacing)
        return np.asarray(marks * (0.6 + 0.4 * streaks(shape, rng, 30, 30)), np.float32)

    def _wall_shadow(self, shape: tuple[int, int]) -> Picture:
        """Light on the floor between the walls: less near the walls at the lamp."""
        y, x = np.ogrid[0.5 : shape[0], 0.5 : shape[1]]
        sides = shape[1] / self._metre, shape[0] / self._metre
        light = self._lamp.floor_light(x / self._metre, y / self._metre, sides)
        return np.asarray(light, dtype=np.float32)

    def _pattern(self, shape: tuple[int, int], rng: np.random.Generator) -> Picture:
        """The additional pattern of the settings."""
        length = self._scene.floor_texture_length * self._metre
        return np.asarray(self._scene.floor_texture * streaks(shape, rng, length, length))

    def _dust_around(
        self,
        left: float,
        top: float,
        right: float,
        bottom: float,
        chalk: float,
        rng: np.random.Generator,
    ) -> None:
        """Chalk on the walls and beside the cell."""
        fall = 0.0006 * self._metre
        image, depths = self._around(left, top, right, bottom, 6.0 * fall)
        opacity = 0.45 * chalk * np.exp(-np.maximum(depths.max(axis=0), 0.0) / fall)
        patches = 0.5 + 0.5 * streaks((opacity.shape[0], opacity.shape[1]), rng, 9.0, 9.0)
        opacity = np.clip(opacity * patches, 0.0, 0.8)[..., np.newaxis]
        image += opacity * (np.array([214.0, 217.0, 219.0], np.float32) - image)

    def _screw(self, x: float, y: float) -> None:
        radius = _SCREW * self._metre
        reach = round(1.5 * radius)
        columns = slice(round(x) - reach, round(x) + reach)
        rows = slice(round(y) - reach, round(y) + reach)
        image = self._image[rows, columns]
        across, down = self._columns[:, columns] - x, self._rows[rows] - y
        distance = np.hypot(across, down) / radius
        slope = (across + down) / radius
        head = distance < 1.0
        image[head] *= (0.92 + 0.10 * slope[head])[:, np.newaxis]
        rim = (distance >= 1.0) & (distance < 1.18)
        image[rim] *= 0.42
        # A hexagonal socket.
        u, v = np.abs(across) / radius, np.abs(down) / radius
        socket = np.maximum(v * 0.866 + u * 0.5, u) < 0.48
        image[socket] *= 0.22


def _housing(shape: tuple[int, int], rng: np.random.Generator) -> Picture:
    """Background of the plate: dark, out of focus, with the three springs."""
    small = shape[0] // 4 + 1, shape[1] // 4 + 1
    uneven = 1.0 + 0.16 * streaks(small, rng, 40.0, 40.0) + 0.03 * streaks(small, rng, 1.0, 1.0)
    image = np.asarray(uneven[..., np.newaxis] * _HOUSING, dtype=np.float32)
    scale = small[0] / 270.0
    middle = 0.5 * small[1]
    for column, row in ((-158.0, 136.0), (152.0, 62.0), (152.0, 208.0)):
        for turn in range(4):
            centre = round(middle + column * scale), round((row - 15 + 10 * turn) * scale)
            axes = max(round(18 * scale), 1), max(round(5 * scale), 1)
            cv2.ellipse(image, centre, axes, 0, 0, 360, (104.0, 103.0, 100.0), 1, cv2.LINE_AA)
    blurred = cv2.GaussianBlur(image, (0, 0), 1.4 * scale)
    return np.asarray(cv2.resize(blurred, shape[::-1], interpolation=cv2.INTER_CUBIC))
