"""The figure of restitution against speed, after figure 13 of the paper.

Tested by ``test/cli/figures/test_figure_decay.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.inference.decay.instantaneous_restitution import instantaneous_cor
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import FITTED, MEASURED, ORANGE, TWO_COLUMNS, plain_numbers
from nanorocks_ros.outputs.json_values import json_values
from nanorocks_ros.physics.confined_theory import confined_gas
from nanorocks_ros.physics.paper_formulas import RELATIVE_TO_MEAN_SPEED
from nanorocks_ros.studies.decays.cooling_curves import check_errors, mean_cycle

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.decay.instantaneous_restitution import InstantaneousCor
    from nanorocks_ros.studies.decays.cooling_curves import CycleSpeeds

_MM = 1e3
# Windows of local slopes; half as many with fewer cycles, since their noise is larger.
_WINDOWS, _MANY_CYCLES = 8, 6
_BAND = ORANGE


def instantaneous_figure(
    path: Path,
    tray: Tray,
    cycles: Sequence[CycleSpeeds],
    *,
    wall_restitution: float,
    span: tuple[float, float],
    published: Sequence[str] = (),
) -> InstantaneousCor:
    """Draw restitution against speed: the paper's estimate, the effect of noise, and ours.

    Parameters
    ----------
    path : Path
    tray : Tray
    cycles : sequence of CycleSpeeds
    wall_restitution : float, [0, 1]
        Restitution of the walls, for the local slopes.
    span : tuple of 2 floats, [s]
        First and last time since the shaking event.
    published : sequence of str, optional
        Lines about what the analysis published, which stand first.

    Raises
    ------
    ConfigurationError
        When the tray is too crowded for the confined theory, or the decay too short.
    FitError
        When the mean speed does not fall.
    RecordingError
        When the cycles have too few times in common, or errors are unknown.

    References
    ----------
    [B19] fig. 13.
    """
    curve = mean_cycle(cycles, *span)
    check_errors(curve)
    cor = instantaneous_cor(
        (curve.times, curve.speed, curve.error),
        tray,
        confined_gas(tray),
        wall_restitution=wall_restitution,
        cycles=len(cycles),
        windows=_WINDOWS if len(cycles) >= _MANY_CYCLES else _WINDOWS // 2,
    )
    with figure_file(path, TWO_COLUMNS, 150.0) as figure:
        above, below = figure.subplots(2, 1, sharex=True)
        _draw_paper(above, cor)
        _draw_local(below, cor, wall_restitution)
        kind = f'mean over {len(cycles)} cycles' if len(cycles) > 1 else 'one cycle'
        above.set_title('\n'.join([f'Tray {tray.number}, {kind}', *published]), fontsize=7.5)
    return cor


def _draw_paper(axes: Axes, cor: InstantaneousCor) -> None:
    speed = cor.fitted_collision_speed * _MM
    fluctuating, noise = cor.noise_and_gas, cor.noise
    axes.fill_between(
        speed,
        fluctuating[0],
        fluctuating[3],
        color=_BAND,
        alpha=0.3,
        lw=0,
        label='95 % band of noise and of the fluctuations of few beads, one restitution',
    )
    axes.fill_between(
        speed,
        noise[0],
        noise[3],
        color=_BAND,
        alpha=0.6,
        lw=0,
        label='95 % band of the errors of the speeds alone',
    )
    axes.plot(
        speed,
        cor.paper,
        'o',
        ms=3.5,
        color=MEASURED,
        label="the paper's estimate, from speeds 1 s apart",
    )
    axes.axhline(1.0, color='black', lw=0.7)
    low, high = np.nanmin(fluctuating[0]), min(float(np.nanmax(fluctuating[3])), 2.5)
    margin = 0.35 * (high - low)
    axes.set_ylim(max(0.0, float(low) - margin), high + margin)
    axes.set_ylabel("COR by the paper's logarithm")
    axes.legend()
    axes.grid(alpha=0.25)


def _draw_local(axes: Axes, cor: InstantaneousCor, walls: float) -> None:
    local = cor.local
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
        color=FITTED,
        label=f'slope of 1/v through the confined theory, walls {walls:g}',
    )
    if not known.all():
        axes.vlines(
            RELATIVE_TO_MEAN_SPEED * local.speed[~known] * _MM,
            local.lower[~known],
            local.upper[~known],
            color=FITTED,
            alpha=0.4,
            label='no value, only this range',
        )
    if np.isfinite(cor.whole):
        label = f'the same from the whole decay, {cor.whole:.3f}'
        axes.axhline(cor.whole, color=FITTED, lw=1.2, ls='--', label=label)
    axes.axhline(1.0, color='black', lw=0.7)
    axes.set_ylim(max(0.0, float(local.lower.min()) - 0.05), 1.05)
    axes.set_ylabel('COR by the local slope')
    axes.set_xlabel('collision speed, twice the mean speed by the fit [mm/s]')
    axes.set_xscale('log')
    plain_numbers(axes.xaxis)
    axes.legend()
    axes.grid(alpha=0.25)


def instantaneous_values(cor: InstantaneousCor) -> dict[str, Any]:
    """The restitutions for JSON, in SI; None for NaN."""
    local = cor.local
    arrays = {
        'collision_speed': cor.collision_speed,
        'paper_restitution': cor.paper,
        'noise_95': cor.noise[[0, 3]],
        'noise_and_gas_95': cor.noise_and_gas[[0, 3]],
        'local_speed': local.speed,
        'local_decay_rate': local.decay_rate,
        'local_decay_rate_error': local.decay_rate_error,
        'local_restitution': local.restitution,
        'local_restitution_lower': local.lower,
        'local_restitution_upper': local.upper,
    }
    return {name: json_values(array) for name, array in arrays.items()}
