"""Factor and offset of the binarised area, from manual tracks ([B19] section 3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import FitError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

# Least number of windows for a factor, and for a factor and an offset.
_MIN_WINDOWS, _MIN_WINDOWS_FOR_OFFSET = 5, 8
# Least ratio of fastest to slowest speed that separates factor and offset.
_MIN_SPEED_RATIO = 1.5
# Standard deviation of a Rayleigh distribution over its mean: the scatter of bead speeds.
_RAYLEIGH_SPREAD = math.sqrt(4.0 / math.pi - 1.0)
_ITERATIONS = 20
# Least ratio of the factor to its error.
_SIGNIFICANT = 2.0
_MIN_FACTOR, _MAX_FACTOR, _MAX_OFFSET = 1e-3, 1e3, 0.1
_MM = 1e3
_REMEDY = 'mark more frames, or change the settings of the binarised area'


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedPair:
    """The speed in one window, by the binarised area and by hand.

    Parameters
    ----------
    stamp_ns : int
        Middle of the window of the area.
    area_speed, area_speed_error : float, [m/s]
        With a factor of 1 and no offset.
    manual_speed, manual_speed_error : float, [m/s]
        The error is that of the measured mean of the marked beads.
    beads : int
        Number of beads with a manual speed.
    """

    stamp_ns: int
    area_speed: float
    area_speed_error: float
    manual_speed: float
    manual_speed_error: float
    beads: int


@dataclass(frozen=True, slots=True, kw_only=True)
class AreaFit:
    """speed = factor x speed by the area + offset.

    Parameters
    ----------
    factor, factor_error : float
    offset, offset_error : float, [m/s]
        0 and NaN where the range of speeds does not separate offset and factor.
    pairs : tuple of SpeedPair
        Speeds that were fitted.
    reduced_chi_square : float
        Errors include a factor of its square root where that is above 1.
    scatter : float
        Standard deviation of the ratio of calibrated to manual speeds.
    """

    factor: float
    factor_error: float
    offset: float
    offset_error: float
    pairs: tuple[SpeedPair, ...]
    reduced_chi_square: float
    scatter: float

    @property
    def windows(self) -> int:
        """Number of fitted windows."""
        return len(self.pairs)

    @property
    def slowest(self) -> float:
        """Slowest manual speed, [m/s]."""
        return min(pair.manual_speed for pair in self.pairs)

    @property
    def fastest(self) -> float:
        """Fastest manual speed, [m/s]."""
        return max(pair.manual_speed for pair in self.pairs)


def fit_area(pairs: Sequence[SpeedPair], beads: int, where: str) -> AreaFit:
    """Fit manual speeds by those of the area, weighted with the errors of both.

    Parameters
    ----------
    pairs : sequence of SpeedPair
        From windows that do not overlap.
    beads : int
        Number of beads in the tray; the mean of fewer marked beads has a sampling error.
    where : str
        Name of the tray, for messages.

    Raises
    ------
    FitError
        When there are too few windows, or the area does not follow the speed.
    """
    if len(pairs) < _MIN_WINDOWS:
        raise FitError(
            where, f'the tracks cover {len(pairs)} windows, {_MIN_WINDOWS} are needed', _REMEDY
        )
    area = np.array([pair.area_speed for pair in pairs])
    manual = np.array([pair.manual_speed for pair in pairs])
    with_offset = (
        len(pairs) >= _MIN_WINDOWS_FOR_OFFSET and area.max() >= _MIN_SPEED_RATIO * area.min()
    )
    design = np.stack((area, np.ones_like(area)), axis=1)[:, : 1 + with_offset]
    parameters = np.array([float(manual.sum() / max(area.sum(), 1e-12)), 0.0])[: 1 + with_offset]
    inverse = np.eye(parameters.size)
    for _ in range(_ITERATIONS):
        # Errors from the fitted speeds: with those of noisy speeds low ones would weigh more.
        weights = 1.0 / _variances(pairs, design @ parameters, float(parameters[0]), beads)
        inverse = np.linalg.pinv(design.T @ (weights[:, np.newaxis] * design))
        parameters = inverse @ (design.T @ (weights * manual))
    residuals = manual - design @ parameters
    chi_square = float(np.sum(weights * residuals**2)) / (len(pairs) - parameters.size)
    scattered = np.sqrt(np.diag(inverse) * max(chi_square, 1.0))
    errors = np.hypot(scattered, parameters * float(np.median(_sample_spread(pairs, beads))))
    fit = AreaFit(
        factor=float(parameters[0]),
        factor_error=float(errors[0]),
        offset=float(parameters[1]) if with_offset else 0.0,
        offset_error=float(errors[1]) if with_offset else math.nan,
        pairs=tuple(pairs),
        reduced_chi_square=chi_square,
        scatter=float(np.std(design @ parameters / manual)),
    )
    _check(fit, where)
    return fit


def _variances(
    pairs: Sequence[SpeedPair], expected: NDArray[np.float64], factor: float, beads: int
) -> NDArray[np.float64]:
    """Variances of manual minus calibrated speeds, (n_pairs,), [m^2/s^2]."""
    measured = np.array([pair.manual_speed_error for pair in pairs])
    sample = expected * _sample_spread(pairs, beads)
    by_area = factor * np.array([pair.area_speed_error for pair in pairs])
    return np.asarray(measured**2 + sample**2 + by_area**2 + 1e-18)


def _sample_spread(pairs: Sequence[SpeedPair], beads: int) -> NDArray[np.float64]:
    """Relative sampling error of the mean over the marked beads, (n_pairs,).

    It does not decrease with more windows, since usually the same beads are marked in all.
    """
    marked = np.minimum(np.array([pair.beads for pair in pairs]), beads)
    return np.asarray(_RAYLEIGH_SPREAD * np.sqrt((1.0 - marked / beads) / marked))


def _check(fit: AreaFit, where: str) -> None:
    description = f'factor {fit.factor:.3g} +- {fit.factor_error:.2g}'
    if not fit.factor > _SIGNIFICANT * fit.factor_error:
        raise FitError(
            where,
            f'the binarised area does not follow the speed of the tracks ({description}, '
            f'{fit.windows} windows, {_MM * fit.slowest:.2f} to {_MM * fit.fastest:.2f} mm/s)',
            _REMEDY,
        )
    usable = _MIN_FACTOR <= fit.factor <= _MAX_FACTOR and abs(fit.offset) <= _MAX_OFFSET
    if not usable:
        raise FitError(
            where,
            f'{description}, offset {_MM * fit.offset:.3g} mm/s cannot be a calibration',
            'see that --first-frame, scale and tray are right',
        )
