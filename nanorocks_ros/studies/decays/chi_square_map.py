"""How far each point of a sweep is from a decay."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.studies.decays.decay_curve import SpeedCurve
    from nanorocks_ros.studies.sweeps.sweep_result import Sweep

# Correlations from fewer deviations than this for each time are noise themselves.
_DEVIATIONS = 3
# Of each time for itself, in the correlations: what keeps them from being singular.
_OWN = 0.01
# The initial speed of a decay may differ from that of the sweep by this factor.
_MOST_SCALED = 1.5
_SCALES = 61


def chi_square(sweep: Sweep, curve: SpeedCurve, *, scaled: bool = False) -> NDArray[np.float64]:
    """Mean squared deviation from a curve, in units of the squared standard errors of both.

    The mean runs over the times of the sweep that the curve covers; in between it is
    interpolated. Near 1 a point cannot be told from the curve. Where the sweep kept its runs,
    deviations at different times are taken together with their covariance (generalised chi
    square over the number of times): a gas that is slow stays slow. Otherwise they are taken for
    independent, and the map is one for the eye.

    Parameters
    ----------
    sweep : Sweep
    curve : SpeedCurve
    scaled : bool, optional
        Whether the initial speed is free. A gas of hard beads that starts a times faster does
        the same a times faster, v(t) = a f(a t), so that one sweep serves for all initial speeds
        that differ from its own by a factor of up to 1.5; the best is taken at each point.

    Returns
    -------
    ndarray (*grid,)
        0 at the point of the grid that the curve was taken from.

    Raises
    ------
    ConfigurationError
        When the curve covers fewer than two times of the sweep, or no error is known, or speeds
        cannot be scaled since beads stick below one of them.

    References
    ----------
    Compare [B19] fig. 12, whose deviations are not divided by errors.
    """
    if scaled and _sticky(sweep):
        raise ConfigurationError(
            '--free-speed', 'beads stick below a speed', 'sweep with the initial speed measured'
        )
    most = _MOST_SCALED if scaled else 1.0
    times = sweep.times
    covered = (times >= curve.times[0]) & (times <= min(curve.times[-1], times[-1] / most))
    if covered.sum() < 2:
        raise ConfigurationError(
            '--reference',
            f'covers {covered.sum()} of the times of the sweep',
            'choose --times between its ends',
        )
    measured = np.interp(times[covered], curve.times, curve.speed)
    error = np.interp(times[covered], curve.times, curve.error)
    weigh = _Weights(sweep, curve, covered, error)
    if not scaled:
        found: NDArray[np.float64] = weigh(sweep.mean_projected_speed[..., covered] - measured)
        return found
    scales = np.geomspace(1.0 / most, most, _SCALES)
    every = [weigh(_scaled(sweep, times[covered], scale) - measured) for scale in scales]
    if int(np.argmin(np.min(np.reshape(every, (_SCALES, -1)), axis=1))) in (0, _SCALES - 1):
        raise ConfigurationError(
            '--reference',
            f'starts more than {most:g} times faster or slower than the sweep',
            'sweep with --mean-speed near its own',
        )
    least: NDArray[np.float64] = np.min(every, axis=0)
    return least


def _sticky(sweep: Sweep) -> bool:
    settings = json.loads(sweep.question)['settings']
    names = ('sticking_speed', 'wall_sticking_speed')
    return any(settings[name] > 0.0 for name in names) or any(
        axis.name in names for axis in sweep.axes
    )


def _scaled(sweep: Sweep, times: NDArray[np.float64], scale: float) -> NDArray[np.float64]:
    """The curves of a gas that starts so many times faster, (*grid, n_times)."""
    place = np.interp(scale * times, sweep.times, np.arange(sweep.times.size))
    low = np.minimum(place.astype(np.intp), sweep.times.size - 2)
    part = place - low
    # 1/v is what is nearly straight.
    slowness = 1.0 / sweep.mean_projected_speed
    between = (1.0 - part) * slowness[..., low] + part * slowness[..., low + 1]
    found: NDArray[np.float64] = scale / between
    return found


class _Weights:
    """Deviations to mean squares."""

    def __init__(
        self,
        sweep: Sweep,
        curve: SpeedCurve,
        covered: NDArray[np.bool_],
        error: NDArray[np.float64],
    ) -> None:
        own = np.nan_to_num(sweep.mean_projected_speed_error[..., covered])
        # Of a measured decay only the errors of the measurement are known: the gas scatters from
        # cycle to cycle as it does from run to run.
        gas = 1.0 + (sweep.runs / curve.cycles if curve.cycles else 0.0)
        variance = own**2 * gas + error**2
        if not (variance > 0.0).all():
            raise ConfigurationError(
                '--reference', 'no errors are known', 'sweep with two or more --runs'
            )
        self._variance = variance
        self._inverse: NDArray[np.float64] | None = None
        correlation = run_correlation(sweep, covered)
        if correlation is None:
            return
        spread = own * np.sqrt(gas if curve.point is None else 2.0)
        covariance = correlation * spread[..., np.newaxis] * spread[..., np.newaxis, :]
        if curve.point is None:
            covariance = covariance + np.diag(error**2)
        self._inverse = np.linalg.inv(covariance)

    def __call__(self, deviation: NDArray[np.float64]) -> NDArray[np.float64]:
        found: NDArray[np.float64]
        if self._inverse is None:
            found = np.mean(deviation**2 / self._variance, axis=-1)
        else:
            squares = np.einsum('...i,...ij,...j->...', deviation, self._inverse, deviation)
            found = squares / deviation.shape[-1]
        return found


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
        None where single runs were not kept, or are too few.
    """
    runs = sweep.run_mean_projected_speed
    count = int(covered.sum())
    if runs is None or (sweep.runs - 1) * runs[..., 0, 0].size < _DEVIATIONS * count:
        return None
    off = runs[..., covered] - sweep.mean_projected_speed[..., np.newaxis, covered]
    scale = sweep.mean_projected_speed_error[..., np.newaxis, covered]
    rows = (off / scale).reshape(-1, count)
    covariance = rows.T @ rows
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    found: NDArray[np.float64] = (1.0 - _OWN) * correlation + _OWN * np.eye(count)
    return found
