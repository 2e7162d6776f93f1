"""Statistics of gases from tracks, against the engine: true places with errors as in tracking.

Each run is one cycle of 58 s, 10 mm/s at first, places at 30 Hz; restitution of walls 0.97.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.contacts import tracks_of
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.studies.gas_statistics.tray_statistics import (
    GasChoices,
    TrayStatistics,
    tray_statistics,
)

_RATE, _SECONDS, _START = 30.0, 58.0, 1.75
_RUNS = 12
_CASES = ((1, 0.89), (1, 0.7), (3, 0.89), (5, 0.89))
_STICKING = (0.0, 0.0005, 0.001, 0.002)


def _gas(
    number: int, run: int, restitution: float, sticking: float, lost: float = 0.0
) -> tuple[TrayStatistics, list, np.ndarray, np.ndarray]:
    """Statistics, tracks, collisions of pairs so far and bodies at each frame."""
    tray = load_trays()[number]
    settings = SimulationSettings(
        restitution=restitution,
        wall_restitution=0.97,
        sticking_speed=sticking,
        seed=7,
        mean_speed=0.010,
        first_shake=0.0,
        frame_rate=_RATE,
    )
    gas = ShakenTray(settings, tray, run)
    rng = np.random.default_rng([7, run])
    tracks, pairs, bodies = [], [], []
    for record in tracks_of(gas, tray, rng, round(_SECONDS * _RATE)):
        seen = rng.random(record.ids.size) >= lost
        tracks.append(replace(record, cycle=1, seen=seen))
        pairs.append(gas.counts.pair)
        bodies.append(np.unique(gas.bodies).size)
    choices = GasChoices(start=_START, restitution=restitution, wall_restitution=0.97)
    return tray_statistics(tracks, tray, choices), tracks, np.array(pairs), np.array(bodies)


def _temperature_ratios(measured: TrayStatistics, tracks: list) -> tuple[list, list]:
    """Measured over true temperatures, and their deviations in stated errors."""
    times = np.arange(len(tracks)) / _RATE
    ratios, sigmas = [], []
    for kind, part in enumerate(measured.temperatures):
        true = np.array(
            [(record.velocities[record.species == kind] ** 2).mean() for record in tracks]
        )
        spans = zip(part.time, part.duration, strict=True)
        means = np.array([true[np.abs(times - t) <= 0.5 * d + 1e-3].mean() for t, d in spans])
        temperature = part.temperature.mean(axis=1)
        ratios += (temperature / means).tolist()
        sigmas += ((temperature - means) / part.temperature_error).tolist()
    return ratios, sigmas


def _collision_ratio(measured: TrayStatistics, tracks: list, pairs: np.ndarray) -> tuple:
    """Measured over counted collisions, its error, and theory over counted ones."""
    first = round(_START * _RATE)
    collisions, variance, theory = 0.0, 0.0, 0.0
    for kind, rate in enumerate(measured.collisions):
        speeds = [
            np.hypot(*record.velocities[record.species == kind].T).mean()
            for record in tracks[first:]
        ]
        path = 0.5 * measured.tray.species[kind].count * np.sum(speeds) / _RATE
        collisions += rate.per_path.value * path
        variance += (rate.per_path.error * path) ** 2
        theory += rate.theory_per_path * path
    true = pairs[-1] - pairs[first]
    return collisions / true, np.sqrt(variance) / true, theory / true


def report() -> None:
    """Print temperatures and collisions, then onsets of clustering."""
    print(
        '| tray, restitution | temperature / true | within 2 errors | collisions / counted | '
        'within 2 errors | theory / counted | a2 of the first species |'
    )
    print('| --- | --- | --- | --- | --- | --- | --- |')
    for lost in (0.0, 0.1):
        for number, restitution in _CASES:
            runs = [_gas(number, run, restitution, 0.0, lost) for run in range(_RUNS)]
            parts = [_temperature_ratios(measured, tracks) for measured, tracks, _, _ in runs]
            ratios = [ratio for part, _ in parts for ratio in part]
            sigmas = [sigma for _, part in parts for sigma in part]
            rates = np.array([_collision_ratio(*run[:3]) for run in runs])
            covered = int((np.abs(rates[:, 0] - 1.0) < 2.0 * rates[:, 1]).sum())
            cumulants = [measured.velocities[0].fourth_cumulant for measured, *_ in runs]
            values = np.array([cumulant.value for cumulant in cumulants])
            name = f'{number}, {restitution:g}' + (f', {lost:.0%} not seen' if lost else '')
            print(
                f'| {name} | {np.mean(ratios):.4f} ± {np.std(ratios):.4f} | '
                f'{np.mean(np.abs(sigmas) < 2.0):.2f} | '
                f'{rates[:, 0].mean():.3f} ± {rates[:, 0].std(ddof=1):.3f} | '
                f'{covered}/{_RUNS} | {rates[:, 2].mean():.3f} | '
                f'{values.mean():+.3f} ± {values.std(ddof=1) / np.sqrt(_RUNS):.3f} |',
                flush=True,
            )
    print('\n| tray 1, sticking speed | runs with an onset | onset, median | bodies then |')
    print('| --- | --- | --- | --- |')
    for sticking in _STICKING:
        runs = [_gas(1, run, 0.89, sticking) for run in range(_RUNS)]
        onsets = np.array([measured.clustering[0].onset for measured, *_ in runs])
        known = np.isfinite(onsets)
        left = [
            bodies[round(onset * _RATE)]
            for onset, (*_, bodies) in zip(onsets, runs, strict=True)
            if np.isfinite(onset)
        ]
        middle = f'{np.median(onsets[known]):.1f} s' if known.any() else ''
        number = f'{np.median(left):.0f} of 15' if left else ''
        print(
            f'| {1e3 * sticking:g} mm/s | {known.sum()}/{_RUNS} | {middle} | {number} |',
            flush=True,
        )
