"""The empty tray: a lit floor of brushed aluminium, its rim, and the plate around it.

Tested by ``test/simulation/tray_camera/test_tray_renderer.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.counter_rng import nearly_normal
from nanorocks_ros.simulation.tray_camera.bead_drawing import to_levels

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Blue, green, red; aluminium is nearly gray.
FLOOR = np.array([154.0, 152.0, 149.0])
RIM = np.array([66.0, 65.0, 64.0])
PLATE = np.array([104.0, 103.0, 101.0])

# Of the floor: loss of light from the lit corner to the far one, and of the brushing.
_GRADIENT = 0.16
_STREAKS = 3.0
_GRAIN = 1.5
# Pixels along which the brush marks hold.
_STREAK_LENGTH = 24

_BEVEL = 0.45


@compiled
def floor_level(i: int, j: int, rows: int, columns: int, key: np.uint64) -> float:
    """Brightness of the floor relative to its mean, at a pixel of the region of the tray."""
    down = (i + 0.5) / rows - 0.5
    across = (j + 0.5) / columns - 0.5
    light = 1.0 - _GRADIENT * (0.5 * (down + across) + 0.5 * (down * down + across * across))
    streak = 0.0
    for k in range(_STREAK_LENGTH):
        streak += nearly_normal(key, (i + 1) * 100_003 + j + k)
    # Standard deviation of a sum of so many is its square root, near 5.
    marks = _STREAKS * streak / 5.0 + _GRAIN * nearly_normal(key, -1 - i * columns - j)
    return light + marks / 150.0


@compiled
def empty_tray(
    rows: int, columns: int, margin: int, rim: float, key: np.uint64
) -> NDArray[np.float32]:
    """Drawing of the tray without beads.

    Parameters
    ----------
    rows, columns : int, [px]
        Of the floor.
    margin : int, [px]
        Drawn on all sides of it.
    rim : float, [px]
        Width of the wall as seen from above.
    key : uint64

    Returns
    -------
    ndarray of float32, (rows + 2 margin, columns + 2 margin, 3), [gray levels]
    """
    canvas = np.empty((rows + 2 * margin, columns + 2 * margin, 3), dtype=np.float32)
    for a in range(canvas.shape[0]):
        for b in range(canvas.shape[1]):
            i, j = a - margin, b - margin
            outside = max(max(-i, i - rows + 1), max(-j, j - columns + 1))
            for channel in range(3):
                if outside <= 0:
                    level = FLOOR[channel] * floor_level(i, j, rows, columns, key)
                elif outside <= rim:
                    # The bevel catches more light towards its outer edge.
                    level = RIM[channel] * (1.0 + _BEVEL * outside / rim)
                else:
                    level = PLATE[channel]
                canvas[a, b, channel] = level
    return canvas


@compiled
def noisy_strip(length: int, noise: float, key: np.uint64) -> NDArray[np.uint8]:
    """Noisy strip of the plate around the tray, (length, 3), [gray levels]."""
    strip = np.empty((length, 3), dtype=np.uint8)
    for i in range(length):
        for channel in range(3):
            level = PLATE[channel] + noise * nearly_normal(key, 3 * i + channel)
            strip[i, channel] = to_levels(level)
    return strip
