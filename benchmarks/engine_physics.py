"""The event-driven engine against published values: measured, its error, published, their ratio.

Lengths in diameters d, masses in m, energies in kT = m v^2; (n) is the number density times d^3.
Errors are standard errors over independent runs. The same runs, shorter, are in
`test/validation`; sources and formulas stand in `benchmarks/hard_spheres.py`.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from benchmarks import hard_spheres as theory
from benchmarks.hard_sphere_runs import (
    LAGS,
    collision_rate_ratio,
    cooling_coefficient,
    diffusion,
    mixture_temperature_ratio,
    over_runs,
    rough_temperature_ratio,
    shaken_tray,
    virial_pressure_ratio,
    wall_pressure_ratio,
)

_DENSITIES = (0.1, 0.2, 0.5, 0.8)
_DENSE = 0.5
_RATE_CELLS = 7
_RATE_RUNS = {0.1: 12, 0.2: 12, 0.5: 24, 0.8: 24}
# Cells and runs: 500, 1372 and 4000 beads.
_BOXES = ((5, 16), (7, 8), (10, 4))
# Restitution, density, Haff times followed. At 0.8 the velocities of beads about to meet are
# correlated in proportion to the density, which the theory leaves out (Pöschel, Brilliantov,
# Schwager 2002, arXiv:cond-mat/0210058).
_COOLING = (
    (0.99, 0.05, 0.7),
    (0.95, 0.05, 2.0),
    (0.9, 0.05, 2.0),
    (0.8, 0.1, 2.0),
    (0.8, 0.05, 2.0),
    (0.8, 0.01, 2.0),
)
_PERIODS_TO_SETTLE = 50


def report() -> None:
    """Print the table."""
    print('| quantity | measured | error | published | ratio | source |')
    print('| --- | --- | --- | --- | --- | --- |')
    for rows in (_rates, _diffusion, _cooling, _equipartition, _pressures, _shaken):
        for row in rows():
            print(row, flush=True)


def _row(name, measured, published, source):
    return (
        f'| {name} | {measured.mean:.5g} | {measured.error:.2g} | {published:.5g} | '
        f'{measured.mean / published:.4f} ± {measured.error / abs(published):.4f} | {source} |'
    )


def _rates():
    for n in _DENSITIES:
        ratio = over_runs(
            lambda seed, n=n: collision_rate_ratio(_RATE_CELLS, n, seed, collisions=400.0),
            range(_RATE_RUNS[n]),
        )
        enskog = theory.collision_rate(n)
        rate = ratio.scaled(enskog)
        yield _row(f'collision rate ({n})', rate, enskog, 'Enskog, Carnahan-Starling 1969')
        exact = enskog * theory.exact_contact_value(n) / theory.contact_value(n)
        yield _row(f'collision rate ({n})', rate, exact, 'Kolafa, Labik, Malijevsky 2004')
        if n == _DENSE:
            time = ratio.scaled(1.0 / ratio.mean**2 / enskog)
            yield _row(f'mean free time ({n})', time, theory.LUE_MEAN_FREE_TIME, 'Lue 2005')


def _diffusion():
    enskog = theory.enskog_diffusion(_DENSE)
    for cells, runs in _BOXES:
        beads = 4 * cells**3
        measure = partial(diffusion, cells, _DENSE, duration=150.0)
        result = over_runs(measure, range(runs))
        if cells == _BOXES[0][0]:
            speedy = theory.speedy_diffusion(_DENSE)
            yield _row(f'self-diffusion ({_DENSE}), {beads} beads', result, speedy, 'Speedy 1987')
        missing = theory.missing_diffusion(_DENSE, result.mean, beads, LAGS)
        ratio = result.scaled((1.0 + missing / result.mean) / enskog)
        yield _row(
            f'self-diffusion over Enskog ({_DENSE}), {beads} beads to infinity',
            ratio,
            theory.erpenbeck_wood_ratio(_DENSE),
            'Erpenbeck, Wood 1991',
        )


def _cooling():
    for restitution, density, haff_times in _COOLING:
        measure = partial(_cooling_of, restitution, density, haff_times)
        yield _row(
            f'Haff coefficient ({density}), restitution {restitution}',
            over_runs(measure, range(32)),
            theory.haff_coefficient(restitution),
            'van Noije, Ernst 1998',
        )


def _cooling_of(restitution, density, haff_times, seed):
    return cooling_coefficient(8, density, restitution, seed, haff_times=haff_times)


def _equipartition():
    seeds = range(32)
    mixture = over_runs(partial(mixture_temperature_ratio, duration=400.0), seeds)
    yield _row('temperature, heavy over light beads', mixture, 1.0, 'equipartition')
    rough = over_runs(partial(rough_temperature_ratio, duration=400.0), seeds)
    yield _row('temperature, rotation over translation', rough, 1.0, 'equipartition')


def _pressures():
    wall = over_runs(lambda seed: wall_pressure_ratio((8, 6, 6), 0.3, seed), range(24))
    yield _row('pressure on walls (0.31) over CS', wall, 1.0, 'Carnahan, Starling 1969')
    virial = over_runs(lambda seed: virial_pressure_ratio(5, _DENSE, seed), range(24))
    exact = theory.exact_contact_value(_DENSE) / theory.contact_value(_DENSE)
    yield _row(
        f'excess pressure ({_DENSE}), logged impulses, over CS',
        virial,
        exact,
        'Kolafa, Labik, Malijevsky 2004',
    )


def _shaken():
    balance, drift = [], []
    for seed in range(32):
        energy, lost, gained = shaken_tray(seed)
        first = _PERIODS_TO_SETTLE
        balance.append((gained[-1] - gained[first]) / (lost[-1] - lost[first]))
        early, late = np.array_split(energy[first:], 2)
        drift.append(late.mean() / early.mean())
    balanced = over_runs(balance.__getitem__, range(len(balance)))
    yield _row('shaken tray: gained at walls over lost', balanced, 1.0, 'energy is conserved')
    steady = over_runs(drift.__getitem__, range(len(drift)))
    yield _row('shaken tray: energy, second minute over first', steady, 1.0, 'steady state')
