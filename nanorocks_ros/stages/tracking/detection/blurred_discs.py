"""Edges that are found on the outline of a blurred disc.

Blur moves the half-level contour of a disc inward, by its variance over the diameter. In a disc
that is hardly larger than the blur no level is that of the inside or the outside, and the edge
between the levels nearby is elsewhere again. Both follow from the picture of a disc behind a
Gaussian.

Tested by ``test/stages/tracking/detection/test_outline_profiles.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import i0e

from nanorocks_ros.stages.tracking.detection.bead_edges import (
    CURVATURES,
    MAX_CURVATURE,
    MAX_REACH_PX,
    edges_between,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

REACHES = MAX_REACH_PX - 1, MAX_REACH_PX
"""Distances within which edges are searched, [px]."""
# Gauss-Legendre nodes of the integral over a disc, within so many widths of the blur.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)
_WIDTHS = 6.0


def blurred_disc(
    distances: NDArray[np.float64], radius: NDArray[np.float64], width: float
) -> NDArray[np.float64]:
    """Level of a disc of level 1 behind a Gaussian, at distances from its centre.

    Parameters
    ----------
    distances, radius : ndarrays of one shape, [px]
    width : float, [px]
        Standard deviation of the Gaussian.
    """
    r = np.abs(distances)[..., np.newaxis]
    low = np.maximum(r - _WIDTHS * width, 0.0)
    high = np.maximum(np.minimum(r + _WIDTHS * width, radius[..., np.newaxis]), low)
    half = 0.5 * (high - low)
    at = low + half * (1.0 + _NODES)
    scaled = r * at / width**2
    density = at / width**2 * np.exp(-0.5 * ((r - at) / width) ** 2) * i0e(scaled)
    return np.asarray((half * _WEIGHTS * density).sum(axis=-1))


def edge_biases(variance: float) -> NDArray[np.float64]:
    """Distance of the edge that is found from the outline, (2, CURVATURES), [px].

    Parameters
    ----------
    variance : float, [px^2], > 0
        Of the blur.

    Returns
    -------
    ndarray
        For edges searched within 2 and 3 px; columns for 1 / radius from 0 to `MAX_CURVATURE`.
    """
    biases = np.zeros((len(REACHES), CURVATURES))
    radii = 1.0 / np.linspace(0.0, MAX_CURVATURE, CURVATURES)[1:]
    for row, reach in enumerate(REACHES):
        radius, places = np.broadcast_arrays(radii[:, np.newaxis], np.arange(-reach, reach + 1.0))
        profiles = blurred_disc(radius + places, radius, np.sqrt(variance))
        biases[row, 1:] = edges_between(profiles)
    return biases
