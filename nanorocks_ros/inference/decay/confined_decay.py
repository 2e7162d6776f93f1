"""Restitution from a measured decay by the confined theory, in and before the steady state.

`confined_restitution` assumes the steady state, within the tested range of the theory, see
`confined_theory`. `windowed_restitution` starts from the velocities after shaking and fits Haff's
law in the same window as the data, which is better for nearly elastic walls.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import optimize

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.physics.confined_theory import ConfinedGas, confined_gas
from nanorocks_ros.physics.error_propagation import Estimate, propagated
from nanorocks_ros.physics.kinetic_theory import check_positive

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

LOWEST_RESTITUTION = 0.7
LOWEST_WALL_RESTITUTION = 0.9
# A gas that loses its speed over less than a quarter of the tray does not stay homogeneous:
# simulated trays 6 and 8 at 0.8 form clusters, and decay half as fast as a homogeneous gas.
MOST_DECAY = 4.0
# Number of times in the window of the fit.
_TIMES = 33
_LOWEST_TRIED = 0.3
_PRECISION = 1e-5


def confined_restitution(
    tray: Tray,
    decay_rate: Estimate | float,
    wall_restitution: Estimate | float,
    height: Estimate | float | None = None,
) -> Estimate:
    """Restitution between the beads of a tray, from the decay of their mean projected speed.

    Errors are propagated to first order. The error of the theory itself, 0.01 to 0.03, is not
    included.

    Parameters
    ----------
    tray : Tray
    decay_rate : Estimate or float, [1/m], > 0
        1 / (v0 tau), v0 being the mean projected speed.
    wall_restitution : Estimate or float, [0.9, 1]
    height : Estimate or float, optional, [m]
        Of the tray, with its error.

    Raises
    ------
    ConfigurationError
        When a value cannot be used.
    FitError
        When no restitution in the range of the theory, 0.7 to 1, makes this decay, or it is so
        fast (beyond 4 over the longest side) that the gas cannot stay homogeneous.
    """

    def relation(decay_rate: float, wall_restitution: float, height: float) -> float:
        dimensions = (*tray.dimensions[:2], height)
        gas = confined_gas(replace(tray, dimensions=dimensions))
        return gas.restitution(decay_rate, wall_restitution)

    walls = wall_restitution.value if isinstance(wall_restitution, Estimate) else wall_restitution
    if walls < LOWEST_WALL_RESTITUTION:
        raise FitError(
            'confined theory',
            f'a restitution of the walls of {walls:g} is outside its range',
            f'use the decay library below {LOWEST_WALL_RESTITUTION}',
        )
    estimate = propagated(
        relation,
        decay_rate=decay_rate,
        wall_restitution=wall_restitution,
        height=tray.dimensions[2] if height is None else height,
    )
    rate = decay_rate.value if isinstance(decay_rate, Estimate) else decay_rate
    if rate * max(tray.dimensions) > MOST_DECAY:
        raise FitError(
            'confined theory',
            f'at {rate:.3g} /m tray {tray.number} forms clusters, and the theory is too high',
            f'use the decay library above {MOST_DECAY / max(tray.dimensions):.3g} /m',
        )
    if estimate.value < LOWEST_RESTITUTION:
        raise FitError(
            'confined theory',
            f'a restitution of {estimate.value:.2f} is outside its range',
            f'use the decay library below {LOWEST_RESTITUTION}',
        )
    return estimate


def windowed_decay_rate(
    gas: ConfinedGas,
    restitution: float,
    wall_restitution: float,
    *,
    initial_speed: float,
    window: tuple[float, float],
    vertical: float = 1.0,
) -> float:
    """1 / (v0 tau) [1/m] of Haff's law, fitted to ln v of a gas that was just shaken.

    All beads start with the same mean square velocity, as walls give it.

    Parameters
    ----------
    gas : ConfinedGas
    restitution, wall_restitution : float, [0, 1]
    initial_speed : float, [m/s], > 0
        Mean projected speed at the shaking event.
    window : tuple of 2 floats, [s]
        First and last time fitted, since the shaking event.
    vertical : float, > 0
        Energy along z over that along x, or y, at the shaking event.

    Raises
    ------
    ConfigurationError
        When a value cannot be used.
    """
    check_positive(initial_speed=initial_speed, vertical=vertical)
    if not 0.0 <= window[0] < window[1] < math.inf:
        raise ConfigurationError(
            'window', f'{window[0]:g} to {window[1]:g} s', 'give two times, rising, none below 0'
        )
    one_way = 2.0 / math.pi * initial_speed**2
    start = np.tile([one_way, one_way, vertical * one_way], (gas.beads.counts.size, 1))
    times = np.linspace(*window, _TIMES)
    log_speed = np.log(gas.speeds(times, restitution, wall_restitution, start))

    def residual(logs: NDArray[np.float64]) -> NDArray[np.float64]:
        difference: NDArray[np.float64] = (
            log_speed - logs[0] + np.log1p(math.exp(logs[0] + logs[1]) * times)
        )
        return difference

    return math.exp(optimize.least_squares(residual, (log_speed[0], math.log(50.0))).x[1])


def windowed_restitution(
    gas: ConfinedGas,
    decay_rate: float,
    wall_restitution: float,
    *,
    initial_speed: float,
    window: tuple[float, float],
    vertical: float = 1.0,
) -> float:
    """Restitution between beads that goes with a decay rate fitted over a window.

    Against simulation within 0.01 from 0.8 up and 0.03 at 0.7, with walls from 0.9 up.

    Parameters
    ----------
    gas : ConfinedGas
    decay_rate : float, [1/m], > 0
    wall_restitution, initial_speed, window, vertical
        As for `windowed_decay_rate`.

    Raises
    ------
    ConfigurationError
        When a value cannot be used.
    FitError
        When no restitution above 0.3 makes this decay.
    """
    check_positive(decay_rate=decay_rate)

    def excess(restitution: float) -> float:
        rate = windowed_decay_rate(
            gas,
            restitution,
            wall_restitution,
            initial_speed=initial_speed,
            window=window,
            vertical=vertical,
        )
        return rate - decay_rate

    if not excess(1.0) <= 0.0 <= excess(_LOWEST_TRIED):
        raise FitError(
            'confined theory',
            f'no restitution from {_LOWEST_TRIED:g} to 1 makes a decay of {decay_rate:.3g} /m '
            f'with walls of {wall_restitution:g}',
            'check v0, tau, the tray and its walls',
        )
    return float(optimize.brentq(excess, _LOWEST_TRIED, 1.0, xtol=_PRECISION))
