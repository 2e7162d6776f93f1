"""Discs smeared by their motion: longer one way, with soft edges, where the background changes.

Tested by ``test/stages/tracking/scene/outlines/test_smeared_discs.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.stages.tracking.scene.outlines.disc_measures import marked_shares
from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import Outlines, fit_smeared

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.outlines.edge_votes import Voting

# Radius to which the picture is reduced, [px]: soft edges get sharper by it.
_RADIUS_PX = 10.0
# Smallest share of the rays with an edge on the outline, and of the disc that moves.
_LEAST_SUPPORT, _LEAST_MOVING = 0.7, 0.6
# Trust in a smeared outline over that of a sharp one.
_TRUST = 0.6


def smeared_discs(
    picture: NDArray[np.uint8],
    moving: NDArray[np.uint8],
    starts: NDArray[np.float64],
    voting: Voting,
) -> Outlines:
    """Discs that are smeared; their steps over the usual one.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, columns)
    moving : ndarray of uint8, (rows, columns)
        1 where the background changes.
    starts : ndarray (n, 3), [px]
        Column, row, radius.
    voting : Voting
    """
    starts = starts[marked_shares(moving, starts) >= _LEAST_MOVING]
    scale = min(1.0, _RADIUS_PX / math.sqrt(voting.smallest * voting.largest))
    if scale < 1.0 and len(starts):
        rows, columns = picture.shape
        size = max(1, round(columns * scale)), max(1, round(rows * scale))
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
    voting = voting._replace(smallest=voting.smallest * scale, largest=voting.largest * scale)
    starts = np.column_stack([(starts[:, :2] + 0.5) * scale - 0.5, starts[:, 2] * scale])
    outlines = fit_smeared(picture, starts, voting)
    discs = outlines.discs / scale
    discs[:, :2] += 0.5 / scale - 0.5
    outlines = Outlines(
        discs,
        outlines.errors / scale,
        outlines.radius_errors / scale,
        outlines.support,
        _TRUST * outlines.steps / voting.step,
    )
    good = outlines.support >= _LEAST_SUPPORT
    good[good] = marked_shares(moving, outlines.discs[good]) >= _LEAST_MOVING
    return outlines.chosen(good)
