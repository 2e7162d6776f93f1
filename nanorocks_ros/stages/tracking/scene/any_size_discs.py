"""Discs of any size that some frames of a film show, of which nothing is told but a colour."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.stages.tracking.scene.bead_looks import View, join_candidates
from nanorocks_ros.stages.tracking.scene.outlines.disc_measures import (
    colours_of,
    join_outlines,
    marked_shares,
    staying,
)
from nanorocks_ros.stages.tracking.scene.outlines.edge_votes import Voting
from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import Outlines
from nanorocks_ros.stages.tracking.scene.outlines.radius_search import (
    outlines_in,
    trial_ranges,
    usual_step,
)
from nanorocks_ros.stages.tracking.scene.roamed_region import MOVING_SHARE
from nanorocks_ros.stages.tracking.scene.scene_picture import scene_colours

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.bead_looks import Candidates
    from nanorocks_ros.stages.tracking.scene.scene_picture import SceneColours

# Of two discs one lies on the other when their centres are nearer than this part of the larger
# radius, and than this part of the sum of both: highlights, shadows, gaps.
_INSIDE_SHARE, _TOUCHING_SHARE = 0.9, 0.6
# Parts of the outline that lie on the circle count by this step at most, over the usual one.
_MOST_STEP = 2.0
# So many moving discs, and this part of all, leave out those at rest.
_LEAST_MOVING, _LEAST_MOVING_SHARE = 4, 0.2


class AnySizeDiscs(NamedTuple):
    """Discs of all frames.

    Parameters
    ----------
    discs : ndarray (n, 3), [px]
        Column, row, where the first pixel is 0, and radius.
    colours, around : ndarrays (n, 3), bgr, [gray levels]
        Inside and around.
    """

    discs: NDArray[np.float64]
    colours: NDArray[np.float64]
    around: NDArray[np.float64]

    @classmethod
    def joined(cls, frames: Sequence[Candidates]) -> AnySizeDiscs:
        """The discs of some frames."""
        every, _ = join_candidates(frames)
        return cls(every.outlines.discs, every.colours, every.around)

    def chosen(self, rows: NDArray[np.bool_]) -> AnySizeDiscs:
        """Some of the discs."""
        return AnySizeDiscs(*(values[rows] for values in self))


def any_size_discs(
    frames: Sequence[NDArray[np.uint8]],
    colour: tuple[float, float, float] | None = None,
) -> AnySizeDiscs:
    """Discs of any size in frames of a film; where enough of them move, those that do.

    Parameters
    ----------
    frames : sequence of ndarrays of uint8, (rows, columns, 3), bgr
        Spread over the film.
    colour : tuple of 3 floats, bgr, [gray levels], optional
        Of the beads that have to stand out, where it is told.
    """
    told = None if colour is None else np.array(colour)
    colours = scene_colours(frames, told)
    parts, moves, rows = [], [], []
    for frame in frames:
        color = np.ascontiguousarray(frame)
        outlines = _outlines(color, colours)
        moves.append(marked_shares(colours.moving(color), outlines.discs) >= MOVING_SHARE)
        rows.append(colours_of(color, outlines.discs))
        parts.append(outlines)
    number = np.repeat(np.arange(len(parts)), [len(part.steps) for part in parts])
    every = join_outlines(parts)
    discs = AnySizeDiscs(every.discs, *map(np.concatenate, zip(*rows, strict=True)))
    if not colours.knows_background:
        return discs
    moving = np.concatenate(moves)
    moving &= ~staying(every.discs, moving, number)
    enough = max(_LEAST_MOVING, _LEAST_MOVING_SHARE * len(moving))
    return discs.chosen(moving) if moving.sum() >= enough else discs


def _outlines(color: NDArray[np.uint8], colours: SceneColours) -> Outlines:
    """Discs of a frame that do not lie on one another; their steps over the usual one."""
    views = [View(False, Voting(0.0, 0.0, sign, 1.0, colours.noise), 0.0) for sign in (1, -1)]
    if colours.knows_background:
        views.append(View(True, Voting(0.0, 0.0, 1, 1.0, colours.unrest), 0.0))
    parts = []
    for view in views:
        picture = view.of(color, colours)
        step = usual_step(picture, view.voting.noise)
        for low, high in trial_ranges(picture.shape):
            voting = view.voting._replace(smallest=low, largest=high, step=step)
            outlines = outlines_in(picture, voting)
            radii = outlines.discs[:, 2]
            # Others are found with the next radii.
            sized = (radii > 0.95 * low) & (radii < 1.05 * high)
            parts.append(outlines._replace(steps=outlines.steps / step).chosen(sized))
    return _topmost(join_outlines(parts))


def _topmost(outlines: Outlines) -> Outlines:
    """Of discs that lie on one another, those with more of an outline."""
    strength = outlines.support**2 * np.minimum(outlines.steps, _MOST_STEP)
    places, radii = outlines.discs[:, :2], outlines.discs[:, 2]
    kept: list[int] = []
    for k in np.argsort(-strength * radii, kind='stable').tolist():
        away = np.hypot(*(places[kept] - places[k]).T)
        larger = np.maximum(radii[kept], radii[k])
        limit = np.maximum(_INSIDE_SHARE * larger, _TOUCHING_SHARE * (radii[kept] + radii[k]))
        if (away > limit).all():
            kept.append(k)
    chosen = np.zeros(len(radii), dtype=bool)
    chosen[kept] = True
    return outlines.chosen(chosen)
