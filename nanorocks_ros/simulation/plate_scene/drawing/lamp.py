"""The lamp over the plate: its direction, and the light on faces, beads and in shadows.

Tested by ``test/simulation/plate_scene/test_optics.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.settings import SceneSettings

# Columns of `Lamp.row`: unit vector to the lamp (x right, y down, z up), unit vector half way
# between lamp and camera, where a mirror would show the lamp, and length across the picture.
LAMP_X, LAMP_Y, LAMP_Z, HALF_X, HALF_Y, HALF_Z, LAMP_ACROSS = range(7)

# The lamp of the flight is so far from the vertical.
_FLIGHT_ACROSS, _FLIGHT_HEIGHT = 0.60, 0.80
_LEAST_ACROSS = 0.01
# So that the angles of the flight's lamp give its vector to the last digit.
_DIGITS = 12
# Light on the chamfer of a hole by how far its face is turned to the lamp, -1 to 1.
_FACING = (-1.0, -0.8, -0.6, 0.6, 0.8, 1.0)
_CHAMFER = (0.40, 0.44, 0.50, 1.42, 1.55, 1.65)
# The same for the edge of the plate, whose faces look outwards.
_EDGE = (0.60, 0.66, 0.72, 1.25, 1.15, 1.15)
# Light lost in the shadow of a wall by how far it faces away from the lamp, and its reach [m].
_LOST = (0.12, 0.12, 0.12, 0.34, 0.38, 0.40)
_REACH = (0.0004, 0.0004, 0.0004, 0.0009, 0.0009, 0.0009)

# Share of the light on a rim that depends on its direction.
_RIM_SLANT = 0.4

# Inward normals of the walls of a hole: left, top, right, bottom.
_NORMALS = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])


class Lamp:
    """The direction of the light.

    Parameters
    ----------
    scene : SceneSettings
    """

    def __init__(self, scene: SceneSettings) -> None:
        across, height = math.cos(scene.lamp_elevation), math.sin(scene.lamp_elevation)
        x, y = across * math.cos(scene.lamp_azimuth), across * math.sin(scene.lamp_azimuth)
        least = max(across, _LEAST_ACROSS)
        # In single precision throughout, as the kernels compute.
        lamp = np.array([x, y, height], dtype=np.float32)
        half = lamp + np.array([0.0, 0.0, 1.0], dtype=np.float32)
        half = half / np.float32(math.sqrt(np.sum(half * half)))
        self.row: NDArray[np.float32] = np.concatenate([lamp, half, [np.float32(least)]])
        # 1 for the lamp of the flight, 0 for one at the zenith.
        self._slant = round(across * _FLIGHT_HEIGHT / (_FLIGHT_ACROSS * height), _DIGITS)
        unit = np.array([math.cos(scene.lamp_azimuth), math.sin(scene.lamp_azimuth)])
        contrast = min(across / _FLIGHT_ACROSS, 1.0)
        self._facing = np.round(contrast * (_NORMALS @ unit), _DIGITS)
        # Where the shadow of a bead falls, in heights of its centre.
        self.cast: NDArray[np.float64] = np.round(-np.array([x, y]) / height, _DIGITS)

    @property
    def facing(self) -> NDArray[np.float64]:
        """How far the left, top, right and bottom walls of a hole face the lamp, -1 to 1."""
        return np.asarray(self._facing)

    @property
    def chamfer(self) -> tuple[float, float, float, float]:
        """Light on the left, top, right and bottom chamfer of a hole."""
        return _four(np.interp(self._facing, _FACING, _CHAMFER))

    def rim(self, shade: float) -> tuple[float, float, float, float]:
        """Light on the left, top, right and bottom of a rim, which slants into a hole."""
        return _four(shade * (1.0 + _RIM_SLANT * self._facing))

    @property
    def edge(self) -> tuple[float, float, float, float]:
        """Light on the left, top, right and bottom edge of the plate."""
        return _four(np.interp(-self._facing, _FACING, _EDGE))

    def floor_light(
        self, x: NDArray[np.float64], y: NDArray[np.float64], sides: tuple[float, float]
    ) -> NDArray[np.float64]:
        """Light on the floor between the walls: less near the walls at the lamp.

        Parameters
        ----------
        x, y : ndarray, [m]
            From the upper left corner of the floor; they are broadcast against each other.
        sides : tuple of 2 floats, [m]
        """
        lost = np.interp(-self._facing, _FACING, _LOST)
        reach = np.interp(-self._facing, _FACING, _REACH) * max(self._slant, 0.1)
        light = 1.0 - lost[0] * np.exp(-x / reach[0])
        light = light - lost[2] * np.exp(-(sides[0] - x) / reach[2])
        down = 1.0 - lost[1] * np.exp(-y / reach[1]) - lost[3] * np.exp(-(sides[1] - y) / reach[3])
        return np.asarray(light * down)


def _four(values: NDArray[np.float64]) -> tuple[float, float, float, float]:
    left, top, right, bottom = (float(value) for value in values)
    return left, top, right, bottom
