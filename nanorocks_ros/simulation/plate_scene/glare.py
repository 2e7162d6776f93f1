"""Glare: mirror images of the LEDs in the window over trays 2 and 4.

A flat window that moves within its own plane shows its mirror images where they were: the glare
stays while the plate swings.

Tested by ``test/simulation/plate_scene/test_plate_camera.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.simulation.plate_scene.simd_rectangles import LEVEL

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.plate import Region
    from nanorocks_ros.simulation.plate_scene.scene_geometry import SceneGeometry

# Column and row on the plate, [m], and relative brightness of each LED.
_LEDS = (
    (0.0165, 0.0310, 1.0),
    (0.0225, 0.0318, 0.8),
    (0.0195, 0.0432, 1.0),
    (0.0262, 0.0440, 0.8),
)
# Of an image: radius of its core, reach of its bloom and of the haze around, [m], with levels.
_CORE, _BLOOM, _HAZE = 0.0011, 0.0028, 0.0075
_CORE_LEVEL, _BLOOM_LEVEL, _HAZE_LEVEL = 700.0, 95.0, 40.0
# Beyond so many times the reach of the haze there is nothing.
_FURTHEST = 2.2
_COLOUR = np.array([1.05, 1.0, 0.94])


class Glare(NamedTuple):
    """Light that is added to part of the picture.

    Parameters
    ----------
    region : Region
    light : ndarray of uint16, (3, rows, columns), bgr, [1/64 gray levels]
    """

    region: Region
    light: NDArray[np.uint16]


def led_glare(geometry: SceneGeometry, strength: float) -> Glare:
    """Mirror images of the LEDs.

    Parameters
    ----------
    geometry : SceneGeometry
    strength : float
        1: their cores are far brighter than the sensor can show.
    """
    left, top, _, _ = geometry.plate
    spots = [(left + x * geometry.scale, top + y * geometry.scale, s) for x, y, s in _LEDS]
    across, down = ([spot[axis] for spot in spots] for axis in (0, 1))
    margin = _FURTHEST * _HAZE * geometry.scale
    region = geometry.bounds(
        min(across) - margin, min(down) - margin, max(across) + margin, max(down) + margin
    )
    grid = np.mgrid[0 : region.height, 0 : region.width][::-1].transpose(1, 2, 0) + 0.5
    places = geometry.camera.rectified(grid + np.array([region.x, region.y]))
    level = np.zeros((region.height, region.width))
    for column, row, brightness in spots:
        distance = np.hypot(places[..., 0] - column, places[..., 1] - row) / geometry.scale
        core = _CORE_LEVEL * np.exp(-((distance / _CORE) ** 4))
        bloom = _BLOOM_LEVEL * np.exp(-((distance / _BLOOM) ** 2))
        haze = _HAZE_LEVEL * np.maximum(1.0 - (distance / (_FURTHEST * _HAZE)) ** 2, 0.0) ** 4
        level += brightness * (core + bloom + haze)
    light = np.minimum(strength * LEVEL * level * _COLOUR[:, np.newaxis, np.newaxis], 65535.0)
    return Glare(region, np.asarray(light, dtype=np.uint16))
