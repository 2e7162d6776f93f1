"""Restitutions by contacts alone in short films, against the truth: bias, scatter, coverage.

The tracks are those of `benchmarks.flat_discs`, an engine that shares nothing with the package,
with errors of places, and those of the gas of the package in a tray higher than its beads.
``python -m benchmarks.short_films`` prints both tables; films are many and short, since a bias
shows where single contacts are averaged, not in one of them.
"""

from __future__ import annotations

import argparse
import sys
from typing import NamedTuple

import numpy as np

from benchmarks.contacts import METRE_PX, tracks_of
from benchmarks.flat_discs import FlatBox, flat_run
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Tracks
from nanorocks_ros.settings import PipelineSettings, SimulationSettings
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.stages.contact_restitution.track_contacts import track_contacts

_FLAT = load_trays(
    'trays:\n  1:\n    dimensions_mm: [60, 45]\n    species:\n'
    '      - {diameter_mm: 3, look: auto}\n'
)[1]
_SCALE = 8000.0
# Of each kind.
_FILMS = 20
_HIGH = load_trays()[1]


class Case(NamedTuple):
    """A kind of film.

    Parameters
    ----------
    name : str
    box : FlatBox
    seconds, rate : float, [s], [1/s]
    noise : float, [px]
    told : float
        Error of the places that the tracks state, over the true one.
    """

    name: str
    box: FlatBox
    seconds: float
    rate: float = 60.0
    noise: float = 0.1
    told: float = 1.0


_DISCS = FlatBox()
CASES = (
    Case('12 discs, 2 s', _DISCS, 2.0),
    Case('12 discs, 5 s', _DISCS, 5.0),
    Case('12 discs, 5 s, 0.3 px', _DISCS, 5.0, noise=0.3),
    Case('12 discs, 5 s, 30 frames/s', _DISCS, 5.0, rate=30.0),
    Case('12 discs, 5 s, errors told too small', _DISCS, 5.0, told=0.5),
    Case('12 discs that cool, 20 s, 0.3 px', _DISCS, 20.0, noise=0.3),
    Case('12 kicked discs, 5 s', FlatBox(kicks=1.0, speed=0.03), 5.0),
    Case('12 falling discs, 3 s', FlatBox(gravity=(0.0, 0.1), speed=0.08), 3.0),
    Case('1 falling disc, 5 s', FlatBox(count=1, gravity=(0.0, 0.4), speed=0.06), 5.0),
)


def flat_tracks(case: Case, seed: int) -> list[Tracks]:
    """Tracks of all discs, with errors of the places."""
    run = flat_run(case.box, case.seconds, rate=case.rate, seed=seed)
    random = np.random.default_rng([seed, 1])
    noise, count = case.noise / _SCALE, case.box.count
    return [
        Tracks(
            stamp_ns=1 + round(k * 1e9 / case.rate),
            tray=1,
            ids=np.arange(count, dtype=np.int32),
            species=np.zeros(count, dtype=np.int32),
            displacement=np.zeros(2),
            positions=places + random.normal(0.0, noise, places.shape),
            position_errors=np.full(count, case.told * noise),
            velocities=velocities,
            velocity_errors=np.full(count, noise * case.rate),
            radii=np.full(count, case.box.radius),
            radius_errors=np.full(count, 0.05 / _SCALE),
            seen=np.ones(count, dtype=np.bool_),
            expected=np.zeros(1, dtype=np.int32),
        )
        for k, (places, velocities) in enumerate(zip(run.places, run.velocities, strict=True))
    ]


def high_tracks(seconds: float, seed: int, noise: float) -> list[Tracks]:
    """Tracks of a gas of tray 1, which is higher than its beads, by the package."""
    settings = SimulationSettings(
        restitution=0.85, wall_restitution=0.93, seed=seed, mean_speed=0.010, first_shake=0.0
    )
    gas = ShakenTray(settings, _HIGH, 0)
    random = np.random.default_rng(seed)
    return list(tracks_of(gas, _HIGH, random, round(30.0 * seconds), noise / METRE_PX))


def row(name: str, results: list, truths: tuple[float, float]) -> str:
    """A row of the table: of beads and of walls, films that give a value, bias and coverage."""
    cells = [name]
    for kind, truth in zip(('beads', 'walls'), truths, strict=True):
        values = [getattr(result.alone, kind) for result in results]
        known = [value for value in values if np.isfinite(value.restitution.value)]
        if len(known) < 3:
            cells += [f'{len(known)} of {len(values)} films' if known else '', '', '', '']
            continue
        off = np.array([value.restitution.value - truth for value in known])
        errors = np.array([value.restitution.error for value in known])
        inside = [value.restitution.lower < truth < value.restitution.upper for value in known]
        cells += [
            f'{np.median([v.contacts for v in known]):.0f}'
            + ('' if len(known) == len(values) else f' ({len(known)} of {len(values)} films)'),
            f'{off.mean():+.4f} ± {off.std(ddof=1) / np.sqrt(off.size):.4f}',
            f'{off.std(ddof=1):.4f}, {errors.mean():.4f}',
            f'{np.mean(inside):.2f}',
        ]
    return f'| {" | ".join(cells)} |'


def report(films: int = _FILMS) -> None:
    """Print a row for each kind of film."""
    print(
        '| film | collisions each | beads: bias | scatter, stated error | 95 % holds | '
        'rebounds each | walls: bias | scatter, stated error | 95 % holds |'
    )
    print(f'{"| --- " * 9}|')
    settings = PipelineSettings()
    for case in CASES:
        results = [
            track_contacts(flat_tracks(case, seed), _FLAT, settings, container_known=False)
            for seed in range(films)
        ]
        truths = case.box.restitution, case.box.wall_restitution
        print(row(case.name, results, truths), flush=True)
    for seconds, known in ((5.0, True), (10.0, True), (10.0, False)):
        tray = _HIGH if known else _one_layer()
        results = [
            track_contacts(high_tracks(seconds, seed, 0.1), tray, settings, container_known=known)
            for seed in range(films)
        ]
        how = 'its height told' if known else 'its height not told'
        print(row(f'gas of tray 1, {seconds:g} s, {how}', results, (0.85, 0.93)), flush=True)


def _one_layer():
    """Tray 1 as a user who tells its beads alone would describe it."""
    return load_trays(
        'trays:\n  1:\n    dimensions_mm: [15, 15]\n    species:\n'
        '      - {diameter_mm: 2, look: auto}\n'
    )[1]


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog='python -m benchmarks.short_films')
    parser.add_argument('--films', type=int, default=_FILMS)
    report(parser.parse_args().films)
    return 0


if __name__ == '__main__':
    sys.exit(main())
