"""Discs in a picture: those that do not lie on one another, their colours, what part is marked.

Tested by ``test/stages/tracking/scene/test_scene_model.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.spatial import cKDTree

from nanorocks_ros.stages.tracking.scene.outline_fits import Outlines

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


def join_outlines(parts: Sequence[Outlines]) -> Outlines:
    """The circles of all parts."""
    return Outlines(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def reduced(outlines: Outlines, scale: int) -> Outlines:
    """Circles of an enlarged picture in the picture itself."""
    discs = outlines.discs / scale
    discs[:, :2] -= 0.5 * (scale - 1.0) / scale
    return outlines._replace(
        discs=discs, errors=outlines.errors / scale, radius_errors=outlines.radius_errors / scale
    )


def apart(outlines: Outlines, radii: float = 1.0) -> NDArray[np.bool_]:
    """Which discs to keep, so that no two lie on one another; better ones first.

    Parameters
    ----------
    outlines : Outlines
    radii : float, optional
        Smallest distance of two centres, in radii.
    """
    discs = outlines.discs
    order = np.argsort(-outlines.support * np.minimum(outlines.steps, 1.0), kind='stable')
    keep = np.zeros(len(discs), dtype=bool)
    if len(discs) == 0:
        return keep
    pairs = cKDTree(discs[:, :2]).query_ball_point(discs[:, :2], radii * discs[:, 2])
    taken = np.zeros(len(discs), dtype=bool)
    for k in order:
        if not taken[k]:
            keep[k] = True
            taken[pairs[k]] = True
    return keep


def ring_colours(
    color: NDArray[np.uint8], discs: NDArray[np.float64], parts: Sequence[float]
) -> NDArray[np.float64]:
    """Median colour of the circles around each centre of these parts of the radius, (n, 3)."""
    turns = np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False)
    across = np.outer(parts, np.cos(turns)).ravel()
    down = np.outer(parts, np.sin(turns)).ravel()
    columns = np.clip(np.rint(discs[:, :1] + discs[:, 2:] * across), 0, color.shape[1] - 1)
    rows = np.clip(np.rint(discs[:, 1:2] + discs[:, 2:] * down), 0, color.shape[0] - 1)
    values = color[rows.astype(np.intp), columns.astype(np.intp)]
    return np.asarray(np.median(values, axis=1), dtype=np.float64).reshape(len(discs), 3)


def marked_shares(mask: NDArray[np.uint8], discs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of the bounding square of each disc in which the mask is 1."""
    sums = cv2.integral(mask).astype(np.float64)
    low = np.floor(discs[:, :2] - discs[:, 2:]).astype(np.intp)
    high = np.ceil(discs[:, :2] + discs[:, 2:]).astype(np.intp) + 1
    limits = np.array([mask.shape[1], mask.shape[0]])
    low, high = np.clip(low, 0, limits), np.clip(high, 0, limits)
    inside = (
        sums[high[:, 1], high[:, 0]]
        - sums[low[:, 1], high[:, 0]]
        - sums[high[:, 1], low[:, 0]]
        + sums[low[:, 1], low[:, 0]]
    )
    return np.asarray(inside / np.maximum((high - low).prod(axis=1), 1))
