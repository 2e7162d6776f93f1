"""Where beads move in a film: what lies aside and never moves is none.

Tested by ``test/stages/tracking/scene/test_roamed_region.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.stages.tracking.scene.outlines.disc_measures import marked_shares

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.scene_picture import SceneColours

MOVING_SHARE = 0.15
"""A disc moves where this share of it differs from the background."""

# A disc lies aside where less than this part of it is among what moves.
_ROAMED_SHARE = 0.5
# What a bead changes, over its usual step; other light changes less.
_CHANGED_STEP = 0.4
# Frames in which a place has to change: the light may be another one in one of them.
_LEAST_FRAMES = 2
_MOST_FRAMES = 50
# Corners of the square around a disc, in radii.
_AROUND = np.array([(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)])


@dataclass(frozen=True, slots=True, kw_only=True)
class RoamedRegion:
    """The part of the picture in which beads move at some time.

    Parameters
    ----------
    mask : ndarray of uint8, (rows, columns)
        1 inside.
    colours : SceneColours
    levels : float, [gray levels]
        Difference from the background where a bead is or was, not another light.
    """

    mask: NDArray[np.uint8]
    colours: SceneColours
    levels: float

    def outside(self, discs: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which discs (n, 3) lie outside."""
        return np.asarray(marked_shares(self.mask, discs) < _ROAMED_SHARE)

    def aside(self, color: NDArray[np.uint8], discs: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which discs (n, 3) lie outside, and do not move in a frame either."""
        aside = self.outside(discs)
        if aside.any():
            moving = self.colours.moving(color, self.levels)
            aside[aside] = marked_shares(moving, discs[aside]) < MOVING_SHARE
        return np.asarray(aside)


def roamed_region(
    frames: Sequence[NDArray[np.uint8]],
    colours: SceneColours,
    moved: NDArray[np.float64],
    step: float,
) -> RoamedRegion:
    """What changes in frames spread over a film, and all that lies between discs that move.

    Parameters
    ----------
    frames : sequence of ndarrays of uint8, (rows, columns, 3), bgr
    colours : SceneColours
    moved : ndarray (n, 3), [px]
        Discs that move, in some of the frames.
    step : float, [gray levels]
        Usual difference of a bead from the background.
    """
    levels = _CHANGED_STEP * step
    times = np.zeros(frames[0].shape[:2], dtype=np.uint8)
    chosen = frames[:: max(1, len(frames) // _MOST_FRAMES)]
    for frame in chosen:
        times += colours.moving(frame, levels)
    mask = (times >= min(_LEAST_FRAMES, len(chosen) // 2)).astype(np.uint8)
    corners = moved[:, None, :2] + moved[:, 2:, None] * _AROUND
    hull = cv2.convexHull(np.rint(corners.reshape(-1, 2)).astype(np.int32))
    filled = np.asarray(cv2.fillConvexPoly(mask, hull, 1), dtype=np.uint8)
    return RoamedRegion(mask=filled, colours=colours, levels=levels)
