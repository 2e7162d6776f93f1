"""Figures of measured decays after the paper's figures 7 and 13."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from scipy import optimize

from nanorocks_ros.errors import FitError, RecordingError
from nanorocks_ros.physics.confined import confined_gas, confined_restitution
from nanorocks_ros.physics.estimate import Estimate
from nanorocks_ros.physics.haff import granular_energy, haff_speed
from nanorocks_ros.physics.haff_fit import HaffFit, fit_haff
from nanorocks_ros.physics.instantaneous import instantaneous_cor
from nanorocks_ros.physics.paper import RELATIVE_TO_MEAN_SPEED, paper_restitution
from nanorocks_ros.study.cycles import mean_cycle
from nanorocks_ros.study.output_files import whole_file

mpl.use('Agg')
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.physics.instantaneous import InstantaneousCor
    from nanorocks_ros.study.curves import SpeedCurve
    from nanorocks_ros.study.cycles import CycleSpeeds

_MM, _NANOJOULE = 1e3, 1e9
_MEASURED, _FIT, _PAPER, _BAND = '#30506f', '#c23b22', '#e8b93c', '#e0a458'


def check_errors(curve: SpeedCurve) -> None:
    """Refuse speeds whose errors are not known.

    Raises
    ------
    RecordingError
    """
    if not (curve.error > 0.0).all():
        raise RecordingError(
            'mean_projected_speed_error',
            'is not known for every speed',
            'name the results of `nanorocks analyse`',
        )


def decay_figure(
    path: Path,
    tray: Tray,
    cycles: Sequence[CycleSpeeds],
    *,
    wall_restitution: float,
    span: tuple[float, float],
) -> dict[str, float | None]:
    """The energy of each cycle and of their mean, with our fit and the paper's.

    Parameters
    ----------
    path : Path
    tray : Tray
    cycles : sequence of CycleSpeeds
    wall_restitution : float, [0, 1]
        For the confined theory.
    span : tuple of 2 floats, [s]
        First and last time since the shaking event that is fitted.

    Returns
    -------
    dict
        What was fitted, in SI; None where a relation has no value.

    Raises
    ------
    FitError
        When the mean speed does not fall.
    RecordingError
        When the cycles have too few times in common, or errors are not known.

    References
    ----------
    [B19] fig. 7.
    """
    curve = mean_cycle(cycles, *span)
    check_errors(curve)
    fit = fit_haff(curve.times, curve.speed, curve.error, tray.count * len(cycles))
    energy, time = _paper_fit(curve, tray.mean_mass)
    found = _values(tray, fit, (energy, time), wall_restitution)
    figure = Figure(figsize=(8.0, 5.5), layout='constrained')
    axes = figure.subplots()
    _draw_energy(axes, tray, cycles, curve)
    scale = _relative_energy(1.0, tray.mean_mass) * _NANOJOULE
    law = haff_speed(curve.times, fit.initial_speed, fit.haff_time)
    label = f"Haff's law, speeds weighted: {_cor_text('confined theory', found, 'confined')}"
    axes.plot(curve.times, scale * law**2, color=_FIT, lw=2, zorder=3, label=label)
    axes.plot(
        curve.times,
        _NANOJOULE * energy / (1.0 + curve.times / time) ** 2,
        color=_PAPER,
        lw=2,
        ls='--',
        zorder=4,
        label=f'as the paper fits, energies alike: {_cor_text("its COR", found, "paper")}',
    )
    axes.set_title(
        f'Tray {tray.number}, {len(cycles)} cycle{"s" if len(cycles) > 1 else ""}: '
        f'1/(v0 tau) = {fit.decay_rate:.3g} ± {fit.decay_rate * fit.log_decay_rate_error:.2g} /m',
        fontsize=10,
    )
    axes.legend(frameon=False)
    with whole_file(path) as part:
        figure.savefig(part, dpi=110)
    return found


def _relative_energy(speed: float, mass: float) -> float:
    return granular_energy(RELATIVE_TO_MEAN_SPEED * speed, mass)


def _paper_fit(curve: SpeedCurve, mass: float) -> tuple[float, float]:
    """T0 [J] and tau0 [s] of the paper's fit: least squares of the energies, all alike."""
    scale = _relative_energy(1.0, mass)
    energies = scale * curve.speed**2

    def residual(logs: NDArray[np.float64]) -> NDArray[np.float64]:
        law = np.exp(logs[0]) / (1.0 + curve.times * np.exp(-logs[1])) ** 2
        difference: NDArray[np.float64] = (energies - law) / energies[0]
        return difference

    start = np.log([energies[0], 0.3 * curve.times[-1] + 1e-9])
    best = optimize.least_squares(residual, start).x
    return float(np.exp(best[0])), float(np.exp(best[1]))


def _values(
    tray: Tray, fit: HaffFit, paper: tuple[float, float], walls: float
) -> dict[str, float | None]:
    rate = fit.decay_rate
    error = rate * fit.log_decay_rate_error
    found: dict[str, float | None] = {
        'initial_speed': fit.initial_speed,
        'haff_time': fit.haff_time,
        'decay_rate': rate,
        'decay_rate_error': error,
        'paper_energy': paper[0],
        'paper_haff_time': paper[1],
        'paper': None,
        'confined': None,
        'confined_error': None,
        'wall_restitution': walls,
    }
    try:
        found['paper'] = paper_restitution(
            *paper, tray.mean_mass, tray.diameter, tray.number_density
        )
    except FitError:
        found['paper'] = None
    try:
        cor = confined_restitution(tray, Estimate(value=rate, error=error), walls)
    except FitError:
        return found
    return {**found, 'confined': cor.value, 'confined_error': cor.error}


def _cor_text(name: str, found: dict[str, float | None], key: str) -> str:
    value, error = found[key], found.get(f'{key}_error')
    if value is None:
        return f'{name} has no value'
    walls = f', walls {found["wall_restitution"]:g}' if key == 'confined' else ''
    return f'{name} {value:.3f}' + (f' ± {error:.3f}' if error else '') + walls


def _draw_energy(axes: Axes, tray: Tray, cycles: Sequence[CycleSpeeds], curve: SpeedCurve) -> None:
    scale = _relative_energy(1.0, tray.mean_mass) * _NANOJOULE
    if len(cycles) > 1:
        lines = [np.column_stack((one.times, scale * one.speed**2)) for one in cycles]
        axes.add_collection(
            LineCollection(
                lines,
                colors=_MEASURED,
                linewidths=0.7,
                alpha=max(0.06, min(0.5, 4.0 / len(cycles))),
                label=f'{len(cycles)} cycles',
            )
        )
    axes.errorbar(
        curve.times,
        scale * curve.speed**2,
        yerr=2.0 * scale * curve.speed * curve.error,
        fmt='o',
        ms=2.5,
        lw=0.8,
        color=_MEASURED,
        zorder=2,
        label='at their mean speed' if len(cycles) > 1 else 'measured',
    )
    axes.set_yscale('log')
    # Noise about zero reaches down without end.
    axes.set_ylim(bottom=0.3 * scale * float(curve.speed.min()) ** 2)
    axes.set_xlabel('time since the shaking event [s]')
    axes.set_ylabel(r'energy at the relative speed $\frac{1}{2} m (2\bar{v})^2$ [nJ]')
    axes.grid(alpha=0.25)


def instantaneous_figure(
    path: Path,
    tray: Tray,
    cycles: Sequence[CycleSpeeds],
    *,
    wall_restitution: float,
    span: tuple[float, float],
) -> InstantaneousCor:
    """Restitution against speed: the paper's estimate, what noise alone makes of it, and ours.

    Parameters
    ----------
    path : Path
    tray : Tray
    cycles : sequence of CycleSpeeds
    wall_restitution : float, [0, 1]
        For the local slopes; taken for known.
    span : tuple of 2 floats, [s]
        First and last time since the shaking event that is used.

    Raises
    ------
    ConfigurationError
        When the tray is too crowded for the confined theory, or the decay too short.
    FitError
        When the mean speed does not fall.
    RecordingError
        When the cycles have too few times in common, or errors are not known.

    References
    ----------
    [B19] fig. 13.
    """
    curve = mean_cycle(cycles, *span)
    check_errors(curve)
    found = instantaneous_cor(
        (curve.times, curve.speed, curve.error),
        tray,
        confined_gas(tray),
        wall_restitution=wall_restitution,
        cycles=len(cycles),
    )
    figure = Figure(figsize=(9.0, 8.0), layout='constrained')
    above, below = figure.subplots(2, 1, sharex=True)
    _draw_paper(above, found)
    _draw_local(below, found, wall_restitution)
    above.set_title(
        f'Tray {tray.number}, mean over {len(cycles)} cycle{"s" if len(cycles) > 1 else ""}',
        fontsize=10,
    )
    with whole_file(path) as part:
        figure.savefig(part, dpi=110)
    return found


def _draw_paper(axes: Axes, found: InstantaneousCor) -> None:
    speed = found.fitted_collision_speed * _MM
    fluctuating, noise = found.noise_and_gas, found.noise
    axes.fill_between(
        speed,
        fluctuating[0],
        fluctuating[3],
        color=_BAND,
        alpha=0.3,
        lw=0,
        label='95 % of what noise and the fluctuations of so few beads make of one restitution',
    )
    axes.fill_between(
        speed,
        noise[0],
        noise[3],
        color=_BAND,
        alpha=0.6,
        lw=0,
        label='95 % with the errors of the speeds alone',
    )
    axes.plot(
        found.collision_speed * _MM,
        found.paper,
        'o',
        ms=3.5,
        color=_MEASURED,
        label="the paper's estimate, from speeds 1 s apart",
    )
    axes.axhline(1.0, color='black', lw=0.7)
    low, high = np.nanmin(fluctuating[0]), min(float(np.nanmax(fluctuating[3])), 2.5)
    margin = 0.35 * (high - low)
    axes.set_ylim(max(0.0, float(low) - margin), high + margin)
    axes.set_ylabel("COR by the paper's logarithm")
    axes.legend(frameon=False, fontsize=9)
    axes.grid(alpha=0.25)


def _draw_local(axes: Axes, found: InstantaneousCor, walls: float) -> None:
    local = found.local
    known = np.isfinite(local.restitution)
    value = np.where(known, local.restitution, 0.5 * (local.lower + local.upper))
    spread = np.stack((value - local.lower, local.upper - value))
    axes.errorbar(
        RELATIVE_TO_MEAN_SPEED * local.speed[known] * _MM,
        value[known],
        yerr=np.maximum(spread[:, known], 0.0),
        fmt='o',
        ms=6,
        capsize=3,
        color=_FIT,
        label=f'slope of 1/v through the confined theory, walls {walls:g}',
    )
    if not known.all():
        axes.vlines(
            RELATIVE_TO_MEAN_SPEED * local.speed[~known] * _MM,
            local.lower[~known],
            local.upper[~known],
            color=_FIT,
            alpha=0.4,
            label='no value; this range is allowed',
        )
    if np.isfinite(found.whole):
        label = f'the same from the whole decay, {found.whole:.3f}'
        axes.axhline(found.whole, color=_FIT, lw=1.2, ls='--', label=label)
    axes.axhline(1.0, color='black', lw=0.7)
    axes.set_ylim(max(0.0, float(local.lower.min()) - 0.05), 1.05)
    axes.set_ylabel('COR by the local slope')
    axes.set_xlabel('collision speed, twice the mean speed [mm/s]')
    axes.set_xscale('log')
    axes.xaxis.set_major_formatter('{x:g}')
    axes.xaxis.set_minor_formatter('{x:g}')
    axes.legend(frameon=False, fontsize=9)
    axes.grid(alpha=0.25)
