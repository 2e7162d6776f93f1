"""Discs that show in a picture: places that edges vote for, and the outlines there.

Tested by ``test/stages/tracking/scene/test_scene_model.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.stages.tracking.scene.outlines.disc_kernels import have_near
from nanorocks_ros.stages.tracking.scene.outlines.disc_measures import join_outlines
from nanorocks_ros.stages.tracking.scene.outlines.edge_votes import centres_of_all_sizes
from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import fit_outlines
from nanorocks_ros.stages.tracking.scene.outlines.smeared_discs import smeared_discs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.outlines.edge_votes import Voting
    from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import Outlines

LEAST_LEVELS = 4.0
"""Smallest step at the edge of a bead, [gray levels]."""

# Smallest share of the outline that votes, and that the edges on the circle cover.
_LEAST_VOTES, _LEAST_SUPPORT = 0.25, 0.5
# A step is that of a bead above this part of the usual one: those of shadows are softer.
_LEAST_STEP = 0.35
# And above so many times the noise.
_LEAST_NOISES = 4.0
# A search begins where a bead is expected, and not again within this part of its radius where
# that shows an outline with this support and step over the usual one, and of the radius that is
# expected, whose logarithm differs by less than this.
_SAME_SIZE = 0.12
_SAME_SHARE, _SURE_SUPPORT, _SURE_STEP = 0.8, 0.7, 0.5
# Shadows have wide edges, which vote for more than an outline, and may lie over a clear bead: so
# many places beside them, so many radii away, are searched, too.
_SOFT_VOTES, _BESIDE, _BESIDE_RADII, _WHOLE_SUPPORT = 1.2, 8, 0.7, 0.85


def search_outlines(
    picture: NDArray[np.uint8],
    voting: Voting,
    hints: NDArray[np.float64] | None = None,
    moving: NDArray[np.uint8] | None = None,
) -> Outlines:
    """Discs of a picture; their steps over the usual one.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, columns)
        Slightly blurred.
    voting : Voting
    hints : ndarray (k, 3), [px], optional
        Column, row and radius where beads are expected.
    moving : ndarray of uint8, (rows, columns), optional
        1 where something moves: discs that are smeared there are found, too.
    """
    expected = np.empty((0, 3)) if hints is None else hints
    at_hints = fit_outlines(picture, expected, voting)
    # A bead keeps its size: of another one is a circle through edges of neighbours.
    same_size = np.abs(np.log(at_hints.discs[:, 2] / expected[:, 2])) < _SAME_SIZE
    sure = at_hints.discs[are_sure(at_hints, voting.step) & same_size]
    centres = _away(centres_of_all_sizes(picture, voting, _LEAST_VOTES), sure, voting)
    starts, votes = centres[:, :3], centres[:, 3]
    at_starts = fit_outlines(picture, starts, voting)
    beside = _beside(starts[(votes > _SOFT_VOTES) & ~are_sure(at_starts, voting.step)])
    at_beside = fit_outlines(picture, beside, voting)
    # A smeared bead has wide edges, too, but no whole outline.
    whole = at_beside.support >= _WHOLE_SUPPORT
    outlines = join_outlines([at_hints, at_starts, at_beside.chosen(whole)])
    steps = outlines.steps / voting.step
    good = (outlines.support >= _LEAST_SUPPORT) & (steps >= _LEAST_STEP)
    good &= outlines.steps >= max(LEAST_LEVELS, _LEAST_NOISES * voting.noise)
    sharp = outlines._replace(steps=steps).chosen(good)
    if moving is None:
        return sharp
    places = np.concatenate([expected, starts, beside[whole]])
    smeared = smeared_discs(picture, moving, places[~good], voting)
    return join_outlines([sharp, smeared.chosen(smeared.steps >= _LEAST_STEP)])


def are_sure(outlines: Outlines, usual: float) -> NDArray[np.bool_]:
    """Which outlines show well, by the usual step."""
    sure = outlines.support >= _SURE_SUPPORT
    return np.asarray(sure & (outlines.steps >= _SURE_STEP * usual))


def _away(
    places: NDArray[np.float64], sure: NDArray[np.float64], voting: Voting
) -> NDArray[np.float64]:
    """Places that are not those of discs that show well."""
    near = np.empty(len(places), dtype=bool)
    centres, known = (np.ascontiguousarray(discs[:, :2]) for discs in (places, sure))
    have_near(centres, known, np.full(len(places), _SAME_SHARE * voting.smallest), 1, near)
    return np.asarray(places[~near])


def _beside(starts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places around each disc at which to begin, too."""
    angles = 2.0 * math.pi * np.arange(_BESIDE) / _BESIDE
    ways = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(_BESIDE)])
    places = starts[:, None] + _BESIDE_RADII * starts[:, None, 2:] * ways
    return np.asarray(places.reshape(-1, 3))
