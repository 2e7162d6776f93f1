"""The camera over the plate: from the places of all beads to the picture of the scene."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.ordering import rising
from nanorocks_ros.simulation.randomness import Purpose, hashed, key_for
from nanorocks_ros.simulation.scene.appearance import (
    appearance_of,
    grain_shapes,
    outline_moments,
)
from nanorocks_ros.simulation.scene.bodies import GRAIN, LOBES, draw_bodies, draw_shadows
from nanorocks_ros.simulation.scene.chalk import dust_pattern
from nanorocks_ros.simulation.scene.geometry import SceneGeometry
from nanorocks_ros.simulation.scene.glare import led_glare
from nanorocks_ros.simulation.scene.light import Illumination
from nanorocks_ros.simulation.scene.moving_plate import MovingPlate
from nanorocks_ros.simulation.scene.passes import add_light, expose, noise_strip
from nanorocks_ros.simulation.scene.plate import empty_scene
from nanorocks_ros.simulation.scene.swing import AT_REST

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.settings import SceneSettings, SimulationSettings
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.simulation.scene.swing import PlateMotion

# Outline of a sharp bead [px] and its standard deviation; that of a step this wide.
_SHARP, _STEP_DEVIATION = 1.6, 0.2236

# Towards the side away from the lamp, in heights: where the shadow of a bead falls.
_CAST = np.array([0.45, 0.60])
_SHADOW_BLUR = 0.5


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
        For a lens that cannot be, or a plate that does not fit into the picture.
    SimulationError
        For beads that the trays do not hold.
    """

    def __init__(
        self,
        simulation: SimulationSettings,
        scene: SceneSettings,
        trays: Mapping[int, Tray],
        radii: Mapping[int, NDArray[np.float64]],
    ) -> None:
        self.geometry = SceneGeometry(simulation, scene, trays)
        self._scene = scene
        seed = int(key_for(simulation.seed, 0, Purpose.TEXTURE))
        self._noise_key = key_for(simulation.seed, 0, Purpose.NOISE)
        chalk = {number: scene.chalk for number, tray in trays.items() if tray.chalk}
        still = empty_scene(self.geometry, defocus=scene.defocus_px, chalk=chalk, seed=seed)
        self._plate = MovingPlate(self.geometry, still)
        self._glare = led_glare(self.geometry, scene.glare) if scene.glare > 0.0 else None
        self._light = Illumination(scene, self.geometry.shape)
        self._strip = noise_strip(simulation.width_px, scene.noise, self._noise_key)
        rng = np.random.default_rng(seed + 1)
        dust, shapes = dust_pattern(rng), grain_shapes(scene.irregularity, rng)
        self._width = _outline_width(scene.defocus_px)
        self._trays = {
            number: _TrayPainter(self.geometry, scene, trays[number], one, (dust, shapes), seed)
            for number, one in radii.items()
        }

    @property
    def glare(self) -> NDArray[np.float64] | None:
        """Levels that the LEDs add to the picture, (rows, columns), or None."""
        if self._glare is None:
            return None
        levels = np.zeros(self.geometry.shape)
        x, y, width, height = self._glare.region
        levels[y : y + height, x : x + width] = self._glare.light.mean(axis=2) / 64.0
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
        if set(positions) != set(self._trays):
            raise SimulationError(
                'positions',
                f'of trays {sorted(positions)}',
                f'give those of {sorted(self._trays)}',
            )
        canvas = self._plate.moved_to(motion.displacement)
        for tray, painter in self._trays.items():
            painter.paint(canvas, positions[tray], motion, turned, self._width)
        if self._glare is not None:
            x, y, width, height = self._glare.region
            add_light(canvas[y : y + height, x : x + width], self._glare.light)
        rows, columns = self.geometry.shape
        picture = np.empty((rows, columns, 3), dtype=np.uint8)
        expose(
            canvas.reshape(rows, 3 * columns),
            self._light.across,
            self._light.down(time),
            self._strip,
            np.uint64(hashed(self._noise_key, number)),
            picture.reshape(rows, 3 * columns),
        )
        return picture


def _outline_width(defocus: float) -> float:
    sharp = _SHARP * _STEP_DEVIATION
    return float(np.hypot(sharp, defocus) / _STEP_DEVIATION)


class _TrayPainter:
    """Draws the beads of one tray."""

    def __init__(
        self,
        geometry: SceneGeometry,
        scene: SceneSettings,
        tray: Tray,
        radii: NDArray[np.float64],
        patterns: tuple[NDArray[np.float32], NDArray[np.float64]],
        seed: int,
    ) -> None:
        if radii.shape != (tray.count,) or not (np.isfinite(radii) & (radii > 0.0)).all():
            raise SimulationError(
                f'radii of tray {tray.number}',
                f'shape {radii.shape}',
                f'give {tray.count} positive ones',
            )
        self._geometry, self._tray, self._shadows = geometry, tray, scene.shadows
        self._dust, self._shapes = patterns
        rng = np.random.default_rng([seed, tray.number])
        self._look = appearance_of(tray, scene, rng)
        size, centroid = outline_moments(self._shapes[:, :LOBES])
        which = np.arange(tray.count) % len(self._shapes)
        is_grain = self._look.kinds == GRAIN
        # An outline has the area of the grain, and its centroid where the grain is.
        self._radii_px = radii * geometry.scale / np.where(is_grain, size[which], 1.0)
        self._offsets = np.where(is_grain[:, np.newaxis], -centroid[which], 0.0)
        self._reach = np.where(is_grain, 1.0 + 4.0 * scene.irregularity, 1.0)

    def paint(
        self,
        canvas: NDArray[np.uint16],
        positions: NDArray[np.float64],
        motion: PlateMotion,
        turned: float,
        width: float,
    ) -> None:
        """Draw shadows and beads; see `SceneCamera.picture`."""
        places = np.ascontiguousarray(positions, dtype=np.float64)
        if places.shape != (self._tray.count, 3) or not np.isfinite(places).all():
            raise SimulationError(
                f'positions of tray {self._tray.number}',
                f'shape {places.shape}, expected {(self._tray.count, 3)}',
                'give finite positions',
            )
        geometry, look = self._geometry, self._look
        points = geometry.rectified(self._tray.number, places)
        seen = geometry.camera.distorted(points)
        lens = geometry.local_scales(points)
        if self._shadows > 0.0:
            self._paint_shadows(canvas, (places, points), lens, motion, width)
        rows = self._rows(seen, lens, turned)
        order = rising(places[:, 2])
        draw_bodies(canvas, order, rows, look.looks, look.kinds, self._shapes, self._dust, width)

    def _rows(
        self, seen: NDArray[np.float64], lens: NDArray[np.float64], turned: float
    ) -> NDArray[np.float64]:
        """One row for each bead, as `bodies.draw_body` reads it."""
        look, radii = self._look, self._radii_px
        angles = look.angles + look.rates * turned
        cosine, sine = np.cos(angles), np.sin(angles)
        stretch = np.empty((len(radii), 2, 2))
        longer, shorter = look.stretch, 1.0 / look.stretch
        stretch[:, 0, 0] = longer * cosine**2 + shorter * sine**2
        stretch[:, 1, 1] = longer * sine**2 + shorter * cosine**2
        stretch[:, 0, 1] = stretch[:, 1, 0] = (longer - shorter) * cosine * sine
        turn = np.stack([cosine, -sine, sine, cosine], axis=1).reshape(-1, 2, 2)
        offset = (turn @ self._offsets[..., np.newaxis])[..., 0] * radii[:, np.newaxis]
        shape = lens @ stretch * radii[:, np.newaxis, np.newaxis]
        rows = np.empty((len(radii), 12))
        rows[:, :2] = seen + (lens @ offset[..., np.newaxis])[..., 0]
        half = np.sqrt(np.sum(shape**2, axis=2)) * self._reach[:, np.newaxis]
        rows[:, 2:4] = half
        rows[:, 4] = np.sqrt(np.linalg.det(shape))
        rows[:, 5:9] = np.linalg.inv(shape).reshape(-1, 4)
        rows[:, 9], rows[:, 10], rows[:, 11] = cosine, sine, look.dust
        return rows

    def _paint_shadows(
        self,
        canvas: NDArray[np.uint16],
        places: tuple[NDArray[np.float64], NDArray[np.float64]],
        lens: NDArray[np.float64],
        motion: PlateMotion,
        width: float,
    ) -> None:
        metres, points = places
        geometry, region = self._geometry, self._geometry.regions[self._tray.number]
        height = metres[:, 2] * geometry.scale
        local = np.sqrt(np.linalg.det(lens))
        spots = np.empty((len(points), 4))
        spots[:, :2] = geometry.camera.distorted(points + height[:, np.newaxis] * _CAST)
        spots[:, 2] = self._radii_px * local
        spots[:, 3] = np.minimum(width + _SHADOW_BLUR * height * local, 2.0 * spots[:, 2])
        across, down = (math.floor(d * geometry.scale + 0.5) for d in motion.displacement)
        left, top = region.x + across, region.y + down
        x, y, w, h = geometry.bounds(left, top, left + region.width, top + region.height)
        draw_shadows(canvas, spots, np.array([x, x + w, y, y + h]), self._shadows)
