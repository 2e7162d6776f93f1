"""Circles fitted to the edges along rays from the centres of discs; smeared ones, too."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.stages.tracking.scene.outlines.outline_kernels import (
    RAYS,
    RESULTS,
    Search,
    fit_each,
    scratch,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.outlines.edge_votes import Voting

# Part of the radius on either side of the outline that is searched for edges, by iteration.
_REACHES = 0.5, 0.25
# Fewer rows or columns have no outline, and nothing is farther away.
_LEAST_PX, _FARTHEST_PX = 2, 1e6
# Smallest step of an edge over the usual one, and over the noise.
_LEAST_STEP, _LEAST_NOISES = 0.25, 3.0
# A disc is smeared by at most this part of its radius to either side.
_MOST_SMEARED = 0.45
# Place and size of a smeared disc err by this part of the radius: its ends are soft.
_SMEARED_ERROR = 0.1
# Longest part of its outline without an edge: the end of a rod is open.
_MOST_OPEN = 0.18


class Outlines(NamedTuple):
    """Fitted circles.

    Parameters
    ----------
    discs : ndarray (n, 3), [px]
        Column, row, where the first pixel is 0, and radius.
    errors, radius_errors : ndarrays (n,), [px]
        Standard errors of a coordinate and of the radius.
    support : ndarray (n,)
        Share of the rays whose edge lies on the circle.
    steps : ndarray (n,)
        Mean step of the picture from outside to inside.
    """

    discs: NDArray[np.float64]
    errors: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    support: NDArray[np.float64]
    steps: NDArray[np.float64]

    @property
    def quality(self) -> NDArray[np.float64]:
        """How well each circle shows, 0 to 1, (n,); steps are over the usual one."""
        return np.asarray(self.support * np.minimum(self.steps, 1.0))

    def chosen(self, rows: NDArray[np.bool_]) -> Outlines:
        """Some of the circles."""
        return Outlines(*(values[rows] for values in self))


def fit_outlines(
    picture: NDArray[np.uint8], discs: NDArray[np.float64], voting: Voting
) -> Outlines:
    """Fit a circle to each disc.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, columns)
        Slightly blurred.
    discs : ndarray (n, 3), [px]
        Where to begin: column, row, radius.
    voting : Voting
    """
    results = _fitted(picture, discs, voting, 3)
    return Outlines(results[:, :3].copy(), *results[:, 3:7].T.copy())


def fit_smeared(
    picture: NDArray[np.uint8], discs: NDArray[np.float64], voting: Voting
) -> Outlines:
    """Fit an outline that is longer one way to each disc: beads that moved while it was exposed.

    The radius is half of the width across. Parameters as of `fit_outlines`.
    """
    results = _fitted(picture, discs, voting, 5)
    smear = results[:, 7]
    radii = results[:, 2] - smear
    errors = np.hypot(results[:, 3], _SMEARED_ERROR * radii)
    possible = (smear < _MOST_SMEARED * radii) & (results[:, 8] < _MOST_OPEN)
    possible &= (radii > voting.smallest) & (radii < voting.largest)
    support = np.where(possible, results[:, 5], 0.0)
    discs = np.column_stack([results[:, :2], radii])
    radius_errors = np.hypot(results[:, 4], _SMEARED_ERROR * radii)
    return Outlines(discs, errors, radius_errors, support, results[:, 6].copy())


def _fitted(
    picture: NDArray[np.uint8], discs: NDArray[np.float64], voting: Voting, terms: int
) -> NDArray[np.float64]:
    """Outlines, a sum of as many terms, and what is known of each, (n, RESULTS)."""
    angles = 2.0 * math.pi * np.arange(RAYS) / RAYS
    shape = np.stack(
        [np.cos(angles), np.sin(angles), np.ones(RAYS), np.cos(2 * angles), np.sin(2 * angles)],
        axis=1,
    )
    if voting.outline:
        shape[:, 2] = voting.outline
    search = Search(
        voting.sign,
        max(_LEAST_STEP * voting.step, _LEAST_NOISES * voting.noise),
        float(voting.smallest),
        float(voting.largest),
        np.ascontiguousarray(shape[:, :terms]),
    )
    results = np.zeros((len(discs), RESULTS))
    results[:, :3] = discs
    # Compiled functions do not check their indices.
    somewhere = (np.abs(discs) < _FARTHEST_PX).all(axis=1)
    if min(picture.shape) >= _LEAST_PX and somewhere.any():
        starts, fitted = discs[somewhere], results[somewhere]
        picture = np.ascontiguousarray(picture)
        fit_each(picture, starts, search, _REACHES, scratch(terms), fitted)
        results[somewhere] = fitted
    return results
