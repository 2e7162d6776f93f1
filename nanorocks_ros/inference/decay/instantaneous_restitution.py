"""Restitution against speed along one decay, with the bands expected from noise alone.

The decay rate at an instant is the slope of 1/v over time. The paper takes the logarithm of the
ratio of two speeds instead, whose noise grows as beads become slow: the bands show its spread for
one restitution at all speeds and beads without rotation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.inference.decay.haff_fit import (
    QUICK_RANGE,
    USUAL_TIMES_BEADS,
    HaffFit,
    fit_haff,
)
from nanorocks_ros.physics.haff_law import haff_speed
from nanorocks_ros.physics.paper_formulas import (
    RELATIVE_TO_MEAN_SPEED,
    paper_instantaneous_restitution,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.physics.confined_theory import ConfinedGas

DRAWS = 1000
# Ends of the 95 % and 68 % bands.
QUANTILES = (0.025, 0.16, 0.84, 0.975)
# Lowest restitution of the closed form in a figure.
_LOWEST = 0.5
_STEPS = 51


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalCor:
    """Restitution in windows of one decay, by a closed form.

    Parameters
    ----------
    speed : ndarray (n,), [m/s]
        Mean projected speed in the middle of each window.
    decay_rate, decay_rate_error : ndarray (n,), [1/m]
        Slope of 1/v, and one standard error.
    restitution : ndarray (n,)
        NaN where no value from 0.5 to 1 gives this decay.
    lower, upper : ndarray (n,)
        For a decay rate one error higher and lower; 0 and 1 where the form has none.
    """

    speed: NDArray[np.float64]
    decay_rate: NDArray[np.float64]
    decay_rate_error: NDArray[np.float64]
    restitution: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class InstantaneousCor:
    """Figure 13 of the paper, with the bands of noise and fluctuations.

    Parameters
    ----------
    collision_speed, fitted_collision_speed : ndarray (n,), [m/s]
        As the paper has it, twice the mean speed: measured, and by the fit.
    paper : ndarray (n,)
        The paper's estimate from speeds an interval apart; NaN where a speed is not positive.
    noise, noise_and_gas : ndarray (4, n)
        Quantiles 2.5, 16, 84 and 97.5 % of the same estimate where one decay rate holds at all
        speeds: with the errors of the speeds alone, and with the fluctuations of a gas of so
        few beads in addition.
    local : LocalCor
    whole : float
        Restitution that the closed form of `local` reads from the whole decay; NaN: none.
    fit : HaffFit
        Of the whole decay.
    """

    collision_speed: NDArray[np.float64]
    fitted_collision_speed: NDArray[np.float64]
    paper: NDArray[np.float64]
    noise: NDArray[np.float64]
    noise_and_gas: NDArray[np.float64]
    local: LocalCor
    whole: float
    fit: HaffFit


def gas_covariance(
    times: NDArray[np.float64], haff_time: float, beads: int
) -> NDArray[np.float64]:
    """Covariance of ln v of a cooling gas of some beads, (n, n); derived in `haff_fit`.

    Parameters
    ----------
    times : ndarray (n,), [s]
        Since the start of the cooling.
    haff_time : float, [s]
    beads : int
        Number in all runs of the mean.
    """
    strength, quick = USUAL_TIMES_BEADS / beads
    s = np.log1p(times / haff_time)
    gap = np.abs(s[:, np.newaxis] - s)
    slow = np.exp(-gap) - np.exp(-s[:, np.newaxis] - s)
    covariance: NDArray[np.float64] = 0.5 * strength * slow + quick * np.exp(-gap / QUICK_RANGE)
    return covariance


def local_slopes(
    times: NDArray[np.float64],
    speeds: NDArray[np.float64],
    law: NDArray[np.float64],
    windows: NDArray[np.intp],
) -> NDArray[np.float64]:
    """Slope of 1/v over time in each window, (..., n_windows), [1/m].

    1/v of a slow, noisy speed has no mean; so it is expanded to first order about the fitted
    decay, 1/v = 1/u - (v - u)/u^2. Points have the weight u^2, that of equal relative errors.

    Parameters
    ----------
    times : ndarray (n,), [s]
    speeds : ndarray (..., n), [m/s]
    law : ndarray (n,), [m/s]
        The fitted decay u.
    windows : ndarray of int, (n,)
        Number of the window of each point, rising from 0; three points or more in each.
    """
    slowness = (2.0 - speeds / law) / law
    slopes = []
    for number in range(int(windows[-1]) + 1):
        inside = windows == number
        weights = law[inside] ** 2 / (law[inside] ** 2).sum()
        centred = times[inside] - weights @ times[inside]
        slopes.append(slowness[..., inside] @ (weights * centred) / (weights @ centred**2))
    return np.stack(slopes, axis=-1)


def instantaneous_cor(
    curve: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    tray: Tray,
    gas: ConfinedGas,
    *,
    wall_restitution: float,
    cycles: int = 1,
    interval: float = 1.0,
    windows: int = 8,
    seed: int = 1,
) -> InstantaneousCor:
    """Restitution against speed, as the paper has it and by the local slope of 1/v.

    Parameters
    ----------
    curve : tuple of 3 ndarrays (n,), [s], [m/s], [m/s]
        Times since the shaking event, even and rising; mean projected speeds; their errors.
    tray : Tray
    gas : ConfinedGas
        Of this tray.
    wall_restitution : float, [0, 1]
        Taken for known.
    cycles : int
        That the speeds are a mean over.
    interval : float, [s]
        Between the two speeds of the paper's estimate; it says about 30 frames.
    windows : int
        For the local slopes.
    seed : int
        Of the bands and errors, which are drawn.

    Raises
    ------
    ConfigurationError
        When the interval is longer than half the decay, or the windows hold fewer than three
        speeds.
    FitError
        When the speeds do not fall, or are fewer than 4.
    """
    times, speed, error = curve
    fit = fit_haff(times, speed, error, tray.count * cycles)
    lag = round(interval / float(np.median(np.diff(times))))
    if not 1 <= lag <= times.size // 2:
        raise ConfigurationError(
            'interval', f'{interval:g} s', f'give 1 to {times.size // 2} steps between speeds'
        )
    drawn = _drawn(fit, curve, tray.count * cycles, seed)
    size = float(times[lag:].mean() - times[:-lag].mean())

    def estimate(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return paper_instantaneous_restitution(
            values[..., :-lag], values[..., lag:], size, tray.diameter, tray.number_density
        )

    place = _windows(fit, times, windows)
    law = haff_speed(times, fit.initial_speed, fit.haff_time)
    errors = local_slopes(times, drawn[1], law, place).std(axis=0)
    rates = local_slopes(times, speed, law, place)
    middle = [float(np.exp(np.log(law[place == k]).mean())) for k in range(windows)]
    table = _table(gas, wall_restitution)
    return InstantaneousCor(
        collision_speed=RELATIVE_TO_MEAN_SPEED * speed[:-lag],
        fitted_collision_speed=RELATIVE_TO_MEAN_SPEED * law[:-lag],
        paper=estimate(speed),
        noise=np.nanquantile(estimate(drawn[0]), QUANTILES, axis=0),
        noise_and_gas=np.nanquantile(estimate(drawn[1]), QUANTILES, axis=0),
        local=LocalCor(
            speed=np.array(middle),
            decay_rate=rates,
            decay_rate_error=errors,
            restitution=np.interp(rates, *table, left=np.nan, right=np.nan),
            lower=np.interp(rates + errors, *table, left=1.0, right=0.0),
            upper=np.interp(rates - errors, *table, left=1.0, right=0.0),
        ),
        whole=float(np.interp(fit.decay_rate, *table, left=np.nan, right=np.nan)),
        fit=fit,
    )


def _drawn(
    fit: HaffFit,
    curve: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    beads: int,
    seed: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Random decays with one rate at all speeds: with errors; with fluctuations and errors."""
    times, _, error = curve
    law = haff_speed(times, fit.initial_speed, fit.haff_time)
    random = np.random.default_rng(seed)
    noise = error * random.normal(size=(DRAWS, times.size))
    values, vectors = np.linalg.eigh(gas_covariance(times, fit.haff_time, beads))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    wander = random.normal(size=(DRAWS, times.size)) @ root.T
    return law + noise, law * np.exp(wander) + noise


def _windows(fit: HaffFit, times: NDArray[np.float64], windows: int) -> NDArray[np.intp]:
    """Number of the window of each time, the windows even in ln v."""
    s = np.log1p(times / fit.haff_time)
    share = (s - s[0]) / (s[-1] - s[0])
    place: NDArray[np.intp] = np.minimum((share * windows).astype(np.intp), windows - 1)
    fewest = np.bincount(place, minlength=windows).min()
    if fewest < 3:
        raise ConfigurationError(
            'windows', f'one of {windows} holds {fewest} speeds', 'give fewer, for three in each'
        )
    return place


def _table(gas: ConfinedGas, walls: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rising decay rates [1/m] and their restitutions."""
    grid = np.linspace(1.0, _LOWEST, _STEPS)
    rates: list[float] = []
    for restitution in grid:
        try:
            rate = gas.decay_rate(float(restitution), walls)
        except FitError:
            break
        if rates and rate <= rates[-1]:
            # With elastic walls a lower restitution may not cool faster.
            break
        rates.append(rate)
    return np.array(rates), grid[: len(rates)]
