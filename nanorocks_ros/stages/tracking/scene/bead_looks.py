"""What is told of beads, where they are searched, and the discs that a frame shows.

Tested by ``test/stages/tracking/scene/test_scene_detector.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.edge_votes import Voting
    from nanorocks_ros.stages.tracking.scene.outline_fits import Outlines
    from nanorocks_ros.stages.tracking.scene.scene_picture import SceneColours


@dataclass(frozen=True, slots=True, kw_only=True)
class BeadLook:
    """What is told of the beads of a species.

    Parameters
    ----------
    radii : tuple of 2 floats, [px]
        Smallest and largest; NaN: not known.
    sign : int
        1: brighter than the floor, -1: darker, 0: not known.
    colour : tuple of 3 floats or None, bgr, [gray levels]
    apart : float
        Smallest distance of two beads in the picture, in radii.
    """

    radii: tuple[float, float] = (math.nan, math.nan)
    sign: int = 0
    colour: tuple[float, float, float] | None = None
    apart: float = 1.25


class Candidates(NamedTuple):
    """Discs in a frame.

    Parameters
    ----------
    outlines : Outlines
    colours, around : ndarrays (n, 3)
        Inside and around.
    moving : ndarray (n,)
        Share of each that differs from the background.
    aside : ndarray of bool, (n,)
        Those that never move in the film and lie where nothing that looks like a bead does.
    """

    outlines: Outlines
    colours: NDArray[np.float64]
    around: NDArray[np.float64]
    moving: NDArray[np.float64]
    aside: NDArray[np.bool_]


class View(NamedTuple):
    """A picture in which discs are searched.

    Parameters
    ----------
    moves : bool
        Whether it is the difference from the background.
    voting : Voting
    evidence : float
        Sum over the discs that were learnt from.
    """

    moves: bool
    voting: Voting
    evidence: float

    def of(self, color: NDArray[np.uint8], colours: SceneColours) -> NDArray[np.uint8]:
        """The picture, (rows, columns)."""
        return colours.difference(color) if self.moves else colours.picture(color)
