"""Structure function of grains that cover the floor in layers: trays 6 and 8.

It differs from that of single beads in four ways. Grains hide each other, so the response is
converted (:mod:`nanorocks_ros.physics.crowded_grains`). They collide within a fraction of their
diameter, so a path is longer than its displacement. While a tray swings, the grains in it do not
follow, so two pictures are compared in the frame of reference in which they differ least. And
pictures in motion differ by more than their noise at rest, by codec, edges and shadows: this part
does not grow with the lag, and is told from motion by two lags.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.quantiles import Quantile
from nanorocks_ros.physics.crowded_grains import (
    displacement_of_path,
    layers_of,
    path_of_displacement,
    persistence_length,
)
from nanorocks_ros.records import NS
from nanorocks_ros.stages.preprocess.shaking.difference_noise import difference_power
from nanorocks_ros.stages.speed.structure_function import StructureFunction
from nanorocks_ros.stages.speed.structure_samples import ImagePair, Sample

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SpeedSettings

# Displacement, in diameters, after which two pictures are compared to learn the response; a
# cooling gas of grains may never come much further. What they share is corrected for.
_UNRELATED = 1.0
# Share of the elastic loss of path by collisions that is corrected for, and its error. Grains that
# cool come to move along with their neighbours and are deflected less: benchmark speed_grains has
# the losses by restitution.
_LOSS, _LOSS_ERROR = 0.75, 0.35
# Relative error of a displacement for what pictures differ in: shadows, blur, facets that turn.
_PICTURE_ERROR = 0.08
# Share of the way of the tray past the camera that may appear as motion of grains: walls that
# swing drive waves through them.
_SWING_ERROR = 0.3
# Rate at which grains may turn, [rad/s]: pictures do not tell it from motion of the outline.
_TURNING = 0.5
# What pictures in motion differ by beyond their noise, as a share of the plateau: the range that
# is tried, and its error once it is known.
_CHANGES = np.linspace(-0.02, 0.1, 61)
_CHANGE_ERROR = 0.01
# Samples over which its median is taken.
_MEMORY = 61
# The shorter of the two lags is at most this share of the longer one.
_SHORTER = 0.55


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


class CrowdedStructureFunction(StructureFunction):
    """Turns images of grains that hide and hit each other into mean paths.

    Parameters
    ----------
    settings : SpeedSettings
    diameter_px : float, [px]
        Mean diameter of the grains.
    beads : int
    crowd : CrowdedGrains
    """

    _pairs_kept = 400

    def __init__(
        self, settings: SpeedSettings, diameter_px: float, beads: int, crowd: CrowdedGrains
    ) -> None:
        super().__init__(settings, diameter_px, beads, centred=True, layers=crowd.layers)
        self._saturation = settings.crowded_saturation
        self._unrelated_px = _UNRELATED * diameter_px
        self._persistence = crowd.persistence_px
        self._changes = Quantile(0.5, _MEMORY)
        self._change = 0.0

    def displacement(self, sample: Sample, lag: int) -> tuple[float, float]:
        """Mean path of the grains over a lag, and its error, [px].

        Parameters
        ----------
        sample : Sample
        lag : int
            Index in `sample.windows_ns`.
        """
        self._measure_change(sample, lag)
        plateau = self._response.plateau
        power = sample.powers[lag] - self._change * plateau
        shift = float(sample.shifts_px[lag])
        power_error = _CHANGE_ERROR * plateau
        powers = np.array([power - power_error, power, power + power_error])
        low, displacement, high = self._displacements(powers, shift)
        path = float(self._paths(displacement))
        elastic = float(path_of_displacement(displacement, self._persistence))
        steepness = path / displacement if displacement > 0.0 else 1.0
        error = math.hypot(
            float(
                self._response.displacement_error(
                    powers[1:2], sample.noise_power, self._images[-1][1].size
                )[0]
            ),
            0.5 * (high - low),
            _PICTURE_ERROR * displacement,
        )
        edge = 0.5 * _TURNING * self._diameter_px * float(sample.windows_ns[lag]) / NS
        turning = path - math.sqrt(max(path**2 - edge**2, 0.0))
        return path, math.hypot(
            turning,
            steepness * error,
            _LOSS_ERROR * (elastic - displacement),
            _SWING_ERROR * float(sample.tray_px[lag]),
        )

    def _displacements(
        self, powers: NDArray[np.float64], shift_px: NDArray[np.float64] | float
    ) -> NDArray[np.float64]:
        """Mean displacements, without that of the tray past the grains, [px]."""
        squares = self._response.displacement(powers) ** 2 - 0.25 * np.pi * shift_px**2
        return np.sqrt(np.maximum(squares, 0.0))

    def _paths(self, displacement: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Mean paths of the grains, by their mean displacements, [px]."""
        elastic = path_of_displacement(displacement, self._persistence)
        return np.asarray(displacement + _LOSS * (elastic - displacement))

    def _measure_change(self, sample: Sample, lag: int) -> None:
        """Tell what pictures in motion differ by from motion, which grows with the lag."""
        windows = sample.windows_ns
        shorter = int(np.searchsorted(windows, _SHORTER * windows[lag], side='right')) - 1
        if shorter < 0:
            return
        changes = _CHANGES * self._response.plateau
        speeds = [
            self._paths(
                self._displacements(sample.powers[k] - changes, float(sample.shifts_px[k]))
            )
            / windows[k]
            for k in (shorter, lag)
        ]
        # The larger the part that does not grow, the more the shorter lag slows down.
        agreed = int(np.argmax(speeds[0] <= speeds[1]))
        self._change = max(0.0, self._changes.push(float(_CHANGES[agreed])))

    def _differences(
        self, pairs: list[ImagePair], shifts: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        differences = [
            least_difference(later[1], earlier[1], shift)
            for (later, earlier), shift in zip(pairs, shifts.tolist(), strict=True)
        ]
        powers, left = np.array(differences).reshape(-1, 2).T
        return powers, left

    def _displacement_of(self, path_px: float) -> float:
        return displacement_of_path(path_px, self._persistence)


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
