"""The camera over the plate: from bead positions to the picture of the scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.counter_rng import Purpose, hashed, key_for
from nanorocks_ros.simulation.plate_scene.drawing.painter import BeadPainter
from nanorocks_ros.simulation.plate_scene.empty_plate import empty_scene
from nanorocks_ros.simulation.plate_scene.frame_effects import add_light, expose, noise_strip
from nanorocks_ros.simulation.plate_scene.glare import led_glare
from nanorocks_ros.simulation.plate_scene.illumination import Illumination
from nanorocks_ros.simulation.plate_scene.moving_plate import MovingPlate
from nanorocks_ros.simulation.plate_scene.plate_oscillation import AT_REST
from nanorocks_ros.simulation.plate_scene.scene_geometry import SceneGeometry
from nanorocks_ros.simulation.plate_scene.simd_rectangles import LEVEL

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SceneSettings, SimulationSettings
    from nanorocks_ros.simulation.plate_scene.plate_oscillation import PlateMotion


class SceneCamera:
    """Draws the plate with the beads of some of its trays.

    Parameters
    ----------
    simulation : SimulationSettings
        Size of the picture, frame rate, seed.
    scene : SceneSettings
        Scale and effects.
    trays : mapping of int to Tray
        All cells of the plate.
    radii : mapping of int to ndarray (n,), [m]
        Of the beads, for each tray that has any.

    Raises
    ------
    ConfigurationError
        For an invalid lens, or a plate that does not fit into the picture.
    SimulationError
        For radii that do not match the beads of the trays.
    """

    def __init__(
        self,
        simulation: SimulationSettings,
        scene: SceneSettings,
        trays: Mapping[int, Tray],
        radii: Mapping[int, NDArray[np.float64]],
    ) -> None:
        self.geometry = SceneGeometry(simulation, scene, trays)
        seed = int(key_for(simulation.seed, 0, Purpose.TEXTURE))
        self._noise_key = key_for(simulation.seed, 0, Purpose.NOISE)
        chalk = {number: scene.chalk for number, tray in trays.items() if tray.chalk}
        still = empty_scene(self.geometry, defocus=scene.defocus_px, chalk=chalk, seed=seed)
        self._glare = led_glare(self.geometry, scene.glare) if scene.glare > 0.0 else None
        glaring = [] if self._glare is None else [self._glare.region]
        self._plate = MovingPlate(self.geometry, still, glaring)
        self._light = Illumination(scene, self.geometry.shape)
        self._strip = noise_strip(simulation.width_px, scene.noise, self._noise_key)
        self._painter = BeadPainter(self.geometry, scene, trays, radii, seed)

    @property
    def glare(self) -> NDArray[np.float64] | None:
        """Gray levels that the LEDs add to green, (rows, columns), before the light; or None."""
        if self._glare is None:
            return None
        levels = np.zeros(self.geometry.shape)
        x, y, width, height = self._glare.region
        levels[y : y + height, x : x + width] = self._glare.light[1] / LEVEL
        return levels

    def picture(
        self,
        positions: Mapping[int, NDArray[np.float64]],
        number: int,
        *,
        time: float = 0.0,
        motion: PlateMotion = AT_REST,
        turned: float = 0.0,
    ) -> NDArray[np.uint8]:
        """Draw the scene.

        Parameters
        ----------
        positions : mapping of int to ndarray (n, 3), [m]
            Of the beads of each tray, from the corner of its floor when the plate is at rest.
        number : int, >= 0
            Of the frame: its noise depends on nothing else.
        time : float, [s]
            For the bands of light.
        motion : PlateMotion
        turned : float, [rad]
            By how much a bead that turned with 1 rad/s after shaking has turned.

        Returns
        -------
        ndarray of uint8, (height, width, 3), bgr

        Raises
        ------
        SimulationError
            For positions of another shape, or not finite.
        """
        canvas = self._plate.displaced(motion.displacement)
        self._painter.paint(canvas, positions, motion.displacement, turned)
        if self._glare is not None:
            x, y, _, _ = self._glare.region
            add_light(canvas, self._glare.light, x, y)
        rows, columns = self.geometry.shape
        picture = np.empty((rows, columns, 3), dtype=np.uint8)
        expose(
            canvas,
            self._light.column_factors,
            self._light.row_factors(time),
            self._strip,
            np.uint64(hashed(self._noise_key, number)),
            picture.reshape(rows, 3 * columns),
        )
        return picture
