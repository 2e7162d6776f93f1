"""The camera over one tray: from bead positions to the picture."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.experiment.materials import known_materials
from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.numerics.counter_rng import Purpose, hashed, key_for
from nanorocks_ros.simulation.tray_camera.appearance_rows import look_rows
from nanorocks_ros.simulation.tray_camera.bead_drawing import copy_surface, draw_beads, expose
from nanorocks_ros.simulation.tray_camera.tray_background import empty_tray, noisy_strip

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SimulationSettings

# Wall of the tray as seen from above, [m].
RIM = 0.0012

# Outline of a bead, [px]: a pixel's own width and a little blur of the lens.
EDGE_WIDTH_PX = 1.6

# Places at which a row of the surroundings may start in the strip of noise.
_STRIP_PLACES = 1 << 16

# Counters of the two hashes under the key of the noise of one frame.
_SURROUNDINGS, _TRAY = 0, 1


class TrayCamera:
    """Draws one tray, centred, from straight above; image x is tray x, image y (down) tray y.

    Parameters
    ----------
    settings : SimulationSettings
        Size, scale, noise and seed of the pictures.
    tray : Tray
    radii : ndarray (n,), [m]
    materials : tuple of n str
        Names of the materials of the beads: of the tray, or of `materials.yaml`.
    edge_width_px : float, [px], > 0
        Width of the outline of a bead.

    Raises
    ------
    SimulationError
        When the tray does not fit into the picture, or the beads cannot be drawn.
    """

    def __init__(
        self,
        settings: SimulationSettings,
        tray: Tray,
        radii: NDArray[np.float64],
        materials: tuple[str, ...],
        edge_width_px: float = EDGE_WIDTH_PX,
    ) -> None:
        self._scale = float(settings.pixels_per_metre)
        self._shape = (settings.height_px, settings.width_px, 3)
        self._noise = float(settings.noise)
        self._width = float(edge_width_px)
        self._radii_px = np.asarray(radii, dtype=np.float64) * self._scale
        self._region = _centred(tray, settings)
        self._check(materials)
        known = known_materials() | tray.materials
        unknown = sorted(set(materials) - set(known))
        if unknown:
            raise SimulationError(
                f'material {unknown[0]!r}',
                f'is not described (known: {", ".join(sorted(known))})',
                'name one that is, or describe it in the file of trays',
            )
        self._looks = look_rows([known[name] for name in materials])
        self._noise_key = key_for(settings.seed, 0, Purpose.NOISE)
        self._margin = self._fitting_margin()
        texture_key = key_for(settings.seed, 0, Purpose.TEXTURE)
        self._empty = empty_tray(
            self._region.height, self._region.width, self._margin, RIM * self._scale, texture_key
        )
        strip_length = settings.width_px + _STRIP_PLACES - 1
        self._strip = noisy_strip(strip_length, self._noise, self._noise_key)

    @property
    def region(self) -> Region:
        """Region of the floor of the tray in the picture."""
        return self._region

    def picture(self, positions: NDArray[np.float64], number: int) -> NDArray[np.uint8]:
        """Draw the scene.

        Parameters
        ----------
        positions : ndarray (n, 3), [m]
            Of the centres of the beads, from the corner of the tray; z towards the camera.
        number : int, >= 0
            Of the frame: the noise of a frame depends on nothing else.

        Returns
        -------
        ndarray of uint8, (height, width, 3), bgr

        Raises
        ------
        SimulationError
            For positions of another shape, or not finite.
        """
        n = self._radii_px.size
        places = np.array(positions, dtype=np.float64)
        if places.shape != (n, 3) or not np.isfinite(places).all():
            raise SimulationError(
                'positions', f'shape {places.shape}, expected {(n, 3)}', 'give finite positions'
            )
        frame_key = np.uint64(hashed(self._noise_key, number))
        image = np.empty(self._shape, dtype=np.uint8)
        copy_surface(image, self._strip, np.uint64(hashed(frame_key, _SURROUNDINGS)))
        margin = self._margin
        canvas = self._empty.copy()
        discs = np.empty((n, 3))
        discs[:, :2] = places[:, :2] * self._scale + margin
        discs[:, 2] = self._radii_px
        draw_beads(canvas, discs, np.ascontiguousarray(places[:, 2]), self._looks, self._width)
        top, left = self._region.y - margin, self._region.x - margin
        view = image[top : top + canvas.shape[0], left : left + canvas.shape[1]]
        expose(canvas, view, self._noise, np.uint64(hashed(frame_key, _TRAY)))
        return image

    def _fitting_margin(self) -> int:
        height, width, _ = self._shape
        region = self._region
        right = width - region.x - region.width
        below = height - region.y - region.height
        full_margin = math.ceil(RIM * self._scale) + math.ceil(self._width) + 1
        return min(full_margin, region.x, region.y, right, below)

    def _check(self, materials: tuple[str, ...]) -> None:
        if self._radii_px.ndim != 1 or len(materials) != self._radii_px.size:
            raise SimulationError(
                'materials',
                f'{len(materials)} of them for radii of shape {self._radii_px.shape}',
                'give one for each bead',
            )
        if not (np.isfinite(self._radii_px).all() and (self._radii_px > 0.0).all()):
            raise SimulationError('radii', 'not all positive', 'give positive radii in metres')
        if not (math.isfinite(self._width) and self._width > 0.0):
            raise SimulationError('edge_width_px', f'{self._width!r}', 'give a positive width')


def _centred(tray: Tray, settings: SimulationSettings) -> Region:
    width = round(tray.dimensions[0] * settings.pixels_per_metre)
    height = round(tray.dimensions[1] * settings.pixels_per_metre)
    if not (1 <= width <= settings.width_px and 1 <= height <= settings.height_px):
        raise SimulationError(
            f'tray {tray.number}',
            f'{width} x {height} px in a picture of {settings.width_px} x {settings.height_px}',
            'lower pixels_per_metre or enlarge the picture',
        )
    x = (settings.width_px - width) // 2
    return Region(x, (settings.height_px - height) // 2, width, height)
