"""Pairs of beads of an ideal gas in a box: what pair correlations are compared with.

Beads that know nothing of each other are spread evenly over the places that the side walls leave
to their centres. Two of them at random have a separation with the density

    p(x, y) = l_x(|x|) l_y(|y|) / (H_ax H_bx H_ay H_by),

where l is the length of the overlap of the two ranges, one of them moved by the separation. The
walls are in it exactly, so that no distance is lost to an edge.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Points of the integral over a ring: directions of a quadrant, and distances in a bin.
_DIRECTIONS, _DISTANCES = 64, 8


def pair_probabilities(
    first: NDArray[np.float64], second: NDArray[np.float64], edges: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Probability that two beads at random are at a projected distance in each bin.

    Parameters
    ----------
    first, second : ndarray (2,), [m], > 0
        Lengths along x and y of the ranges of the two centres, about the same middle.
    edges : ndarray (n + 1,), [m], >= 0
        Of the bins, rising.

    Returns
    -------
    ndarray (n,)

    Raises
    ------
    ConfigurationError
        When a length is not positive, or edges do not rise.
    """
    if not (np.min(first) > 0.0 and np.min(second) > 0.0):
        raise ConfigurationError('box', 'leaves no room to the beads', 'give smaller beads')
    if not (edges[0] >= 0.0 and (np.diff(edges) > 0.0).all()):
        raise ConfigurationError('edges', 'do not rise from 0 on', 'sort them')
    nodes, weights = np.polynomial.legendre.leggauss(_DISTANCES)
    turns, turn_weights = np.polynomial.legendre.leggauss(_DIRECTIONS)
    angles = 0.25 * math.pi * (turns + 1.0)
    half = 0.5 * np.diff(edges)[:, np.newaxis]
    distances = edges[:-1, np.newaxis] + half * (nodes + 1.0)
    density = np.ones((*distances.shape, angles.size))
    for axis, cosines in enumerate((np.cos(angles), np.sin(angles))):
        apart = distances[..., np.newaxis] * cosines
        overlap = np.minimum(
            min(first[axis], second[axis]), 0.5 * (first[axis] + second[axis]) - apart
        )
        density *= np.clip(overlap, 0.0, None) / (first[axis] * second[axis])
    # Four quadrants, each of a quarter turn.
    ring = math.pi * (density @ turn_weights) * distances
    probabilities: NDArray[np.float64] = (half * weights * ring).sum(axis=1)
    return probabilities
