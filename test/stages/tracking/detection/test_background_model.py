"""Background model of a tray."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.stages.tracking.detection.background_model import update_background


def test_a_background_above_255_stays_white():
    """A brighter light scales the whole background, also beyond 255."""
    color = np.full((8, 6, 3), 255, dtype=np.uint8)
    background = np.full(color.shape, 280.0, dtype=np.float32)
    levels = np.full(color.shape, 255, dtype=np.uint8)
    confirmed = np.ones(color.shape[:2], dtype=bool)
    covered = np.zeros(color.shape[:2], dtype=np.uint8)
    for frame in range(8):
        update_background(color, covered, False, frame, background, levels, confirmed)
    assert background.max() < 280.0
    assert levels.min() == 255
