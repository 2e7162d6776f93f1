"""Geometry of the scene: plate, trays and beads in the picture.

Tested by ``test/nodes/sources/test_simulated_scene.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.lens import Camera
from nanorocks_ros.experiment.plate import PLATE, Region, regions_on_plate

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SceneSettings, SimulationSettings

# Focal length at which the distortion stays below a thousandth of a pixel, [px].
_STRAIGHT = 1e6
_STEP_PX = 0.5


def scene_camera(simulation: SimulationSettings, scene: SceneSettings) -> Camera:
    """The camera of the scene.

    Raises
    ------
    ConfigurationError
        For a list of the wrong length, or an invalid lens.
    """
    if len(scene.lens_distortion) != 4 or len(scene.lens_offset_px) != 2:
        raise ConfigurationError(
            'scene',
            f'lens_distortion {scene.lens_distortion}, lens_offset_px {scene.lens_offset_px}',
            'give four numbers and two',
        )
    middle = 0.5 * simulation.width_px, 0.5 * simulation.height_px
    if scene.fisheye == 0.0:
        return _camera(simulation, _STRAIGHT, middle, (0.0, 0.0, 0.0, 0.0))
    k1, k2, k3, k4 = scene.lens_distortion
    column, row = scene.lens_offset_px
    focal = middle[0] / math.tan(scene.fisheye)
    return _camera(simulation, focal, (middle[0] + column, middle[1] + row), (k1, k2, k3, k4))


def _camera(
    simulation: SimulationSettings,
    focal: float,
    centre: tuple[float, float],
    distortion: tuple[float, float, float, float],
) -> Camera:
    return Camera(
        width=simulation.width_px,
        height=simulation.height_px,
        focal=(focal, focal),
        centre=centre,
        distortion=distortion,
    )


class SceneGeometry:
    """Positions on the plate and in the trays, in pixels of the distorted picture.

    Parameters
    ----------
    simulation : SimulationSettings
        Size of the picture.
    scene : SceneSettings
        Scale and lens.
    trays : mapping of int to Tray
        All cells of the plate, with beads or without.

    Raises
    ------
    ConfigurationError
        For an invalid lens, or a tray outside the picture.
    """

    def __init__(
        self, simulation: SimulationSettings, scene: SceneSettings, trays: Mapping[int, Tray]
    ) -> None:
        self.camera = scene_camera(simulation, scene)
        self.scale = float(scene.pixels_per_metre)
        self.shape = simulation.height_px, simulation.width_px
        self.height = float(scene.camera_height) * self.scale
        """Of the camera over the floor, [px]; 0: infinitely far away."""
        self._dimensions = {number: tray.dimensions for number, tray in trays.items()}
        _check_height(scene, self._dimensions.values())
        self.straight = scene.fisheye == 0.0 and scene.close_up
        if scene.close_up:
            self.regions, self._corners = _close_up(scene, trays, self.shape)
            return
        self.regions = regions_on_plate(trays.values(), self.shape, self.scale)
        self._corners = {
            number: np.array([region.x, region.y], dtype=np.float64)
            for number, region in self.regions.items()
        }

    def corner(self, tray: int) -> NDArray[np.float64]:
        """Upper left corner of the floor of a tray in the rectified picture, (2,), [px]."""
        return self._corners[tray]

    def sides(self, tray: int) -> tuple[float, float]:
        """Length and width of the floor of a tray in the rectified picture, [px]."""
        length, width, _ = self._dimensions[tray]
        return length * self.scale, width * self.scale

    def rim_magnification(self, tray: int) -> float:
        """How much larger things look at the top of the walls of a tray than on its floor."""
        depth = self._dimensions[tray][2] * self.scale
        return self.height / (self.height - depth) if self.height > 0.0 else 1.0

    @property
    def axis(self) -> NDArray[np.float64]:
        """Where the optical axis meets the rectified picture, (2,), [px]."""
        return np.array([0.5 * self.shape[1], 0.5 * self.shape[0]])

    @property
    def plate(self) -> tuple[float, float, float, float]:
        """Left, top, right and bottom of the plate in the rectified picture, [px]."""
        across, down = (0.5 * self.scale * side for side in PLATE)
        column, row = 0.5 * self.shape[1], 0.5 * self.shape[0]
        return column - across, row - down, column + across, row + down

    def rectified(self, tray: int, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions of points of a tray in the rectified picture, with the plate at rest.

        Parameters
        ----------
        tray : int
        places : ndarray (n, 2 or 3), [m]
            From the corner of the floor.

        Returns
        -------
        ndarray (n, 2), [px]
        """
        return np.asarray(places)[:, :2] * self.scale + self._corners[tray]

    def distorted(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points of the rectified picture in the picture, (n, 2), [px]."""
        return points if self.straight else self.camera.distorted(points)

    def local_scales(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Jacobian of the distortion at points of the rectified picture.

        Parameters
        ----------
        points : ndarray (n, 2), [px]

        Returns
        -------
        ndarray (n, 2, 2)
            Change of (column, row) in the picture, for a step along columns and along rows.
        """
        if self.straight:
            return np.broadcast_to(np.eye(2), (len(points), 2, 2))
        scales = np.empty((len(points), 2, 2))
        for axis in range(2):
            step = np.zeros(2)
            step[axis] = _STEP_PX
            ahead = self.camera.distorted(points + step)
            behind = self.camera.distorted(points - step)
            scales[:, :, axis] = (ahead - behind) / (2.0 * _STEP_PX)
        return scales

    def bounds(self, left: float, top: float, right: float, bottom: float) -> Region:
        """Bounding region in the picture of a rectangle of the rectified picture, [px]."""
        sides = np.linspace(0.0, 1.0, 33)
        columns, rows = left + (right - left) * sides, top + (bottom - top) * sides
        edges = [np.column_stack([columns, np.full(33, row)]) for row in (top, bottom)]
        edges += [np.column_stack([np.full(33, column), rows]) for column in (left, right)]
        outline = self.camera.distorted(np.concatenate(edges))
        low = np.maximum(np.floor(outline.min(axis=0)), 0.0).astype(int)
        high = np.minimum(np.ceil(outline.max(axis=0)), self.shape[::-1]).astype(int)
        width, height = np.maximum(high - low, 0)
        return Region(int(low[0]), int(low[1]), int(width), int(height))


def _check_height(scene: SceneSettings, dimensions: Iterable[tuple[float, float, float]]) -> None:
    height = scene.camera_height
    if height > 0.0 and not scene.close_up:
        raise ConfigurationError(
            'camera_height',
            f'{height:g} m, but the whole plate is drawn without perspective',
            'set scene.camera_height to 0, or scene.close_up with one tray',
        )
    if 0.0 < height <= 2.0 * max(sides[2] for sides in dimensions):
        raise ConfigurationError(
            'camera_height', f'{height:g} m is within or close to the tray', 'give 0.05 m or more'
        )


def _close_up(
    scene: SceneSettings, trays: Mapping[int, Tray], shape: tuple[int, int]
) -> tuple[dict[int, Region], dict[int, NDArray[np.float64]]]:
    """Region and exact corner of the only tray, whose middle is that of the picture."""
    if len(scene.trays) != 1:
        raise ConfigurationError(
            'close_up', f'of the trays {scene.trays}', 'name one tray in scene.trays'
        )
    if scene.fisheye != 0.0:
        raise ConfigurationError(
            'close_up', f'through a fisheye lens of {scene.fisheye:g} rad', 'set fisheye to 0'
        )
    number = scene.trays[0]
    sides = np.array(trays[number].dimensions[:2]) * scene.pixels_per_metre
    corner = 0.5 * (np.array(shape[::-1]) - sides)
    if (corner < 1.0).any():
        raise ConfigurationError(
            f'tray {number}',
            f'{sides[0]:.0f} x {sides[1]:.0f} px in a picture of {shape[1]} x {shape[0]} px',
            'lower scene.pixels_per_metre or enlarge the picture',
        )
    low, high = np.rint(corner).astype(int), np.rint(corner + sides).astype(int)
    region = Region(int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1]))
    return {number: region}, {number: corner}
