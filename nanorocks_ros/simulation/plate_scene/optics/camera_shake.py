"""Motion of the camera: jitter from frame to frame, and a slow sway.

Tested by ``test/simulation/plate_scene/test_optics.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.numerics.counter_rng import Purpose, hashed, key_for, nearly_normal

if TYPE_CHECKING:
    from nanorocks_ros.settings import SceneSettings

FURTHEST_JITTER = 4.9
"""No shift by jitter exceeds so many standard deviations (`nearly_normal`)."""


class CameraShake:
    """Shift of the whole picture, tray and surroundings, along columns and rows.

    Parameters
    ----------
    scene : SceneSettings
    seed : int
    """

    def __init__(self, scene: SceneSettings, seed: int) -> None:
        self._jitter, self._sway = scene.camera_jitter_px, scene.camera_sway_px
        self._rate = 2.0 * math.pi * scene.camera_sway_frequency
        self._direction = scene.camera_sway_direction
        self._key = key_for(seed, 1, Purpose.NOISE)
        self._phase = 2.0 * math.pi * (hashed(self._key, 0) / 2.0**64)

    @property
    def still(self) -> bool:
        """Whether the camera does not move."""
        return self._jitter == 0.0 and self._sway == 0.0

    def shift(self, number: int, time: float) -> tuple[float, float]:
        """Shift of the picture, [px].

        Parameters
        ----------
        number : int, >= 0
            Of the frame: the jitter is constant during one.
        time : float, [s]
        """
        if self.still:
            return 0.0, 0.0
        sway = self._sway * math.sin(self._rate * time + self._phase)
        across, down = sway * math.cos(self._direction), sway * math.sin(self._direction)
        return across + self._drawn(2 * number + 1), down + self._drawn(2 * number + 2)

    def _drawn(self, counter: int) -> float:
        return self._jitter * float(nearly_normal(self._key, counter))
