"""The figure of a measured decay, after figure 7 of the paper.

Tested by ``test/cli/figures/test_figure_decay.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection
from scipy import optimize

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.inference.decay.confined_decay import confined_restitution
from nanorocks_ros.inference.decay.haff_fit import HaffFit, fit_haff
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import (
    FITTED,
    LIBRARY,
    MEASURED,
    PAPER,
    TWO_COLUMNS,
    plain_numbers,
)
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.physics.error_propagation import Estimate
from nanorocks_ros.physics.haff_law import haff_speed
from nanorocks_ros.physics.paper_formulas import paper_restitution
from nanorocks_ros.studies.decays.best_fit_decay import LibraryDecay, library_decay
from nanorocks_ros.studies.decays.cooling_curves import check_errors, mean_cycle
from nanorocks_ros.studies.decays.species_energy import (
    draw_species,
    relative_energy,
    species_energies,
    species_values,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.decays.cooling_curves import CycleSpeeds
    from nanorocks_ros.studies.decays.decay_curve import SpeedCurve

_NANOJOULE = 1e9
_DATA = ('measured', 'mean of the cycles')


def decay_figure(
    path: Path,
    tray: Tray,
    cycles: Sequence[CycleSpeeds],
    *,
    wall_restitution: float,
    span: tuple[float, float],
    species: Sequence[Sequence[CycleSpeeds]] = (),
    start: float = 0.0,
    published: Sequence[str] = (),
) -> dict[str, Any]:
    """Draw the energy of the cycles and their mean, with our fit, the library and the paper's fit.

    A second panel shows the energy of each species of a mixture, each with its own fit.

    Parameters
    ----------
    path : Path
    tray : Tray
    cycles : sequence of CycleSpeeds
    wall_restitution : float, [0, 1]
        Restitution of the walls in the confined theory.
    span : tuple of 2 floats, [s]
        First and last time of the fit, since the shaking event.
    species : sequence of sequences of CycleSpeeds, optional
        The cycles of each species of a mixture, in the order of `Tray.species`.
    start : float, [s], optional
        Start of the cooling, since the shaking event. Initial speeds refer to this time, or to
        the start of `span` where that is earlier.
    published : sequence of str, optional
        Lines about what the analysis published, which stand first.

    Returns
    -------
    dict
        Fitted values, in SI; None where a relation has no value, or the tray no library.

    Raises
    ------
    FitError
        When the mean speed does not fall.
    RecordingError
        When the cycles have too few times in common, or errors are unknown.

    References
    ----------
    [B19] fig. 7.
    """
    curve = mean_cycle(cycles, *span)
    check_errors(curve)
    origin = min(start, span[0])
    age = curve.times - origin
    fit = fit_haff(age, curve.speed, curve.error, tray.count * len(cycles))
    energy, time = _paper_fit(age, curve.speed, tray.mean_mass)
    values: dict[str, Any] = _values(tray, fit, (energy, time), wall_restitution)
    library = _library(tray, cycles, curve, start)
    energies = species_energies(tray, species, span, origin)
    with figure_file(path, TWO_COLUMNS, 190.0 if energies else 120.0) as figure:
        panels = figure.subplots(2 if energies else 1, 1, sharex=True, squeeze=False)[:, 0]
        _draw_energy(panels[0], tray, cycles, curve)
        _draw_laws(panels[0], tray, (curve.times, age), (fit, energy, time), values)
        _draw_library(panels[0], tray, library)
        panels[0].legend(*_measured_first(panels[0]))
        for panel in panels[1:]:
            draw_species(panel, energies, origin)
        panels[-1].set_xlabel('time since the shaking event [s]')
        panels[0].set_title('\n'.join([_headline(tray, len(cycles)), *published]), fontsize=7.5)
    return {
        **values,
        'cooling_start': origin,
        'library': None if library is None else _library_values(library),
        **species_values(energies),
    }


def _headline(tray: Tray, cycles: int) -> str:
    beads = ' and '.join(f'{each.count} {each.material}' for each in tray.species)
    # The name of a material that nobody named.
    beads = beads.removesuffix(' beads') + ' beads'
    sides = ' x '.join(f'{1e3 * side:g}' for side in tray.dimensions if np.isfinite(side))
    return f'Tray {tray.number}, {counted(cycles, "cycle")}; {beads}; {sides} mm'


def _measured_first(axes: Axes) -> tuple[list[Any], list[str]]:
    """Handles and labels of the legend, data before laws."""
    handles, labels = axes.get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda k: not labels[k].startswith(_DATA))
    return [handles[k] for k in order], [labels[k] for k in order]


def _library(
    tray: Tray, cycles: Sequence[CycleSpeeds], curve: SpeedCurve, start: float
) -> LibraryDecay | None:
    try:
        return library_decay(tray, cycles, curve, start)
    except (ConfigurationError, FitError):
        # The tray has no library, or the decay is too short.
        return None


def _library_values(library: LibraryDecay) -> dict[str, float]:
    values = {'initial_speed': library.initial_speed}
    for name in ('restitution', 'wall_restitution'):
        value, lower, upper = getattr(library, name)
        values |= {name: value, f'{name}_lower': lower, f'{name}_upper': upper}
    return values


def _draw_laws(
    axes: Axes,
    tray: Tray,
    times: tuple[NDArray[np.float64], NDArray[np.float64]],
    fits: tuple[HaffFit, float, float],
    values: dict[str, Any],
) -> None:
    """Draw our fit of Haff's law and the paper's fit, of energy [J] and time [s].

    `times` are those since the shaking event and since the start of the cooling.
    """
    fit, energy, time = fits
    since_shaking, age = times
    scale = relative_energy(1.0, tray.mean_mass) * _NANOJOULE
    law = haff_speed(age, fit.initial_speed, fit.haff_time)
    label = f"Haff's law, weighted: {_cor_text('confined theory', values, 'confined')}"
    axes.plot(since_shaking, scale * law**2, color=FITTED, lw=2, zorder=3, label=label)
    axes.plot(
        since_shaking,
        _NANOJOULE * energy / (1.0 + age / time) ** 2,
        color=PAPER,
        lw=2,
        ls='--',
        zorder=4,
        label=f'fit of the paper, unweighted: {_cor_text("its closed form", values, "paper")}',
    )


def _draw_library(axes: Axes, tray: Tray, library: LibraryDecay | None) -> None:
    if library is None:
        return
    scale = relative_energy(1.0, tray.mean_mass) * _NANOJOULE
    axes.plot(
        library.times,
        scale * library.speed**2,
        color=LIBRARY,
        lw=1.6,
        ls=':',
        zorder=5,
        label=f'simulated decays: {_interval(library.restitution)}, '
        f'walls {_interval(library.wall_restitution)}',
    )


def _interval(values: tuple[float, float, float]) -> str:
    value, lower, upper = values
    return f'{value:.3f} [{lower:.3f}, {upper:.3f}]'


def _paper_fit(
    times: NDArray[np.float64], speed: NDArray[np.float64], mass: float
) -> tuple[float, float]:
    """T0 [J] and tau0 [s] of the paper's fit: unweighted least squares of the energies."""
    scale = relative_energy(1.0, mass)
    energies = scale * speed**2

    def residual(logs: NDArray[np.float64]) -> NDArray[np.float64]:
        law = np.exp(logs[0]) / (1.0 + times * np.exp(-logs[1])) ** 2
        difference: NDArray[np.float64] = (energies - law) / energies[0]
        return difference

    start = np.log([energies[0], 0.3 * times[-1] + 1e-9])
    best = optimize.least_squares(residual, start).x
    return float(np.exp(best[0])), float(np.exp(best[1]))


def _values(
    tray: Tray, fit: HaffFit, paper: tuple[float, float], walls: float
) -> dict[str, float | None]:
    rate = fit.decay_rate
    error = rate * fit.log_decay_rate_error
    values: dict[str, float | None] = {
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
        values['paper'] = paper_restitution(
            *paper, tray.mean_mass, tray.diameter, tray.number_density
        )
    except FitError:
        values['paper'] = None
    try:
        cor = confined_restitution(tray, Estimate(value=rate, error=error), walls)
    except FitError:
        return values
    return {**values, 'confined': cor.value, 'confined_error': cor.error}


def _cor_text(name: str, values: dict[str, float | None], key: str) -> str:
    value, error = values[key], values.get(f'{key}_error')
    if value is None:
        return f'{name} has no value'
    walls = f', walls {values["wall_restitution"]:g}' if key == 'confined' else ''
    return f'{name} {value:.3f}' + (f' ± {error:.3f}' if error else '') + walls


def _draw_energy(axes: Axes, tray: Tray, cycles: Sequence[CycleSpeeds], curve: SpeedCurve) -> None:
    scale = relative_energy(1.0, tray.mean_mass) * _NANOJOULE
    if len(cycles) > 1:
        lines = [np.column_stack((cycle.times, scale * cycle.speed**2)) for cycle in cycles]
        axes.add_collection(
            LineCollection(
                lines,
                colors=MEASURED,
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
        color=MEASURED,
        zorder=2,
        label='mean of the cycles' if len(cycles) > 1 else 'measured',
    )
    axes.set_yscale('log')
    plain_numbers(axes.yaxis)
    # On a log scale noise about zero has no lower end.
    axes.set_ylim(bottom=0.3 * scale * float(curve.speed.min()) ** 2)
    axes.set_ylabel(r'energy at the relative speed $\frac{1}{2} m (2\bar{v})^2$ [nJ]')
    axes.grid(alpha=0.25)
