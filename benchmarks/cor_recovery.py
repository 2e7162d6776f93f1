"""Restitutions from simulated decays against their truth: bias, scatter and coverage.

True mean projected speeds with errors of 2 %, 1.75 to 20 s after a start at a mean speed of
10 mm/s, or another where it says so, of runs that are in no library; that beads do not rub is
known. "Walls known": the prior gives the restitution of the walls, and nothing else is uncertain;
an estimate uses 1 cycle, or 18 cycles with the errors of the camera and the misfit of the library,
which they have in common. Many cycles have the defaults. "Nothing known but the priors": all
values are drawn from the defaults of `prior.` for each run: walls from 0.5 to 1, floor and lid,
height, diameter, count and initial speeds. This is the case of one cycle of smooth beads with
default settings. "The law itself": Haff's law alone, on which the relation of the paper is based;
its interval of the decay rate 1/(v0 tau) is compared with the same fit to the mean decay of all
runs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import special

from benchmarks.cor_costs import print_costs
from benchmarks.drawn import varied
from nanorocks_ros.experiment.trays import Tray, load_trays
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.decay_likelihood import decay_likelihood
from nanorocks_ros.inference.decay.decay_tables import DecayTables, tables_of
from nanorocks_ros.inference.decay.haff_fit import fit_haff
from nanorocks_ros.inference.posterior import posterior_of
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.physics.paper_formulas import paper_restitution_of_decay
from nanorocks_ros.settings import (
    PriorSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.simulation.ensemble import cooling_runs

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from nanorocks_ros.inference.decay.decay_library import DecayLibrary
    from nanorocks_ros.inference.decay.grid_likelihood import DecayLikelihood

_TRAYS = (1, 3, 5)
# Trays with chalk and with grains, with fewer truths.
_MORE_TRAYS = (2, 4, 6, 7)
_MORE_RESTITUTIONS, _MORE_WALL = (0.7, 0.89), 0.97
_RUNS = 216
_TOGETHER = 18
# Cycles in the paper; groups of cycles, and truths.
_ALL_CYCLES, _GROUPS = 178, 6
_ALL_RESTITUTIONS, _ALL_WALL = (0.7, 0.89), 0.97
# Mean speeds of their start; that of the prior is 7 mm/s projected.
_ALL_SPEEDS = (4e-3, 10e-3, 20e-3)
_RESTITUTIONS = (0.5, 0.7, 0.8, 0.89, 0.95)
_WALLS = (0.90, 0.97, 0.99)
_TIMES = np.arange(1.75, 20.0, 0.25)
_ERROR = 0.02
_SPEED = 0.01
_RANGES = ((0.5, 0.7), (0.7, 0.85), (0.85, 0.95))
_LEVELS = np.array([0.025, 0.16, 0.5, 0.84, 0.975])
_EXACT = PriorSettings(
    floor_lid_spread=0.0,
    height_error=0.0,
    diameter_error=0.0,
    count_error=0.0,
    anisotropy_spread=0.0,
    speed_distribution_spread=0.0,
    scale_error=0.0,
    speed_bias=0.0,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Case:
    """A tray with its restitutions."""

    tray: int
    restitution: float
    wall: float
    speed: float = _SPEED


@dataclass(frozen=True, slots=True, kw_only=True)
class _Range:
    """A uniform range of restitutions of the beads."""

    tray: int
    low: float
    high: float


def report() -> None:
    """Print the tables."""
    cases = [
        _Case(tray=tray, restitution=restitution, wall=wall)
        for tray in _TRAYS
        for restitution in _RESTITUTIONS
        for wall in _WALLS
    ]
    more = [
        _Case(tray=tray, restitution=restitution, wall=_MORE_WALL)
        for tray in _MORE_TRAYS
        for restitution in _MORE_RESTITUTIONS
    ]
    large = [
        _Case(tray=tray, restitution=restitution, wall=_ALL_WALL, speed=speed)
        for tray in _TRAYS
        for restitution in _ALL_RESTITUTIONS
        for speed in _ALL_SPEEDS
    ]
    ranges = [_Range(tray=tray, low=low, high=high) for tray in _TRAYS for low, high in _RANGES]
    _print('Walls known, nothing else uncertain', _known_walls, cases + more)
    _print(f'{_ALL_CYCLES} cycles together, walls known, defaults', _many_cycles, large)
    _print('Nothing known but the priors', _drawn_from_priors, ranges)
    law = [_Case(tray=1, restitution=restitution, wall=0.99) for restitution in _RESTITUTIONS]
    _print('The law itself', _by_the_law, law)
    print_costs()


def _print(title: str, function: Callable[[Any], tuple[str, str]], cases: Sequence[Any]) -> None:
    tasks = {str(number): case for number, case in enumerate(cases)}
    heads, rows = zip(*run_tasks(function, tasks, Workers()), strict=True)
    print(f'{title}\n\n{heads[0]}\n' + '| --- ' * (heads[0].count('|') - 1) + '|')
    print('\n'.join(rows), end='\n\n', flush=True)


def _speeds(case: _Case, tray: Tray, values: dict[str, float | str], runs: range) -> np.ndarray:
    settings = with_values(
        SimulationSettings(seed=4242, mean_speed=case.speed),
        {'restitution': case.restitution, 'wall_restitution': case.wall, **values},
        'benchmark',
    )
    speed = cooling_runs(settings, tray, _TIMES, runs).mean_projected_speed
    noise = np.random.default_rng([case.tray, runs.start]).standard_normal(speed.shape)
    return np.asarray(speed * np.exp(_ERROR * noise))


def _known_walls(case: _Case) -> tuple[str, str]:
    tray = load_trays()[case.tray]
    library = library_of(tray)
    tables = tables_of(library, tray, _EXACT)
    walls = (case.wall, case.wall)
    singles, together, paper = [], [], []
    total = None
    likelihood = partial(_likelihood, tables, (0.0, 0.0))
    for number, speed in enumerate(_speeds(case, tray, {}, range(_RUNS))):
        singles.append(posterior_of(tables, likelihood(speed), walls).quantiles(_LEVELS))
        likelihood_of_cycle = _decay(tables, _camera(library), speed)
        total = likelihood_of_cycle if total is None else total + likelihood_of_cycle
        if number % _TOGETHER == _TOGETHER - 1:
            posterior = posterior_of(tables, total.integrated(), walls)
            together.append(posterior.quantiles(_LEVELS))
            total = None
        paper.append(_paper(tray, speed))
    head = '| tray | beads | walls | 1 cycle: bias | sd | covered 68 % | 95 % | '
    head += '18 cycles: bias | sd | covered 68 % | 95 % | paper says |'
    row = f'| {case.tray} | {case.restitution:g} | {case.wall:g} '
    row += _judged(np.array(singles), case.restitution)
    row += _judged(np.array(together), case.restitution)
    return head, row + f'| {np.mean(paper):.3f} |'


def _many_cycles(case: _Case) -> tuple[str, str]:
    """Groups of as many cycles as in the paper, with known walls and all else as by default."""
    tray = load_trays()[case.tray]
    library = library_of(tray)
    tables = tables_of(library, tray, PriorSettings())
    means, halves, covered = [], [], []
    for group in range(_GROUPS):
        first = 1000 * (group + 1)
        total = None
        for speed in _speeds(case, tray, {}, range(first, first + _ALL_CYCLES)):
            likelihood_of_cycle = _decay(tables, _camera(library), speed)
            total = likelihood_of_cycle if total is None else total + likelihood_of_cycle
        assert total is not None
        posterior = posterior_of(tables, total.integrated(), (case.wall, case.wall))
        low, middle, high = posterior.quantiles(_LEVELS[1:4])
        means.append(middle)
        halves.append(0.5 * (high - low))
        covered.append(low <= case.restitution <= high)
    head = '| tray | beads | walls | start [mm/s] | groups | bias | sd | half of a 68 % interval '
    head += '| covered |'
    row = f'| {case.tray} | {case.restitution:g} | {case.wall:g} | {1e3 * case.speed:g} '
    row += f'| {_GROUPS} '
    row += f'| {np.mean(means) - case.restitution:+.4f} | {np.std(means, ddof=1):.4f} '
    return head, row + f'| {np.mean(halves):.4f} | {sum(covered)} |'


def _by_the_law(case: _Case) -> tuple[str, str]:
    """Coverage of fits of Haff's law to single runs, against the fit to their mean."""
    tray = load_trays()[case.tray]
    speeds = _speeds(case, tray, {}, range(_RUNS))
    mean = speeds.mean(axis=0)
    mean_fit = fit_haff(_TIMES, mean, _ERROR * mean, tray.count * _RUNS)
    fits = [fit_haff(_TIMES, speed, _ERROR * speed, tray.count) for speed in speeds]
    logs = np.log([fit.decay_rate for fit in fits])
    errors = np.array([fit.log_decay_rate_error for fit in fits])
    freedom = np.array([fit.degrees_of_freedom for fit in fits])
    pulls = np.abs(logs - math.log(mean_fit.decay_rate)) / errors
    shares = [float(np.mean(pulls < special.stdtrit(freedom, p))) for p in (0.84, 0.975)]
    head = '| tray | beads | walls | covered 68 % | 95 % | sd of ln(rate): runs | fits |'
    row = f'| {case.tray} | {case.restitution:g} | {case.wall:g} '
    row += f'| {shares[0]:.2f} | {shares[1]:.2f} '
    return head, row + f'| {np.std(logs, ddof=1):.3f} | {np.median(errors):.3f} |'


def _drawn_from_priors(case: _Range) -> tuple[str, str]:
    tray = load_trays()[case.tray]
    prior = PriorSettings()
    library = library_of(tray)
    tables = tables_of(library, tray, prior)
    camera = _camera(library)
    beads, walls = [], []
    for number in range(_RUNS):
        random = np.random.default_rng([7, case.tray, number])
        drawn = _Case(
            tray=case.tray,
            restitution=random.uniform(case.low, case.high),
            wall=random.uniform(prior.min_wall_restitution, prior.max_wall_restitution),
        )
        varied_tray, values = varied(tray, drawn.wall, prior, random)
        (speed,) = _speeds(drawn, varied_tray, values, range(number, number + 1))
        likelihood = _likelihood(tables, camera, speed)
        posterior = posterior_of(
            tables, likelihood, (prior.min_wall_restitution, prior.max_wall_restitution)
        )
        beads.append(posterior.quantiles(_LEVELS) - drawn.restitution)
        walls.append(posterior.wall_quantiles(_LEVELS) - drawn.wall)
    head = '| tray | beads | beads: bias | sd | covered 68 % | 95 % | half of a 68 % interval '
    head += '| walls: bias | sd | covered 68 % | 95 % |'
    width = np.mean([0.5 * (bead[3] - bead[1]) for bead in beads])
    row = f'| {case.tray} | {case.low:g} to {case.high:g} ' + _judged(np.array(beads), 0.0)
    return head, row + f'| {width:.3f} ' + _judged(np.array(walls), 0.0) + '|'


def _camera(library: DecayLibrary) -> tuple[float, float]:
    """Errors of the camera by default, with the misfit of the library."""
    prior = PriorSettings()
    return math.hypot(prior.scale_error, library.misfit), prior.speed_bias


def _decay(tables: DecayTables, camera: tuple[float, float], speed: np.ndarray) -> DecayLikelihood:
    """Likelihood of the decay of beads that are known not to rub."""
    return decay_likelihood(tables, _TIMES, speed, _ERROR * speed, camera, highest_friction=0.0)


def _likelihood(tables: DecayTables, camera: tuple[float, float], speed: np.ndarray) -> np.ndarray:
    return _decay(tables, camera, speed).integrated()


def _judged(estimates: np.ndarray, truth: float) -> str:
    middle = estimates[:, 2]
    covered = [
        float(np.mean((estimates[:, low] <= truth) & (truth <= estimates[:, high])))
        for low, high in ((1, 3), (0, 4))
    ]
    return (
        f'| {middle.mean() - truth:+.3f} | {middle.std(ddof=1):.3f} '
        f'| {covered[0]:.2f} | {covered[1]:.2f} '
    )


def _paper(tray: Tray, speed: np.ndarray) -> float:
    slope, _ = np.polyfit(_TIMES, 1.0 / speed, 1)
    return paper_restitution_of_decay(float(slope), tray.diameter, tray.number_density)
