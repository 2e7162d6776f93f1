"""Decays and energies of the species of a mixture.

Mean speeds from true positions at 5 Hz with errors of 2 %; walls 0.97, start at 10 mm/s. The
reference of a species is Haff's law fitted to its mean decay over all cycles; bias is that of the
median cycle, "covered" refers to one standard error. Energies are true ones, of velocities in the
image plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nanorocks_ros.experiment.trays import Tray, load_trays
from nanorocks_ros.inference.decay.haff_fit import HaffFit, fit_haff
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.initial_state import resting_beads, rules_of
from nanorocks_ros.simulation.shaken_tray import after_shaking

_CYCLES = 120
_TIMES = 0.2 * np.arange(1, 101)
_FIRST = 1.75
_ERROR = 0.02
_WINDOW = _TIMES >= _FIRST
_HEAD = (
    'tray', 'species', 'beads', 'v0 [mm/s]', 'tau [s]', 'ln tau of a cycle: bias', 'sd', 'covered',
    'ln 1/(v0 tau): bias', 'sd', 'covered',
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Mixture:
    """Mean speeds and energies, (cycles, times, species), [m/s] and [J]."""

    speeds: np.ndarray
    energies: np.ndarray


def cooled(tray: Tray, restitution: float) -> Mixture:
    settings = SimulationSettings(
        tray=tray.number,
        restitution=restitution,
        wall_restitution=0.97,
        mean_speed=0.010,
        first_shake=0.0,
        seed=4,
    )
    counts = [index.count for index in tray.species]
    species = np.repeat(np.arange(2), counts)
    density = np.repeat([index.density for index in tray.species], counts)
    speeds = np.empty((_CYCLES, _TIMES.size, 2))
    energies = np.empty_like(speeds)
    for run in range(_CYCLES):
        rules = rules_of(settings, tray, run)
        beads = after_shaking(settings, rules, resting_beads(settings, tray, run), run, 0)
        velocities = HardSphereGas(beads, rules).follow(_TIMES[-1], _TIMES).velocities
        mass = density * np.pi / 6.0 * (2.0 * beads.radii) ** 3
        squares = (velocities[:, :, :2] ** 2).sum(axis=2)
        for index in (0, 1):
            mask = species == index
            speeds[run, :, index] = np.sqrt(squares[:, mask]).mean(axis=1)
            energies[run, :, index] = 0.5 * (mass * squares)[:, mask].mean(axis=1)
    return Mixture(speeds=speeds, energies=energies)


def _fitted(speed: np.ndarray, error: np.ndarray, beads: int) -> HaffFit:
    return fit_haff(_TIMES[_WINDOW], speed[_WINDOW], error[_WINDOW], beads)


def _row(tray: Tray, restitution: float, number: int, mixture: Mixture) -> None:
    species = tray.species[number]
    speeds = mixture.speeds[..., number]
    mean, scatter = speeds.mean(axis=0), speeds.std(axis=0, ddof=1) / np.sqrt(_CYCLES)
    mean_fit = _fitted(mean, scatter, species.count * _CYCLES)
    rng = np.random.default_rng(1)
    fits = [
        _fitted(
            speed * (1.0 + _ERROR * rng.normal(size=speed.size)), _ERROR * speed, species.count
        )
        for speed in speeds
    ]
    cells = [f'{tray.number}, beads {restitution:g}', species.material, f'{species.count}']
    cells += [f'{1e3 * mean_fit.initial_speed:.2f}', f'{mean_fit.haff_time:.2f}']
    for logs, errors in (
        (
            np.log([fit.haff_time / mean_fit.haff_time for fit in fits]),
            np.array([fit.haff_time_error / fit.haff_time for fit in fits]),
        ),
        (
            np.log([fit.decay_rate / mean_fit.decay_rate for fit in fits]),
            np.array([fit.log_decay_rate_error for fit in fits]),
        ),
    ):
        cells += [f'{np.median(logs):+.2f}', f'{logs.std(ddof=1):.2f}']
        cells += [f'{np.mean(np.abs(logs) < errors):.2f}']
    print('| ' + ' | '.join(cells) + ' |')


def report() -> None:
    """Print both tables."""
    print('| ' + ' | '.join(_HEAD) + ' |\n|' + ' --- |' * len(_HEAD))
    lines = []
    for number in (3, 5):
        tray = load_trays()[number]
        for restitution in (0.7, 0.89):
            mixture = cooled(tray, restitution)
            for index in (0, 1):
                _row(tray, restitution, index, mixture)
            shares = mixture.energies.mean(axis=0)
            ratio = shares[:, 0] / shares[:, 1]
            masses = [index.bead_mass for index in tray.species]
            squares = mixture.speeds.mean(axis=0) ** 2 * masses
            names = '/'.join(index.material for index in tray.species)
            lines.append(
                f'| {number}, beads {restitution:g} | {names} | {ratio[0]:.2f} '
                f'| {ratio[_WINDOW].mean():.2f} '
                f'| {(squares[:, 0] / squares[:, 1])[_WINDOW].mean():.2f} |'
            )
    print(
        '\n| tray | energy of a bead | at 0.2 s | 1.8 to 20 s | by mean speeds |\n|' + ' --- |' * 5
    )
    print('\n'.join(lines))
