"""Structure function of grains that cover the floor in layers: frame of reference and paths.

Such grains collide within a fraction of their diameter, and hide the floor. So the path is
longer than the displacement by more than in a thin gas, and two pictures are compared in the
frame of reference of the grains: while a tray swings, the grains in it do not follow, and a
picture that follows the tray moves past them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from nanorocks_ros.physics.crowded_grains import (
    displacement_of_path,
    layers_of,
    path_of_displacement,
    persistence_length,
)
from nanorocks_ros.stages.preprocess.shake_detection import difference_power

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# Share of the loss of path by collisions that is not known: losses depend on the restitution, and
# on the sizes of the grains.
_LOSS_ERROR = 0.3
# Relative error of a displacement for what pictures differ in: shadows, blur, facets that turn.
# Benchmark speed_grains: 0.05 over cameras and lights.
_PICTURE_ERROR = 0.05
# What pictures change by when anything moves, beyond their noise at rest, as a share of the
# plateau: 0.01 to 0.02 by JPEG and by edges narrower than a pixel.
CHANGED_SHARE = 0.015
# Displacement, in diameters, after which two pictures are taken to be unrelated. The
# autocovariance of their difference is then right at small displacements, and 2 % low at the
# plateau; a cooling gas of grains may never come further.
_UNRELATED = 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class CrowdedGrains:
    """How grains of a crowded tray hide and hit each other.

    Parameters
    ----------
    layers : float
        Number of grains above one another.
    persistence_px : float, [px]
        Path over which a grain keeps its velocity.
    """

    layers: float
    persistence_px: float

    @classmethod
    def of_tray(cls, tray: Tray, pixels_per_metre: float) -> CrowdedGrains:
        """The crowd of a tray, from the sizes and numbers of its grains."""
        return cls(
            layers=layers_of(tray), persistence_px=persistence_length(tray) * pixels_per_metre
        )

    def unrelated(self, path_px: float, diameter_px: float) -> bool:
        """Whether pictures between which grains come so far show them in unrelated places."""
        return displacement_of_path(path_px, self.persistence_px) >= _UNRELATED * diameter_px

    def path(self, displacement: float, error: float) -> tuple[float, float]:
        """Path of the grains over a lag, and its error, [px].

        Parameters
        ----------
        displacement, error : float, [px]
            Mean displacement, and the error of its measurement.
        """
        path = path_of_displacement(displacement, self.persistence_px)
        if path <= 0.0:
            return 0.0, error
        # Beyond the persistence length paths grow as squares of displacements.
        ahead = path_of_displacement(displacement + error, self.persistence_px)
        systematic = _LOSS_ERROR * (path - displacement), _PICTURE_ERROR * path
        return path, math.hypot(ahead - path, *systematic)


def least_difference(
    later: NDArray[np.uint8], earlier: NDArray[np.uint8], shift_px: tuple[float, float]
) -> tuple[float, float]:
    """Squared difference of two pictures in the frame in which they differ least.

    The pictures follow the tray. Where the tray moved and the grains did not, they are moved back
    by whole pixels, which neither blurs them nor changes their noise; where the camera moved, and
    the grains with the tray, they are left as they are.

    Parameters
    ----------
    later, earlier : ndarray of uint8, (rows, columns)
    shift_px : tuple of 2 floats, [px]
        Displacement of the tray between them, along columns and rows.

    Returns
    -------
    power : float, [gray levels^2]
        Sum over a picture of full size.
    left_px : float, [px]
        Displacement between tray and grains that was not moved back; 0 in the frame of the tray.
    """
    with_tray = difference_power(later, earlier)
    across, down = (round(component) for component in shift_px)
    rows, columns = later.shape
    if max(abs(across), abs(down)) >= min(rows, columns) // 2:
        return with_tray, 0.0
    if across == 0 and down == 0:
        return with_tray, math.hypot(*shift_px)
    now = later[_overlap(rows, -down), _overlap(columns, -across)]
    before = earlier[_overlap(rows, down), _overlap(columns, across)]
    alone = difference_power(now, before) * (later.size / now.size)
    if alone >= with_tray:
        return with_tray, 0.0
    return alone, math.hypot(shift_px[0] - across, shift_px[1] - down)


def _overlap(size: int, shift: int) -> slice:
    """The pixels of a row that another row, moved by so many pixels, covers as well."""
    return slice(max(shift, 0), size + min(shift, 0))
