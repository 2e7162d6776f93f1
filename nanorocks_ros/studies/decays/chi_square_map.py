"""Chi square between a decay and each point of a sweep."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.studies.decays.decay_curve import SpeedCurve
    from nanorocks_ros.studies.sweeps.sweep_result import Sweep

# Least number of deviations for each time from which correlations are estimated.
_MIN_DEVIATIONS_PER_TIME = 3
# Weight of the identity in the correlation matrix, which keeps it from being singular.
_DIAGONAL_WEIGHT = 0.01
# Largest ratio between the initial speeds of a decay and of the sweep.
_MAX_SCALE = 1.5
_SCALES = 61


def chi_square(sweep: Sweep, curve: SpeedCurve, *, scaled: bool = False) -> NDArray[np.float64]:
    """Mean squared deviation from a curve, in units of the squared standard errors of both.

    The mean is over the times of the sweep that the curve covers; the curve is interpolated. A
    point with a value near 1 agrees with the curve. Where the sweep kept its runs, the covariance
    between times is included (generalised chi square over the number of times), since a slow run
    stays slow. Otherwise times count as independent, and the map is only a guide to the eye.

    Parameters
    ----------
    sweep : Sweep
    curve : SpeedCurve
    scaled : bool, optional
        Whether the initial speed is free. The decay of hard spheres scales with it,
        v(t) = a f(a t), so that one sweep serves for all initial speeds within a factor of 1.5
        of its own; the best factor is taken at each point.

    Returns
    -------
    ndarray (*grid,)
        0 at the point of the grid that the curve was taken from.

    Raises
    ------
    ConfigurationError
        When the curve covers fewer than two times of the sweep, no error is known, or speeds
        cannot be scaled because beads stick below one of them.

    References
    ----------
    Compare [B19] fig. 12, whose deviations are not divided by errors.
    """
    if scaled and _sticky(sweep):
        raise ConfigurationError(
            '--free-speed', 'beads stick below a speed', 'sweep with the initial speed measured'
        )
    max_scale = _MAX_SCALE if scaled else 1.0
    times = sweep.times
    covered = (times >= curve.times[0]) & (times <= min(curve.times[-1], times[-1] / max_scale))
    if covered.sum() < 2:
        raise ConfigurationError(
            '--reference',
            f'covers {covered.sum()} of the times of the sweep',
            'choose --times between its ends',
        )
    measured = np.interp(times[covered], curve.times, curve.speed)
    error = np.interp(times[covered], curve.times, curve.error)
    mean_square = _ChiSquare(sweep, curve, covered, error)
    if not scaled:
        unscaled: NDArray[np.float64] = mean_square(
            sweep.mean_projected_speed[..., covered] - measured
        )
        return unscaled
    scales = np.geomspace(1.0 / max_scale, max_scale, _SCALES)
    maps = [mean_square(_scaled(sweep, times[covered], scale) - measured) for scale in scales]
    if int(np.argmin(np.min(np.reshape(maps, (_SCALES, -1)), axis=1))) in (0, _SCALES - 1):
        raise ConfigurationError(
            '--reference',
            f'starts more than {max_scale:g} times faster or slower than the sweep',
            'sweep with --mean-speed near its own',
        )
    best: NDArray[np.float64] = np.min(maps, axis=0)
    return best


def _sticky(sweep: Sweep) -> bool:
    settings = json.loads(sweep.specification)['settings']
    names = ('sticking_speed', 'wall_sticking_speed')
    return any(settings[name] > 0.0 for name in names) or any(
        axis.name in names for axis in sweep.axes
    )


def _scaled(sweep: Sweep, times: NDArray[np.float64], scale: float) -> NDArray[np.float64]:
    """The curves of a gas that starts `scale` times faster, (*grid, n_times)."""
    position = np.interp(scale * times, sweep.times, np.arange(sweep.times.size))
    low = np.minimum(position.astype(np.intp), sweep.times.size - 2)
    weight = position - low
    # Interpolated in 1/v, which is nearly linear in time.
    slowness = 1.0 / sweep.mean_projected_speed
    interpolated = (1.0 - weight) * slowness[..., low] + weight * slowness[..., low + 1]
    scaled: NDArray[np.float64] = scale / interpolated
    return scaled


class _ChiSquare:
    """Chi square over the number of times, from deviations."""

    def __init__(
        self,
        sweep: Sweep,
        curve: SpeedCurve,
        covered: NDArray[np.bool_],
        error: NDArray[np.float64],
    ) -> None:
        sweep_error = np.nan_to_num(sweep.mean_projected_speed_error[..., covered])
        # The error of a measured decay is that of the measurement alone; its cycles scatter as the
        # runs of the sweep do.
        run_scatter = 1.0 + (sweep.runs / curve.cycles if curve.cycles else 0.0)
        variance = sweep_error**2 * run_scatter + error**2
        if not (variance > 0.0).all():
            raise ConfigurationError(
                '--reference', 'no errors are known', 'sweep with two or more --runs'
            )
        self._variance = variance
        self._inverse: NDArray[np.float64] | None = None
        correlation = run_correlation(sweep, covered)
        if correlation is None:
            return
        spread = sweep_error * np.sqrt(run_scatter if curve.point is None else 2.0)
        covariance = correlation * spread[..., np.newaxis] * spread[..., np.newaxis, :]
        if curve.point is None:
            covariance = covariance + np.diag(error**2)
        self._inverse = np.linalg.inv(covariance)

    def __call__(self, deviation: NDArray[np.float64]) -> NDArray[np.float64]:
        mean_squares: NDArray[np.float64]
        if self._inverse is None:
            mean_squares = np.mean(deviation**2 / self._variance, axis=-1)
        else:
            squares = np.einsum('...i,...ij,...j->...', deviation, self._inverse, deviation)
            mean_squares = squares / deviation.shape[-1]
        return mean_squares


def run_correlation(sweep: Sweep, covered: NDArray[np.bool_]) -> NDArray[np.float64] | None:
    """Correlation of the speeds of a run at different times, over all points of a sweep.

    Parameters
    ----------
    sweep : Sweep
    covered : ndarray of bool, (n_times,)
        Times to take.

    Returns
    -------
    ndarray (n_covered, n_covered) or None
        None when the runs were not kept, or are too few.
    """
    runs = sweep.run_mean_projected_speed
    count = int(covered.sum())
    if runs is None or (sweep.runs - 1) * runs[..., 0, 0].size < _MIN_DEVIATIONS_PER_TIME * count:
        return None
    deviations = runs[..., covered] - sweep.mean_projected_speed[..., np.newaxis, covered]
    scale = sweep.mean_projected_speed_error[..., np.newaxis, covered]
    rows = (deviations / scale).reshape(-1, count)
    covariance = rows.T @ rows
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    regularised: NDArray[np.float64] = (
        1.0 - _DIAGONAL_WEIGHT
    ) * correlation + _DIAGONAL_WEIGHT * np.eye(count)
    return regularised
