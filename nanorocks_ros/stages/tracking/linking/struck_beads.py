"""Beads that are struck: they leave the place where they were expected within one frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.linking.link_probabilities import DetectedBeads, KnownBeads

# A bead was seen so many frames ago: in the frame before.
_FRAMES = 1.5
# Another bead or detection has to be so many times as far away.
_ALONE = 1.5
# Radii of the same bead differ by less than this part.
_ALIKE = 0.25


def link_struck_beads(
    links: NDArray[np.int64], known: KnownBeads, detected: DetectedBeads, max_speed: float
) -> NDArray[np.int64]:
    """Links with those of beads that were struck: lone beads and detections without a link.

    Parameters
    ----------
    links : ndarray of int64, (n,)
        Index of the detection of each bead, or -1.
    known : KnownBeads
    detected : DetectedBeads
    max_speed : float, [px/s]

    Returns
    -------
    ndarray of int64, (n,)
    """
    if links.size == 0 or detected.radii.size == 0:
        return links
    recent = known.elapsed <= _FRAMES * known.elapsed.min()
    beads = np.flatnonzero((links < 0) & recent)
    free = np.setdiff1d(np.arange(detected.radii.size), links)
    if beads.size == 0 or free.size == 0:
        return links
    between = known.last_positions[beads, None] - detected.positions[None, free]
    distances = np.hypot(between[..., 0], between[..., 1])
    reach = max_speed * known.elapsed[beads, None]
    ratios = known.expected_radii[beads, None] / detected.radii[None, free]
    distances[(distances > reach) | (np.abs(np.log(ratios)) > _ALIKE)] = np.inf
    linked = links.copy()
    for row, column in enumerate(distances.argmin(axis=1)):
        distance = distances[row, column]
        others = np.append(np.delete(distances[row], column), np.delete(distances[:, column], row))
        if np.isfinite(distance) and (others > _ALONE * distance).all():
            linked[beads[row]] = free[column]
    return linked
