"""What is told of beads, where they are searched, and the discs that a frame shows.

Tested by ``test/stages/tracking/scene/test_scene_detector.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.stages.tracking.scene.outlines.disc_measures import join_outlines

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.outlines.edge_votes import Voting
    from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import Outlines
    from nanorocks_ros.stages.tracking.scene.scene_picture import SceneColours

# Brightness of a shaded bead over that of its colour in even light.
_DARKEST, _BRIGHTEST = 0.4, 1.35


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
    floor : ndarray (n, 3)
        Of the background inside; NaN where it is not known.
    moving : ndarray (n,)
        Share of each that differs from the background.
    aside : ndarray of bool, (n,)
        Those that never move in the film and lie where nothing that looks like a bead does.
    """

    outlines: Outlines
    colours: NDArray[np.float64]
    around: NDArray[np.float64]
    floor: NDArray[np.float64]
    moving: NDArray[np.float64]
    aside: NDArray[np.bool_]

    def chosen(self, rows: NDArray[np.bool_]) -> Candidates:
        """Some of the discs."""
        return Candidates(
            self.outlines.chosen(rows),
            self.colours[rows],
            self.around[rows],
            self.floor[rows],
            self.moving[rows],
            self.aside[rows],
        )


def join_candidates(parts: Sequence[Candidates]) -> tuple[Candidates, NDArray[np.intp]]:
    """Discs of several frames, and the number of the frame of each, (n,)."""
    joined = Candidates(
        join_outlines([part.outlines for part in parts]),
        *(np.concatenate([part[k] for part in parts]) for k in range(1, 6)),
    )
    return joined, np.repeat(np.arange(len(parts)), [len(part.moving) for part in parts])


def shaded_distances(
    colours: NDArray[np.float64], told: tuple[float, float, float]
) -> NDArray[np.float64]:
    """Distance of colours (n, 3) from one that is told, in light or shade, (n,), [gray levels]."""
    colour = np.array(told)
    shade = np.clip(colours @ colour / (colour @ colour), _DARKEST, _BRIGHTEST)
    return np.asarray(np.linalg.norm(colours - shade[:, None] * colour, axis=1))


class View(NamedTuple):
    """A picture in which discs are searched.

    Parameters
    ----------
    moves : bool
        Whether it is the difference from the background.
    voting : Voting
    evidence : float
        Sum over the discs that were learnt from.
    shifts : tuple of tuples of 4 floats
        Of beads of each size: largest radius, [px], and what circles are to be moved across and
        down and their radius by, in radii.
    """

    moves: bool
    voting: Voting
    evidence: float
    shifts: tuple[tuple[float, float, float, float], ...] = ()

    def with_step(self, step: float) -> View:
        """The same with another usual step at edges, [gray levels]."""
        return self._replace(voting=self.voting._replace(step=step))

    def of(self, color: NDArray[np.uint8], colours: SceneColours) -> NDArray[np.uint8]:
        """The picture, (rows, columns)."""
        return colours.difference(color) if self.moves else colours.picture(color)
