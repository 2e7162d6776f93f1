"""The floor of a tray as far as it is known."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.stages.tracking.detection.background_model import renew_floor


def test_a_floor_beyond_white_stays_white():
    """Of a light that became brighter all of the floor takes its part, the brightest as well."""
    color = np.full((8, 6, 3), 255, dtype=np.uint8)
    floor = np.full(color.shape, 280.0, dtype=np.float32)
    levels = np.full(color.shape, 255, dtype=np.uint8)
    sure = np.ones(color.shape[:2], dtype=bool)
    nothing = np.zeros(color.shape[:2], dtype=np.uint8)
    for turn in range(8):
        renew_floor(color, nothing, False, turn, floor, levels, sure)
    assert floor.max() < 280.0
    assert levels.min() == 255
