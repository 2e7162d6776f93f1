"""Illumination of the picture: vignetting, gradient and rolling bands.

Tested by ``test/simulation/plate_scene/test_plate_camera.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.simulation.plate_scene.frame_effects import ONE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.settings import SceneSettings

# Bands that the picture is high.
_BANDS = 1.4


class Illumination:
    """Illumination as a product of two factors, along columns and rows, 1 in the middle.

    Parameters
    ----------
    scene : SceneSettings
    shape : tuple of 2 ints, [px]
    """

    def __init__(self, scene: SceneSettings, shape: tuple[int, int]) -> None:
        rows, columns = shape
        self._flicker, self._period = scene.flicker, scene.flicker_period
        x = (2.0 * np.arange(columns) + 1.0 - columns) / columns
        y = (2.0 * np.arange(rows) + 1.0 - rows) / columns
        lost = -math.log1p(-scene.vignetting)
        tilt = 0.5 * scene.gradient
        self._across = np.exp(-lost * x * x) * (1.0 - tilt * x)
        self._down = np.exp(-lost * y * y) * (1.0 - 0.5 * tilt * y * columns / rows)
        self._phase = 2.0 * math.pi * _BANDS * np.arange(rows) / rows
        self.column_factors: NDArray[np.uint32] = _parts(self._across)

    def row_factors(self, time: float) -> NDArray[np.uint32]:
        """Illumination of each row at a time [s], (rows,), in units of 2^-13."""
        angle = 2.0 * math.pi * time / self._period - self._phase
        return _parts(self._down * (1.0 + self._flicker * np.sin(angle)))


def _parts(light: NDArray[np.float64]) -> NDArray[np.uint32]:
    return np.asarray(np.rint(light * ONE), dtype=np.uint32)
