"""The size of the discs in a picture, where nothing is told of it, and the height of their edges.

Tested by ``test/stages/tracking/scene/test_scene_model.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.stages.tracking.scene.outlines.disc_measures import apart
from nanorocks_ros.stages.tracking.scene.outlines.edge_votes import Voting, find_centres
from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import Outlines, fit_outlines

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Trial radii when nothing is known of the size: smallest, part of the picture, and their ratio.
_SMALLEST_PX, _LARGEST_SHARE, _RADIUS_RATIO = 2.5, 0.25, 1.3
_RADIUS_TOLERANCE = 0.2
# Smallest share of an outline that votes for a centre, and that the edges on the circle cover.
_LEAST_VOTES, LEAST_SUPPORT = 0.5, 0.7


def usual_step(picture: NDArray[np.uint8], noise: float) -> float:
    """Step of a strong edge of the picture, where beads are not yet known."""
    across = cv2.Sobel(picture, cv2.CV_32F, 1, 0, scale=0.125)
    down = cv2.Sobel(picture, cv2.CV_32F, 0, 1, scale=0.125)
    size = cv2.magnitude(across, down)
    edges = size[size > max(2.0 * noise, 1.0)]
    # An edge spreads over about three pixels.
    return max(3.0 * float(np.quantile(edges, 0.8)) if edges.size else 0.0, 4.0 * noise, 4.0)


def trial_ranges(shape: tuple[int, ...]) -> list[tuple[float, float]]:
    """Smallest and largest radius of each search where nothing is known of the size, [px]."""
    largest = _LARGEST_SHARE * min(shape)
    count = max(1, math.ceil(math.log(largest / _SMALLEST_PX) / math.log(_RADIUS_RATIO)))
    middles = [_SMALLEST_PX * _RADIUS_RATIO ** (k + 0.5) for k in range(count)]
    ratio = math.sqrt(_RADIUS_RATIO)
    return [(middle / ratio, middle * ratio) for middle in middles]


def outlines_in(picture: NDArray[np.uint8], voting: Voting) -> Outlines:
    """Discs with most of an outline in a picture."""
    centres = find_centres(picture, voting, _LEAST_VOTES)
    outlines = fit_outlines(picture, centres[:, :3], voting)
    return outlines.chosen(outlines.support >= LEAST_SUPPORT)


def search_radii(picture: NDArray[np.uint8], start: Voting) -> Voting:
    """With smallest and largest radius of the discs that cover most of the outlines."""
    largest = _LARGEST_SHARE * min(picture.shape)
    best, chosen = 0.0, start._replace(smallest=_SMALLEST_PX, largest=largest)
    for low, high in trial_ranges(picture.shape):
        outlines = outlines_in(picture, start._replace(smallest=low, largest=high))
        outlines = outlines.chosen(apart(outlines))
        evidence = float((outlines.support**2 * outlines.discs[:, 2] * outlines.steps).sum())
        if evidence > best:
            radius = float(np.median(outlines.discs[:, 2]))
            low, high = radius * (1.0 - _RADIUS_TOLERANCE), radius * (1.0 + _RADIUS_TOLERANCE)
            best, chosen = evidence, start._replace(smallest=low, largest=high)
    return chosen
