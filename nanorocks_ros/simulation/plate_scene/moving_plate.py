"""The empty plate, displaced on its springs.

Tested by ``test/simulation/plate_scene/test_plate_camera.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.plate_scene.close_up_plate import MARGIN, shifted
from nanorocks_ros.simulation.plate_scene.frame_effects import BLOCK, shift_blocks

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.plate import Region
    from nanorocks_ros.simulation.plate_scene.scene_geometry import SceneGeometry

# Around the plate the shift falls to 0 within this many squares.
_FADE = 2

FURTHEST_PX = BLOCK - 1
"""Limit of the displacement of the plate, [px]."""


class MovingPlate:
    """A canvas with the empty scene, redrawn only where it has changed.

    Parameters
    ----------
    geometry : SceneGeometry
    still : ndarray of uint16, (3, rows, columns)
        The scene with the plate in its place.
    drawn_on : sequence of Region, [px]
        Regions that are drawn on, besides the trays.
    """

    def __init__(
        self,
        geometry: SceneGeometry,
        still: NDArray[np.uint16],
        drawn_on: Sequence[Region] = (),
    ) -> None:
        self._still, self._scale = still, geometry.scale
        self._canvas = still.copy()
        self._moved = False
        x, y, width, height = geometry.bounds(*geometry.plate)
        rows, columns = geometry.shape
        reach = _FADE * BLOCK
        self._left, self._top = max(x - reach, BLOCK), max(y - reach, BLOCK)
        # The last square needs the pixels after it.
        right = min(x + width + reach, columns - BLOCK)
        bottom = min(y + height + reach, rows - BLOCK)
        across = max((right - self._left) // BLOCK, 0)
        down = max((bottom - self._top) // BLOCK, 0)
        self._lens = self._local_shifts(geometry, down, across)
        self._touched = [
            geometry.bounds(r.x - 40, r.y - 40, r.x + r.width + 40, r.y + r.height + 40)
            for r in geometry.regions.values()
        ]
        self._drawn_on = list(drawn_on)

    def displaced(
        self, displacement: tuple[float, float], shift: tuple[float, float] = (0.0, 0.0)
    ) -> NDArray[np.uint16]:
        """The canvas with the plate displaced [m] and the picture shifted [px].

        The caller draws on it.

        Raises
        ------
        SimulationError
            When that is further than it can be drawn.
        """
        moved = np.array(displacement) * self._scale
        if not (np.abs(moved) < FURTHEST_PX).all():
            raise SimulationError(
                'plate',
                f'displaced by {np.abs(moved).max():.3g} px',
                f'give less than {FURTHEST_PX} px: a weaker swing, or fewer pixels_per_metre',
            )
        self._renew(self._drawn_on)
        if moved.any():
            shift_blocks(self._canvas, self._still, self._lens @ moved, self._left, self._top)
            self._moved = True
        elif self._moved:
            self._canvas[:] = self._still
            self._moved = False
        else:
            self._renew(self._touched)
        if shift == (0.0, 0.0):
            return self._canvas
        edges = ((0, 0), (MARGIN, MARGIN), (MARGIN, MARGIN))
        picture = np.empty_like(self._canvas)
        shifted(picture, np.pad(self._canvas, edges, mode='edge'), *shift)
        return picture

    def _renew(self, regions: list[Region]) -> None:
        for x, y, width, height in regions:
            part = np.s_[:, y : y + height, x : x + width]
            self._canvas[part] = self._still[part]

    def _local_shifts(
        self, geometry: SceneGeometry, down: int, across: int
    ) -> NDArray[np.float64]:
        """Shift of each square for a shift of one pixel of the rectified picture."""
        middle = BLOCK * (np.mgrid[0:down, 0:across][::-1].transpose(1, 2, 0) + 0.5)
        points = geometry.camera.rectified(middle + np.array([self._left, self._top]))
        lens = geometry.local_scales(points.reshape(-1, 2)).reshape(down, across, 2, 2)
        left, top, right, bottom = geometry.plate
        x, y = points[..., 0], points[..., 1]
        outside = np.stack([left - x, top - y, x - right, y - bottom]).max(axis=0)
        share = np.clip(1.0 - (outside - 0.75 * BLOCK) / (_FADE * BLOCK), 0.0, 1.0)
        return np.asarray(lens * share[..., np.newaxis, np.newaxis])
