"""Painter of the beads of all trays and their shadows, through the lens.

Tested by ``test/simulation/plate_scene/test_plate_camera.py``.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.numerics.stable_sort import stable_argsort
from nanorocks_ros.simulation.plate_scene.drawing.bead_appearance import (
    Appearance,
    appearance_of,
    grain_shapes,
    outline_moments,
)
from nanorocks_ros.simulation.plate_scene.drawing.chalk import dust_pattern
from nanorocks_ros.simulation.plate_scene.drawing.grains import LOBES
from nanorocks_ros.simulation.plate_scene.drawing.lamp import Lamp
from nanorocks_ros.simulation.plate_scene.drawing.scene_bodies import GRAIN, draw_bodies
from nanorocks_ros.simulation.plate_scene.drawing.shadows import draw_shadows
from nanorocks_ros.simulation.plate_scene.optics.perspective import seen_spheres
from nanorocks_ros.simulation.plate_scene.simd_rectangles import PLACE, float32

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SceneSettings
    from nanorocks_ros.simulation.plate_scene.scene_geometry import SceneGeometry

# Outline of a sharp bead [px] and its standard deviation; that of a step this wide.
_SHARP, _STEP_DEVIATION = 1.6, 0.2236

# Blur of the outline of a shadow, in heights and in radii at most.
_SHADOW_BLUR, _WIDEST_BLUR = 0.5, 0.9


class BeadPainter:
    """Draws the beads of some trays.

    Parameters
    ----------
    geometry : SceneGeometry
    scene : SceneSettings
    trays : mapping of int to Tray
    radii : mapping of int to ndarray (n,), [m]
        Of the beads, for each tray that is drawn.
    seed : int
        Of the appearance of the beads.

    Raises
    ------
    SimulationError
        For radii that do not match the beads of a tray.
    """

    def __init__(
        self,
        geometry: SceneGeometry,
        scene: SceneSettings,
        trays: Mapping[int, Tray],
        radii: Mapping[int, NDArray[np.float64]],
        seed: int,
    ) -> None:
        for number, radius in radii.items():
            _check_radii(trays[number], radius)
        self._geometry, self._shadows, self._lamp = geometry, scene.shadows, Lamp(scene)
        rng = np.random.default_rng(seed)
        self._dust = dust_pattern(rng)
        shapes = grain_shapes(scene.irregularity, rng)
        self._shapes = shapes.astype(np.float32)
        self._counts = {number: len(radius) for number, radius in radii.items()}
        looks = [
            appearance_of(trays[number], scene, np.random.default_rng([seed, number]))
            for number in radii
        ]
        self._look = Appearance.joined(looks)
        self._looks = self._look.looks.astype(np.float32)
        count = sum(self._counts.values())
        size, centroid, furthest = outline_moments(shapes[:, :LOBES])
        shape_index = np.arange(count) % len(self._shapes)
        grain = self._look.kinds == GRAIN
        # An outline has the area of the grain, and its centroid at the position of the grain.
        spheres = np.concatenate([*radii.values(), np.empty(0)]) * geometry.scale
        self._radii_px = spheres / np.where(grain, size[shape_index], 1.0)
        self._offsets = np.where(grain[:, np.newaxis], -centroid[shape_index], 0.0)
        self._reach = np.where(grain, furthest[shape_index], 1.0)
        # The whole picture of a close-up is blurred, beads included, after it has been drawn.
        blur = 0.0 if scene.close_up else scene.defocus_px
        self._width = float(np.hypot(_SHARP * _STEP_DEVIATION, blur) / _STEP_DEVIATION)
        counts = list(self._counts.values())
        corners = [geometry.corner(number) for number in radii]
        floors = [_floor(geometry, number) for number in radii]
        self._corners, self._floors = (
            np.repeat(np.array(points, dtype=np.float64).reshape(-1, size), counts, axis=0)
            for points, size in ((corners, 2), (floors, 4))
        )

    def paint(
        self,
        canvas: NDArray[np.uint16],
        positions: Mapping[int, NDArray[np.float64]],
        displacement: tuple[float, float],
        turned: float,
        shift: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Draw shadows and beads on a canvas; see `SceneCamera.picture`.

        `shift` is where the camera has moved the whole picture, [px].
        """
        places = self._checked(positions)
        if not len(places):
            return
        points = places[:, :2] * self._geometry.scale + self._corners
        height = places[:, 2] * self._geometry.scale
        lens = self._geometry.local_scales(points)
        if self._shadows > 0.0:
            self._paint_shadows(canvas, (points, height), lens, displacement, shift)
        if self._geometry.height > 0.0:
            points, stretch = seen_spheres(
                points, height, self._radii_px, self._geometry.axis, self._geometry.height
            )
            lens = self._geometry.local_scales(points) @ stretch
        pixels = self._geometry.distorted(points) + np.array(shift)
        look = self._look
        draw_bodies(
            canvas,
            self._order(places[:, 2]),
            self._rows(pixels, lens, turned).astype(np.float32),
            self._looks,
            look.kinds,
            self._shapes,
            self._dust,
            float32(self._width),
            self._lamp.row,
        )

    def _checked(self, positions: Mapping[int, NDArray[np.float64]]) -> NDArray[np.float64]:
        if set(positions) != set(self._counts):
            raise SimulationError(
                'positions',
                f'of trays {sorted(positions)}',
                f'give those of {sorted(self._counts)}',
            )
        for number, count in self._counts.items():
            points = np.asarray(positions[number])
            if points.shape != (count, 3) or not np.isfinite(points).all():
                raise SimulationError(
                    f'positions of tray {number}',
                    f'shape {points.shape}, expected {(count, 3)}',
                    'give finite positions',
                )
        return np.concatenate([np.empty((0, 3)), *(positions[k] for k in self._counts)])

    def _order(self, heights: NDArray[np.float64]) -> NDArray[np.int64]:
        """Drawing order: the lowest first, tray by tray, which keeps the canvas in the cache."""
        ends = np.cumsum([0, *self._counts.values()])
        return np.concatenate(
            [
                first + stable_argsort(heights[first:last])
                for first, last in itertools.pairwise(ends)
            ]
        )

    def _rows(
        self, pixels: NDArray[np.float64], lens: NDArray[np.float64], turned: float
    ) -> NDArray[np.float64]:
        """One row for each bead, as `draw_bodies` reads it."""
        look, radii = self._look, self._radii_px
        angles = look.angles + look.rates * turned
        cosine, sine = np.cos(angles), np.sin(angles)
        longer, shorter = look.stretch, 1.0 / look.stretch
        # An oval, then seen through the lens: a matrix from the unit disc to pixels.
        a = radii * (longer * cosine**2 + shorter * sine**2)
        d = radii * (longer * sine**2 + shorter * cosine**2)
        b = radii * (longer - shorter) * cosine * sine
        xx, xy = lens[:, 0, 0] * a + lens[:, 0, 1] * b, lens[:, 0, 0] * b + lens[:, 0, 1] * d
        yx, yy = lens[:, 1, 0] * a + lens[:, 1, 1] * b, lens[:, 1, 0] * b + lens[:, 1, 1] * d
        area = xx * yy - xy * yx
        across = cosine * self._offsets[:, 0] - sine * self._offsets[:, 1]
        down = sine * self._offsets[:, 0] + cosine * self._offsets[:, 1]
        rows = np.empty((len(radii), PLACE))
        rows[:, 0] = pixels[:, 0] + xx * across + xy * down
        rows[:, 1] = pixels[:, 1] + yx * across + yy * down
        rows[:, 2] = np.hypot(xx, xy) * self._reach
        rows[:, 3] = np.hypot(yx, yy) * self._reach
        rows[:, 4] = np.sqrt(area)
        rows[:, 5:9] = (np.stack([yy, -xy, -yx, xx]) / area).T
        rows[:, 9], rows[:, 10], rows[:, 11] = cosine, sine, look.dust
        return rows

    def _paint_shadows(
        self,
        canvas: NDArray[np.uint16],
        centres: tuple[NDArray[np.float64], NDArray[np.float64]],
        lens: NDArray[np.float64],
        displacement: tuple[float, float],
        shift: tuple[float, float],
    ) -> None:
        geometry, (points, height) = self._geometry, centres
        local = np.sqrt(lens[:, 0, 0] * lens[:, 1, 1] - lens[:, 0, 1] * lens[:, 1, 0])
        spots = np.empty((len(points), 10))
        fallen = points + height[:, np.newaxis] * self._lamp.cast
        spots[:, :2] = geometry.distorted(fallen) + np.array(shift)
        spots[:, 2:5] = (self._radii_px * local)[:, np.newaxis]
        blur = self._width + _SHADOW_BLUR * height * local
        spots[:, 5] = np.minimum(blur, _WIDEST_BLUR * spots[:, 4])
        across, down = np.array(displacement) * geometry.scale + np.array(shift)
        spots[:, 6:] = self._floors + np.array([across, across, down, down])
        draw_shadows(canvas, spots.astype(np.float32), float32(self._shadows))


def _floor(geometry: SceneGeometry, tray: int) -> tuple[int, int, int, int]:
    """Bounds of the floor of a tray in the picture: columns, then rows."""
    region = geometry.regions[tray]
    x, y, width, height = geometry.bounds(
        region.x, region.y, region.x + region.width, region.y + region.height
    )
    return x, x + width, y, y + height


def _check_radii(tray: Tray, radii: NDArray[np.float64]) -> None:
    if radii.shape != (tray.count,) or not (np.isfinite(radii) & (radii > 0.0)).all():
        raise SimulationError(
            f'radii of tray {tray.number}',
            f'shape {radii.shape}',
            f'give {tray.count} positive ones',
        )
