"""The energy of each species of a cooling mixture, and their ratio."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import FitError, RecordingError
from nanorocks_ros.inference.decay.haff_fit import HaffFit, fit_haff
from nanorocks_ros.outputs.figure_style import MARKS, SERIES, plain_numbers
from nanorocks_ros.outputs.json_values import finite_or_none
from nanorocks_ros.physics.haff_law import granular_energy, haff_speed
from nanorocks_ros.physics.paper_formulas import RELATIVE_TO_MEAN_SPEED
from nanorocks_ros.studies.decays.cooling_curves import check_errors, mean_cycle

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Species, Tray
    from nanorocks_ros.studies.decays.cooling_curves import CycleSpeeds
    from nanorocks_ros.studies.decays.decay_curve import SpeedCurve

_NANOJOULE, _MM = 1e9, 1e3


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeciesEnergy:
    """The decay of one species.

    Parameters
    ----------
    species : Species
    cycles : tuple of CycleSpeeds
    curve : SpeedCurve
        Their mean.
    fit : HaffFit or None
        None when the speeds do not fall.
    """

    species: Species
    cycles: tuple[CycleSpeeds, ...]
    curve: SpeedCurve
    fit: HaffFit | None


def species_energies(
    tray: Tray,
    cycles: Sequence[Sequence[CycleSpeeds]],
    span: tuple[float, float],
    origin: float = 0.0,
) -> tuple[SpeciesEnergy, ...]:
    """The decay of each species of a mixture, each with a fit of Haff's law.

    Parameters
    ----------
    tray : Tray
    cycles : sequence of sequences of CycleSpeeds
        Of each species, in the order of `Tray.species`.
    span : tuple of 2 floats, [s]
        First and last time since the shaking event that is fitted.
    origin : float, [s], optional
        Origin of the fitted times, since the shaking event.

    Returns
    -------
    tuple of SpeciesEnergy
        Empty unless the speeds of two species are known over that time.
    """
    energies = []
    for species, species_cycles in zip(tray.species, cycles, strict=False):
        try:
            curve = mean_cycle(species_cycles, *span)
            check_errors(curve)
        except RecordingError:
            return ()
        try:
            beads = species.count * len(species_cycles)
            fit: HaffFit | None = fit_haff(curve.times - origin, curve.speed, curve.error, beads)
        except FitError:
            fit = None
        energies.append(
            SpeciesEnergy(species=species, cycles=tuple(species_cycles), curve=curve, fit=fit)
        )
    return tuple(energies) if len(energies) > 1 else ()


def relative_energy(speed: float, mass: float) -> float:
    """Energy at twice the mean speed, [J], the relative speed in the paper."""
    return granular_energy(RELATIVE_TO_MEAN_SPEED * speed, mass)


def energy_ratio(energies: Sequence[SpeciesEnergy]) -> tuple[float, float]:
    """Energy of a bead of the first species over that of one of the second, and its error.

    From the mean speeds and the masses of beads of mean diameter; 1 for equipartition.

    Parameters
    ----------
    energies : sequence of SpeciesEnergy
        Of the two species.

    Returns
    -------
    ratio, error : float
        Mean over the time all cycles cover; the error is from the scatter of the cycles, NaN for
        a single one.
    """
    first, second = (_log_energies(energy) for energy in energies[:2])
    ratio = math.exp(float(first.mean() - second.mean()))
    if first.size != second.size or first.size < 2:
        return ratio, math.nan
    return ratio, ratio * float((first - second).std(ddof=1) / math.sqrt(first.size))


def _log_energies(energy: SpeciesEnergy) -> NDArray[np.float64]:
    """Mean over the times of the logarithm of the energy in each cycle, (n_cycles,)."""
    times = energy.curve.times
    logs = [np.log(np.interp(times, cycle.times, cycle.speed)).mean() for cycle in energy.cycles]
    return math.log(relative_energy(1.0, energy.species.bead_mass)) + 2.0 * np.array(logs)


def species_values(energies: Sequence[SpeciesEnergy]) -> dict[str, Any]:
    """Fits of each species and their energy ratio for JSON, in SI units."""
    if not energies:
        return {'species': None, 'energy_ratio': None, 'energy_ratio_error': None}
    ratio, error = energy_ratio(energies)
    return {
        'species': [
            {
                'material': energy.species.material,
                'initial_speed': energy.fit and energy.fit.initial_speed,
                'initial_speed_error': energy.fit and energy.fit.initial_speed_error,
                'haff_time': energy.fit and energy.fit.haff_time,
                'haff_time_error': energy.fit and energy.fit.haff_time_error,
            }
            for energy in energies
        ],
        'energy_ratio': ratio,
        'energy_ratio_error': finite_or_none(error),
    }


def draw_species(axes: Axes, energies: Sequence[SpeciesEnergy], origin: float = 0.0) -> None:
    """Draw the energies of both species over time, each with its fit."""
    for energy, line, colour, mark in zip(energies, ('-', '--'), SERIES, MARKS, strict=False):
        curve, fit, name = energy.curve, energy.fit, energy.species.material
        scale = relative_energy(1.0, energy.species.bead_mass) * _NANOJOULE
        axes.errorbar(
            curve.times,
            scale * curve.speed**2,
            yerr=2.0 * scale * curve.speed * curve.error,
            fmt=mark,
            ms=2.5,
            lw=0.8,
            alpha=0.5,
            color=colour,
            label=f'{name}: the speeds do not fall' if fit is None else None,
        )
        if fit is None:
            continue
        axes.plot(
            curve.times,
            scale * haff_speed(curve.times - origin, fit.initial_speed, fit.haff_time) ** 2,
            line,
            lw=2,
            color=colour,
            label=f'{name}: {_fit_text(fit)}',
        )
    ratio, error = energy_ratio(energies)
    names = ' bead over that of one '.join(energy.species.material for energy in energies)
    spread = f' ± {error:.2f}' if math.isfinite(error) else ''
    axes.set_title(f'Energy of one {names} bead: {ratio:.2f}{spread}')
    axes.set_yscale('log')
    plain_numbers(axes.yaxis)
    axes.set_ylabel(r'the same of each species, its own $m$ and $\bar{v}$ [nJ]')
    axes.legend()
    axes.grid(alpha=0.25)


def _fit_text(fit: HaffFit) -> str:
    return (
        f'$v_0$ = {fit.initial_speed * _MM:.2f} ± {fit.initial_speed_error * _MM:.2f} mm/s, '
        rf'$\tau$ = {fit.haff_time:.2f} ± {fit.haff_time_error:.2f} s'
    )
