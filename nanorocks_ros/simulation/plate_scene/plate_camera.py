"""The camera over the plate: from bead positions to the picture of the scene."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from nanorocks_ros.numerics.counter_rng import Purpose, hashed, key_for
from nanorocks_ros.simulation.plate_scene.close_up_plate import CloseUpPlate
from nanorocks_ros.simulation.plate_scene.drawing.painter import BeadPainter
from nanorocks_ros.simulation.plate_scene.empty_plate import empty_scene
from nanorocks_ros.simulation.plate_scene.frame_effects import add_light, expose, noise_strip
from nanorocks_ros.simulation.plate_scene.glare import Glare, led_glare
from nanorocks_ros.simulation.plate_scene.illumination import Illumination
from nanorocks_ros.simulation.plate_scene.moving_plate import MovingPlate
from nanorocks_ros.simulation.plate_scene.optics.raw_sensor import through_filters
from nanorocks_ros.simulation.plate_scene.plate_oscillation import AT_REST
from nanorocks_ros.simulation.plate_scene.scene_geometry import SceneGeometry
from nanorocks_ros.simulation.plate_scene.simd_rectangles import LEVEL

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SceneSettings, SimulationSettings
    from nanorocks_ros.simulation.plate_scene.plate_oscillation import PlateMotion


class Instant(NamedTuple):
    """The scene at one instant.

    Parameters
    ----------
    positions : mapping of int to ndarray (n, 3), [m]
        Of the beads of each tray, from the corner of its floor when the plate is at rest.
    plate : tuple of 2 floats, [m]
        Displacement of the plate.
    shift : tuple of 2 floats, [px]
        Of the beads in the picture, by the camera.
    plate_shift : tuple of 2 floats, [px]
        The same of everything else. Instants with equal values need not draw it again.
    """

    positions: Mapping[int, NDArray[np.float64]]
    plate: tuple[float, float]
    shift: tuple[float, float] = (0.0, 0.0)
    plate_shift: tuple[float, float] = (0.0, 0.0)


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
        self._scene = scene
        self._glare: Glare | None = None
        self._plate: MovingPlate | CloseUpPlate
        if scene.close_up:
            dust = chalk.get(scene.trays[0], 0.0)
            self._plate = CloseUpPlate(self.geometry, scene, chalk=dust, seed=seed)
        else:
            still = empty_scene(self.geometry, scene, chalk=chalk, seed=seed)
            if scene.glare > 0.0:
                self._glare = led_glare(self.geometry, scene.glare)
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
        instant = Instant(positions, motion.displacement)
        return self.exposed([instant], number, time=time, turned=turned)

    def exposed(
        self, instants: Sequence[Instant], number: int, *, time: float = 0.0, turned: float = 0.0
    ) -> NDArray[np.uint8]:
        """Draw the mean of the scene at some instants while the shutter is open.

        Parameters
        ----------
        instants : sequence of Instant
        number, time, turned
            See `picture`.

        Returns
        -------
        ndarray of uint8, (height, width, 3), bgr

        Raises
        ------
        SimulationError
            For positions of another shape, or not finite.
        """
        canvas = self._mean_canvas(instants, turned)
        if self._glare is not None:
            _add_glare(canvas, self._glare, instants[len(instants) // 2].plate_shift)
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
        return through_filters(picture, self._scene.bayer)

    def _mean_canvas(self, instants: Sequence[Instant], turned: float) -> NDArray[np.uint16]:
        """Mean of the canvases of some instants, in close-ups blurred by the lens."""
        blur = self._scene.defocus_px if self._scene.close_up else 0.0
        if len(instants) == 1 and blur == 0.0:
            return self._canvas(instants[0], turned)
        rows, columns = self.geometry.shape
        total = np.zeros((3 * rows, columns), dtype=np.float32)
        for instant in instants:
            cv2.accumulate(self._canvas(instant, turned).reshape(3 * rows, columns), total)
        total *= np.float32(1.0 / len(instants))
        mean = total.reshape(3, rows, columns)
        if blur > 0.0:
            for channel in mean:
                cv2.GaussianBlur(channel, (0, 0), blur, dst=channel)
        return np.asarray(np.rint(mean), dtype=np.uint16)

    def _canvas(self, instant: Instant, turned: float) -> NDArray[np.uint16]:
        canvas = self._plate.displaced(instant.plate, instant.plate_shift)
        self._painter.paint(canvas, instant.positions, instant.plate, turned, instant.shift)
        return canvas


def _add_glare(canvas: NDArray[np.uint16], glare: Glare, shift: tuple[float, float]) -> None:
    """Add the light of the LEDs, which moves with the picture by whole pixels."""
    rows, columns = canvas.shape[1:]
    left, top = glare.region.x + round(shift[0]), glare.region.y + round(shift[1])
    right, bottom = left + glare.region.width, top + glare.region.height
    first, last = (max(-top, 0), max(-left, 0)), (max(bottom - rows, 0), max(right - columns, 0))
    height, width = glare.light.shape[1:]
    seen = glare.light[:, first[0] : height - last[0], first[1] : width - last[1]]
    add_light(canvas, np.ascontiguousarray(seen), left + first[1], top + first[0])
