"""Discs in a picture: those that do not lie on one another, their colours, what part is marked.

Tested by ``test/stages/tracking/scene/test_scene_model.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.spatial import cKDTree

from nanorocks_ros.stages.tracking.scene.outlines.disc_kernels import leave_out_near, ring_medians
from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import Outlines

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


# Circles inside and outside a disc, in radii.
_INSIDE, _OUTSIDE = (0.15, 0.45, 0.7), (1.2, 1.35)
# A disc stays where another one lies within this part of its radius in so many other frames.
_STAYS_SHARE, _STAYS_FRAMES = 0.25, 3


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
    discs = np.ascontiguousarray(outlines.discs)
    order = np.argsort(-outlines.quality, kind='stable')
    keep = np.ones(len(discs), dtype=bool)
    leave_out_near(discs, order, radii, keep)
    return keep


def colours_of(
    color: NDArray[np.uint8], discs: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Median colours inside and around discs, (n, 3) each."""
    return ring_colours(color, discs, _INSIDE), ring_colours(color, discs, _OUTSIDE)


def ring_colours(
    color: NDArray[np.uint8], discs: NDArray[np.float64], parts: Sequence[float]
) -> NDArray[np.float64]:
    """Median colour of the circles around each centre of these parts of the radius, (n, 3)."""
    turns = np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False)
    places = np.stack(
        [np.outer(parts, np.cos(turns)).ravel(), np.outer(parts, np.sin(turns)).ravel()], axis=1
    )
    medians = np.empty((len(discs), 3))
    values = np.empty((3, len(places)), dtype=np.uint8)
    ring_medians(np.ascontiguousarray(color), np.ascontiguousarray(discs), places, values, medians)
    return medians


def marked_shares(mask: NDArray[np.uint8], discs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of the bounding square of each disc in which the mask is 1."""
    sums = cv2.integral(mask)
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


def staying(
    discs: NDArray[np.float64], moving: NDArray[np.bool_], frames: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Which discs lie where others do in several frames, or where one is at rest in another.

    The light, and what it makes of the difference from the background, may change.

    Parameters
    ----------
    discs : ndarray (n, 3)
    moving : ndarray of bool, (n,)
    frames : ndarray of int, (n,)
        Number of the frame of each.
    """
    stays = np.zeros(len(discs), dtype=bool)
    places = cKDTree(discs[:, :2]).query_ball_point(discs[:, :2], _STAYS_SHARE * discs[:, 2])
    for k, near in enumerate(places):
        others = np.array([j for j in near if frames[j] != frames[k]], dtype=np.intp)
        stays[k] = len(np.unique(frames[others])) >= _STAYS_FRAMES or not moving[others].all()
    return stays
