"""Chalk dust: patches on floor and walls, and a pattern for the beads.

Tested by ``test/simulation/plate_scene/test_plate_camera.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_CHALK = np.array([222.0, 225.0, 227.0], np.float32)
_PATTERN = 128


def dusted_floor(
    floor: NDArray[np.float32], chalk: float, metre: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    """A floor with patches of dust, most of it along the walls.

    Parameters
    ----------
    floor : ndarray of float32, (rows, columns, 3), [gray levels]
    chalk : float
        How much dust; 1 is what lies in trays 2 and 4.
    metre : float, [px/m]
        Scale of the picture.
    rng : Generator
    """
    rows, columns = floor.shape[:2]
    patches = np.zeros((rows, columns), dtype=np.float32)
    for size, weight in ((0.0024, 0.9), (0.0008, 0.6), (0.0002, 0.45)):
        patches += weight * _blotches((rows, columns), size * metre, rng)
    y, x = np.ogrid[0.5:rows, 0.5:columns]
    to_wall = np.minimum(np.minimum(x, columns - x), np.minimum(y, rows - y)) / metre
    patches = patches + 1.1 * np.exp(-to_wall / 0.0010) - 0.75
    share = chalk * np.clip(0.42 * patches, 0.0, 0.75)
    share = np.clip(share + 0.10 * chalk, 0.0, 0.9)[..., np.newaxis]
    lit = floor.mean(axis=2, keepdims=True) / 158.0
    return np.asarray(floor + share * (_CHALK * np.minimum(lit, 1.05) - floor), np.float32)


def dust_pattern(rng: np.random.Generator) -> NDArray[np.float32]:
    """Pattern of dust on beads, (128, 128): coarse patches and specks, mean about 0.4."""
    shape = (_PATTERN, _PATTERN)
    field = 0.9 * _blotches(shape, 6.0, rng, wrap=True) + 0.45 * _blotches(shape, 2.2, rng, True)
    return np.asarray(np.clip(0.38 + 0.24 * field, 0.05, 0.9), dtype=np.float32)


def _blotches(
    shape: tuple[int, int], size: float, rng: np.random.Generator, wrap: bool = False
) -> NDArray[np.float32]:
    """Smooth noise of standard deviation 1 with patches of about the given width."""
    border = cv2.BORDER_REFLECT
    raw = rng.standard_normal(shape, dtype=np.float32)
    if wrap:
        raw = np.tile(raw, (3, 3))
    smooth = cv2.GaussianBlur(raw, (0, 0), max(0.5 * size, 0.3), borderType=border)
    if wrap:
        smooth = smooth[shape[0] : 2 * shape[0], shape[1] : 2 * shape[1]]
    return np.asarray(smooth / smooth.std(), dtype=np.float32)
