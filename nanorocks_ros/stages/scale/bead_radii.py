"""The scale by the radii of the beads, whose diameters are known.

Tested by ``test/stages/scale/test_scale_check.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Species, Tray

# Bias of a measured radius by blur, light and noise, as a share: docs/validation/drawn_films.md.
_RADIUS_BIAS = 0.005
# Beads alike whose radii scatter by more than this (half the interquartile range) are no circles.
_LARGEST_SPREAD = 0.04
# Least number of beads, and share of those there are.
_LEAST_BEADS, _LEAST_SHARE = 5, 0.7
# Where diameters have a range, nine beads of ten are in it: the tails hold confused beads.
_TAIL = 0.1


def alike(species: Species) -> bool:
    """Whether all beads of a species have one diameter."""
    return species.diameter_low == species.diameter_high


def measurable(tray: Tray, species: Species) -> bool:
    """Whether the radii of a species can be compared with what they should be.

    Chalk hides part of the outlines, grains are no circles, and among grains beads of several
    sizes are confused with them.
    """
    if tray.chalk or species.properties.shape == 'grain':
        return False
    among_grains = any(other.properties.shape == 'grain' for other in tray.species)
    return alike(species) or not among_grains


def radius_scale(
    species: Species, radii: NDArray[np.float64], errors: NDArray[np.float64], frames: int
) -> tuple[float, float] | None:
    """Scale over that of the settings, and its error; None when the radii do not tell.

    Parameters
    ----------
    species : Species
    radii, errors : ndarray (n,), [m]
        At the scale of the settings, from all frames. Stated errors hold what blur and highlights
        may displace the outlines of all beads by, which is much for small ones.
    frames : int
    """
    beads = radii.size / max(frames, 1)
    if beads < max(_LEAST_BEADS, _LEAST_SHARE * species.count):
        return None
    shared = math.hypot(_RADIUS_BIAS, float(np.median(errors / radii)))
    if not alike(species):
        return _range_scale(species, radii, shared)
    low, middle, high = np.quantile(radii, [0.25, 0.5, 0.75]) / (0.5 * species.diameter)
    spread = 0.5 * (high - low) / middle
    if spread > _LARGEST_SPREAD:
        return None
    # The same beads in every frame.
    error = math.hypot(shared, 1.9 * spread / math.sqrt(beads))
    return float(middle), error


def _range_scale(
    species: Species, radii: NDArray[np.float64], shared: float
) -> tuple[float, float] | None:
    """Nothing is known of the distribution but its ends: the scale lies between two limits.

    `shared` is the relative error of all radii together.
    """
    small, large = np.quantile(radii, [_TAIL, 1.0 - _TAIL])
    lowest = 2.0 * large / species.diameter_high
    highest = 2.0 * small / species.diameter_low
    if highest <= lowest:
        return None
    middle, half = 0.5 * (lowest + highest), 0.5 * (highest - lowest)
    # The limits are two standard errors away.
    return float(middle), float(math.hypot(shared, 0.5 * half / middle))
