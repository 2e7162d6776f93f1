"""Factor and offset of the binarised area, from tracks made by hand ([B19] section 3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import FitError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

# Windows that do not overlap: fewer say nothing of the scatter; and for a second unknown.
_FEWEST, _FEWEST_FOR_OFFSET = 5, 8
# Fastest over slowest speed below which factor and offset cannot be told apart.
_LEAST_RANGE = 1.5
# Standard deviation of a Rayleigh distribution over its mean: how beads scatter about their mean.
_RAYLEIGH_SPREAD = math.sqrt(4.0 / math.pi - 1.0)
_ROUNDS = 20
# A factor that is not this many errors above 0 relates nothing to anything.
_SIGNIFICANT = 2.0
_SMALLEST, _LARGEST, _LARGEST_OFFSET = 1e-3, 1e3, 0.1
_MM = 1e3
_REMEDY = 'mark more frames, or choose another reading of the binarised area'


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
        The error is that of the measurement of the beads that were marked.
    beads : int
        Marked and followed there.
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
        0 and NaN where the speeds do not range far enough to tell an offset from a factor.
    pairs : tuple of SpeedPair
        What it rests on.
    reduced_chi_square : float
        Errors are larger by its root where that is more than 1.
    scatter : float
        Standard deviation of calibrated over manual speeds.
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
        """Windows that it rests on."""
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
    """Fit the speeds by the area to those by hand, weighted by the errors of both.

    Parameters
    ----------
    pairs : sequence of SpeedPair
        Of windows that do not overlap.
    beads : int
        In the tray: when fewer were marked, their mean is not that of all.
    where : str
        For errors.

    Raises
    ------
    FitError
        When there are too few windows, or the area does not follow the speed.
    """
    if len(pairs) < _FEWEST:
        raise FitError(
            where, f'the tracks cover {len(pairs)} windows, {_FEWEST} are needed', _REMEDY
        )
    area = np.array([pair.area_speed for pair in pairs])
    manual = np.array([pair.manual_speed for pair in pairs])
    with_offset = len(pairs) >= _FEWEST_FOR_OFFSET and area.max() >= _LEAST_RANGE * area.min()
    design = np.stack((area, np.ones_like(area)), axis=1)[:, : 1 + with_offset]
    found = np.array([float(manual.sum() / max(area.sum(), 1e-12)), 0.0])[: 1 + with_offset]
    inverse = np.eye(found.size)
    for _ in range(_ROUNDS):
        # From what is fitted, not from each noisy speed: a speed read too low would weigh more.
        weights = 1.0 / _variances(pairs, design @ found, float(found[0]), beads)
        inverse = np.linalg.pinv(design.T @ (weights[:, np.newaxis] * design))
        found = inverse @ (design.T @ (weights * manual))
    residuals = manual - design @ found
    chi_square = float(np.sum(weights * residuals**2)) / (len(pairs) - found.size)
    scattered = np.sqrt(np.diag(inverse) * max(chi_square, 1.0))
    errors = np.hypot(scattered, found * float(np.median(_sample_spread(pairs, beads))))
    fit = AreaFit(
        factor=float(found[0]),
        factor_error=float(errors[0]),
        offset=float(found[1]) if with_offset else 0.0,
        offset_error=float(errors[1]) if with_offset else math.nan,
        pairs=tuple(pairs),
        reduced_chi_square=chi_square,
        scatter=float(np.std(design @ found / manual)),
    )
    _check(fit, where)
    return fit


def _variances(
    pairs: Sequence[SpeedPair], expected: NDArray[np.float64], factor: float, beads: int
) -> NDArray[np.float64]:
    """Of the manual speed less the calibrated one, [m^2/s^2]."""
    measured = np.array([pair.manual_speed_error for pair in pairs])
    sample = expected * _sample_spread(pairs, beads)
    by_area = factor * np.array([pair.area_speed_error for pair in pairs])
    return np.asarray(measured**2 + sample**2 + by_area**2 + 1e-18)


def _sample_spread(pairs: Sequence[SpeedPair], beads: int) -> NDArray[np.float64]:
    """How far the mean of the beads that were marked may be off that of all, relatively.

    It is usually the same beads that are marked throughout, so more windows do not make it less.
    """
    marked = np.minimum(np.array([pair.beads for pair in pairs]), beads)
    return np.asarray(_RAYLEIGH_SPREAD * np.sqrt((1.0 - marked / beads) / marked))


def _check(fit: AreaFit, where: str) -> None:
    told = f'factor {fit.factor:.3g} +- {fit.factor_error:.2g}'
    if not fit.factor > _SIGNIFICANT * fit.factor_error:
        raise FitError(
            where,
            f'the binarised area does not follow the speed of the tracks ({told}, '
            f'{fit.windows} windows, {_MM * fit.slowest:.2f} to {_MM * fit.fastest:.2f} mm/s)',
            _REMEDY,
        )
    usable = _SMALLEST <= fit.factor <= _LARGEST and abs(fit.offset) <= _LARGEST_OFFSET
    if not usable:
        raise FitError(
            where,
            f'{told}, offset {_MM * fit.offset:.3g} mm/s cannot be a calibration',
            'see that --first-frame, scale and tray are right',
        )
