"""Darkness from which a pixel shows a gray bead, and not its shadow: by the area that beads cover.

Shadows are as gray as grains, and how dark either is depends on the light and on the blur: the
darkness of blurred grains of 3 px radius is that of a shadow in a sharp film. The area that the
grains cover is known, however. The darkest pixels are theirs, so the threshold is the quantile of
the darkness that leaves that area above it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.tracking.detection.pixel_classes import BLUE, RED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Species, Tray

DEFAULT_PERCENT = 45
"""Darkness of a gray bead where there is no better estimate, [%]."""

# Limits of the threshold [%]: the first is that of coloured beads, below which noise and texture
# of the floor begin; grains reflect a third of what the floor reflects, so that the second lies
# between them and the darkest overlapping shadows.
_LOWEST_PERCENT, _HIGHEST_PERCENT = 30, 58
# One row in so many is counted in each image; weight of an image: a time constant of 10 images.
_ROW_STEP, _WEIGHT = 4, 0.1
_LEVELS = 256
# Smallest step at an edge: three standard deviations of the mean of two pixels of a noisy sensor
# (10 gray levels of a floor of 120). Outside, a shadow may be nearly as dark as the threshold.
_EDGE_STEP, _OUTSIDE_MARGIN = 45.0, 5.0


class GrayThreshold:
    """Follows the threshold from image to image.

    Parameters
    ----------
    share : float
        Share of the area that gray beads cover, 0 to 1; 0 where that is not known.
    """

    def __init__(self, share: float) -> None:
        self._share = share
        self._counts = np.zeros(_LEVELS)
        self._frame = 0
        self.percent = DEFAULT_PERCENT

    @property
    def edge_levels(self) -> tuple[float, float]:
        """At an edge of a gray bead: see `PixelMaps.edge_levels`."""
        return _EDGE_STEP, 0.01 * self.percent * (_LEVELS - 1) - _OUTSIDE_MARGIN

    def update(self, darkness: NDArray[np.uint8], pixel_class: NDArray[np.uint8]) -> None:
        """Learn from the darkness of an image and the classes of its pixels, (rows, columns)."""
        if not self._share:
            return
        counts = count_levels(darkness, pixel_class, self._frame % _ROW_STEP, _ROW_STEP)
        self._frame += 1
        total = counts.sum()
        if not total:
            return
        weight = max(_WEIGHT, 1.0 / self._frame)
        self._counts += weight * (counts / total - self._counts)
        darker = np.cumsum(self._counts[::-1])[::-1]
        level = int(np.count_nonzero(darker > self._share))
        percent = math.ceil(100.0 * level / (_LEVELS - 1))
        self.percent = min(max(percent, _LOWEST_PERCENT), _HIGHEST_PERCENT)


def covered_share(tray: Tray, gray: Sequence[Species]) -> float:
    """Share of the floor that gray beads cover which lie at random, one above the other.

    That of the floor that the other beads leave visible: they fill two thirds of the height of
    the tray, so that hardly any gray bead lies above or below them.
    """
    areas = {
        species: 0.25 * np.pi * _mean_square_diameter(species) * species.count
        for species in tray.species
    }
    covered = sum(areas[species] for species in gray)
    free = tray.dimensions[0] * tray.dimensions[1] - sum(areas.values()) + covered
    return 1.0 - math.exp(-covered / free) if free > 0.0 else 0.0


def _mean_square_diameter(species: Species) -> float:
    """Mean square of diameters that are spread evenly over their range, [m^2]."""
    low, high = species.diameter_low, species.diameter_high
    return (low * low + low * high + high * high) / 3.0


@compiled
def count_levels(
    darkness: NDArray[np.uint8], pixel_class: NDArray[np.uint8], first: int, step: int
) -> NDArray[np.float64]:
    """Number of pixels of each darkness, (256,), without those of coloured beads.

    Parameters
    ----------
    darkness, pixel_class : ndarrays of uint8, (rows, columns)
    first, step : int
        The first row that is counted, and the distance of the next.
    """
    counts = np.zeros(_LEVELS)
    for i in range(first, darkness.shape[0], step):
        for j in range(darkness.shape[1]):
            if pixel_class[i, j] != RED and pixel_class[i, j] != BLUE:
                counts[darkness[i, j]] += 1.0
    return counts
