"""Closed forms of the cooling against simulation: decay rates and inferred restitutions.

The simulated gas starts with an isotropic Maxwell distribution, with a mean speed of 7 mm/s.
Haff's law is fitted to ln v of the mean projected speed, averaged over the runs, from 2 to 30 s.
Brackets give the standard error, from eight groups of runs.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from scipy import optimize

from nanorocks_ros.errors import FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.confined_decay import windowed_restitution
from nanorocks_ros.physics.confined_theory import confined_gas
from nanorocks_ros.physics.kinetic_theory import (
    contact_value,
    kinetic_decay_rate,
    kinetic_restitution,
)
from nanorocks_ros.physics.paper_formulas import RELATIVE_TO_MEAN_SPEED, paper_restitution_of_decay
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.ensemble import cooling_runs
from nanorocks_ros.simulation.initial_state import resting_beads, rules_of
from nanorocks_ros.simulation.shaken_tray import after_shaking

RUNS = {1: 400, 3: 120, 5: 64, 6: 8, 7: 24, 8: 8}
TEMPERATURES = {1: 100, 3: 40, 5: 20, 7: 6}
RESTITUTIONS = (0.5, 0.6, 0.7, 0.8, 0.9, 0.98)
WALLS = (0.9, 0.95, 0.99, 1.0)
# For trays with many grains.
FEW_RESTITUTIONS, FEW_WALLS = (0.8, 0.9, 0.98), (0.95, 0.99)
TIMES = np.linspace(0.0, 30.0, 121)
WINDOW = 2.0
GROUPS = 8


def simulated(tray, restitution, walls, runs, speeds='maxwellian'):
    """Mean projected speed of each run, (n_runs, n_times)."""
    settings = SimulationSettings(
        tray=tray.number, restitution=restitution, wall_restitution=walls, speeds=speeds
    )
    return cooling_runs(settings, tray, TIMES, range(runs)).mean_projected_speed


def fitted_rate(speed):
    """Decay rate 1 / (v0 tau) of Haff's law, fitted to ln v in the window."""
    inside = TIMES >= WINDOW
    log_speed, times = np.log(speed[inside]), TIMES[inside]

    def residual(logs):
        return log_speed - logs[0] + np.log1p(math.exp(logs[0] + logs[1]) * times)

    return math.exp(optimize.least_squares(residual, (log_speed[0], math.log(50.0))).x[1])


def decay_rate(speeds):
    """Decay rate of the mean over runs, and its standard error."""
    groups = [fitted_rate(group.mean(axis=0)) for group in np.array_split(speeds, GROUPS)]
    return fitted_rate(speeds.mean(axis=0)), float(np.std(groups, ddof=1) / math.sqrt(GROUPS))


def one_temperature(tray):
    """Coefficients of (1 - ep^2) and (1 - ew^2) with one temperature for all directions, [1/m].

    The contact value is that of a bulk gas with the same filling factor, without layers at walls.
    """
    d = tray.diameter
    room = np.array(tray.dimensions) - d
    k = np.random.default_rng(1).normal(size=(200_000, 3))
    k = np.abs(k) / np.linalg.norm(k, axis=1)[:, np.newaxis]
    cross_section = math.pi * d * d * np.clip(1.0 - d * k / room, 0.0, None).prod(axis=1).mean()
    crowding = contact_value(tray.count * math.pi / 6.0 * d**3 / tray.volume)
    beads = math.sqrt(2.0 / math.pi) * 2.0 / (3.0 * math.sqrt(math.pi))
    beads *= (tray.count - 1) / room.prod() * cross_section * crowding
    return beads, 2.0 / (3.0 * math.pi) * (1.0 / room).sum()


def _or_none(relation, *values):
    try:
        restitution = relation(*values)
    except FitError:
        return '-'
    return f'{getattr(restitution, "value", restitution):.3f}'


def report():
    """Print the table."""
    trays = load_trays()
    print(
        '| tray | truth ep, ew | simulated 1/m | paper | dilute | one temperature | confined | '
        'paper returns | dilute returns | one temperature returns | confined returns | '
        'confined, followed, returns |'
    )
    print('|' + ' --- |' * 12)
    for number, runs in RUNS.items():
        tray = trays[number]
        forms = _Forms(tray)
        many = 'JSC-1' in {species.material for species in tray.species}
        for restitution in FEW_RESTITUTIONS if many else RESTITUTIONS:
            for walls in FEW_WALLS if many else WALLS:
                speeds = simulated(tray, restitution, walls, runs)
                first = float(speeds[:, 0].mean())
                print(forms.row(restitution, walls, *decay_rate(speeds), first), flush=True)
    _report_temperatures(trays)


def temperatures(tray, restitution, walls, runs, span=(8.0, 25.0)):
    """Mean squares of velocity of each species along x, y, z over their mean in x and y."""
    settings = SimulationSettings(
        tray=tray.number, restitution=restitution, wall_restitution=walls, speeds='maxwellian'
    )
    ratios = []
    for run in range(runs):
        rules = rules_of(settings, tray, run)
        beads = after_shaking(settings, rules, resting_beads(settings, tray, run), run, 0)
        record = HardSphereGas(beads, rules).follow(span[1], (), np.linspace(*span, 35))
        squares = record.observations.granular_temperature
        ratios.append((squares / squares[:, :, :2].mean(axis=(1, 2), keepdims=True)).mean(axis=0))
    return np.mean(ratios, axis=0)


def _report_temperatures(trays):
    print('\n| tray | species | ep, ew | x, y, z simulated | x, y, z confined |')
    print('|' + ' --- |' * 5)
    for number, runs in TEMPERATURES.items():
        gas = confined_gas(trays[number])
        for restitution, walls in ((0.9, 0.95), (0.8, 0.9)):
            simulated = temperatures(trays[number], restitution, walls, runs)
            class_temperatures = gas.cooling(restitution, walls).granular_temperature
            species = gas.beads.species
            theory = np.array(
                [
                    np.average(
                        class_temperatures[species == k],
                        axis=0,
                        weights=gas.beads.counts[species == k],
                    )
                    for k in range(len(simulated))
                ]
            )
            theory /= theory[:, :2].mean()
            for k, bead_species in enumerate(trays[number].species):
                print(
                    f'| {number} | {bead_species.material} | {restitution:g}, {walls:g} | '
                    f'{_shown(simulated[k])} | {_shown(theory[k])} |',
                    flush=True,
                )


def _shown(values):
    return ', '.join(f'{value:.2f}' for value in values)


class _Forms:
    def __init__(self, tray):
        self.tray = tray
        self.gas = confined_gas(tray)
        self.beads, self.walls = one_temperature(tray)

    def row(self, restitution, walls, rate, error, first_speed):
        tray = self.tray
        section = math.pi * tray.diameter**2 * tray.number_density
        paper = RELATIVE_TO_MEAN_SPEED * section * (1.0 - restitution**2)
        dilute = kinetic_decay_rate(restitution, tray.diameter, tray.number_density)
        lost = self.walls * (1.0 - walls**2)
        single = self.beads * (1.0 - restitution**2) + lost
        followed = partial(
            windowed_restitution,
            self.gas,
            initial_speed=first_speed,
            window=(WINDOW, TIMES[-1]),
        )
        square = 1.0 - (rate - lost) / self.beads
        returned = f'{math.sqrt(square):.3f}' if 0.0 <= square <= 1.0 else '-'
        return (
            f'| {tray.number} | {restitution:g}, {walls:g} | {rate:.2f} ({error:.2f}) | '
            f'{paper:.1f} | {dilute:.1f} | {single:.1f} | '
            f'{self.gas.decay_rate(restitution, walls):.2f} | '
            f'{paper_restitution_of_decay(rate, tray.diameter, tray.number_density):.3f} | '
            f'{_or_none(kinetic_restitution, rate, tray.diameter, tray.number_density)} | '
            f'{returned} | {_or_none(self.gas.restitution, rate, walls)} | '
            f'{_or_none(followed, rate, walls)} |'
        )
