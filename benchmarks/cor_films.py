"""Restitutions from films of whole cycles against their truth: bias, scatter and coverage.

Trays 1 and 3, filmed with all effects (lens, defocus, noise, uneven and flickering light, shadows,
glare on the plate, JPEG 85, and a plate that oscillates on its springs and hits the beads) for
33 s after a shaking event with a mean speed of 10 mm/s, by the stages of the pipeline. In most
films the trays have their nominal values. In the films "drawn" each cell has its own restitutions
(beads 0.7 to 0.95), floor and lid, height, diameter, count and initial speeds, drawn from the
defaults of `prior.` and unknown to the stages: there the coverage should equal the nominal one.
"All": decay, rebounds and collisions, as published by default. "Tray known": floor and lid,
height, diameter, count and anisotropy have their nominal values without uncertainty. "True
speeds": the same windows with the true mean projected speeds and the stated errors. Films are
kept (`filmed_cycles`) in the folder NANOROCKS_FILMS; one film takes about a minute.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np

from benchmarks.filmed_cycles import Cycle, Film, load, make
from nanorocks_ros.experiment.trays import Tray, load_trays
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.decay_likelihood import decay_likelihood
from nanorocks_ros.inference.decay.decay_tables import tables_of
from nanorocks_ros.inference.posterior import Posterior, posterior_of
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.records import CorEstimate, CorStatus, PairCollision
from nanorocks_ros.settings import PipelineSettings, PriorSettings, with_values
from nanorocks_ros.stages.delays import KNOWN_AFTER_NS
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator
from nanorocks_ros.stages.restitution.restitution_method import Decay

# Films by truth; the goals refer to the first truth.
_FILMS = {
    '0.89 / 0.97': [Film(pairs=0.89, walls=0.97, number=number) for number in range(12)],
    'drawn': [Film(number=number) for number in range(11)],
    '0.7 / 0.9': [Film(pairs=0.7, walls=0.9, number=0)],
    '0.8 / 0.97': [Film(pairs=0.8, walls=0.97, number=0)],
}
_TOGETHER = 18
_LEVELS = np.array([0.025, 0.16, 0.5, 0.84, 0.975])
_NS = 1e9
# Parts of the window for the ratio of speeds to the truth, [s].
_PARTS = ((0.0, 4.0), (4.0, 8.0), (8.0, 14.0), (14.0, 21.0))
_DELAY_NS = 1_750_000_000
_ALONE = {'cooling.rebounds': False, 'cooling.collisions': False}
_PRIOR = PriorSettings(min_wall_restitution=0.8)
_TRAY_KNOWN = replace(
    _PRIOR,
    floor_lid_spread=0.0,
    height_error=0.0,
    diameter_error=0.0,
    count_error=0.0,
    anisotropy_spread=0.0,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Row:
    """A row of the table: the data and the assumptions.

    Parameters
    ----------
    name : str
    true_speeds, tray_known, walls_known : bool
    contacts : str
        Contacts in the 'window', 'all' since the end of the shaking, or 'none'.
    """

    name: str
    true_speeds: bool = False
    tray_known: bool = False
    walls_known: bool = False
    contacts: str = 'none'


_ROWS = (
    _Row(name='decay of true speeds', true_speeds=True),
    _Row(name='decay'),
    _Row(name='decay, walls known', walls_known=True),
    _Row(name='decay, walls and tray known', walls_known=True, tray_known=True),
    _Row(name='all, contacts of the window', contacts='window'),
    _Row(name='all', contacts='all'),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _MeasuredCycle:
    """Results of the stages for one cycle.

    Parameters
    ----------
    cycle : Cycle
    final : CorEstimate
        Estimate of the fitter, without contacts.
    decay, true_decay : Decay
        Speeds in its window.
    contacts : dict of str to ContactTerms
        By `_Row.contacts`.
    """

    cycle: Cycle
    final: CorEstimate
    decay: Decay
    true_decay: Decay
    contacts: dict[str, ContactTerms]


_Measurements = dict[tuple[int, str], list[_MeasuredCycle]]


def report() -> None:
    """Make missing films and print the tables."""
    for films in _FILMS.values():
        make(films, Workers())
    print_tables(_FILMS)


def print_tables(films: dict[str, list[Film]]) -> None:
    """Print the tables of the films that exist."""
    measured: _Measurements = {}
    for truth, some in films.items():
        for number, cycles in load(some).items():
            tray = load_trays()[number]
            results = [_measured_cycle(tray, cycle) for cycle in cycles]
            estimates = [result for result in results if result]
            print(
                f'tray {number}, {truth}: {len(cycles)} cycles, {len(estimates)} with an estimate'
            )
            if estimates:
                measured[number, truth] = estimates
    _print_speeds(measured)
    _print_single(measured)
    _print_together(measured)


def _measured_cycle(tray: Tray, cycle: Cycle) -> _MeasuredCycle | None:
    names = {'cooling.update_interval': 60.0, **_ALONE}
    fitter = RestitutionEstimator(with_values(PipelineSettings(), names, 'benchmark'), tray)
    estimates = [estimate for speed in cycle.speeds for estimate in fitter.push(speed)]
    # An undetermined estimate has no status COOLING, so the last estimate is used.
    *_, final = (None, *estimates, *fitter.flush())
    if final is None or final.status is CorStatus.COOLING:
        return None
    shake_ns = next(speed.cycle_start_ns for speed in cycle.speeds if speed.cycle_start_ns)
    first_ns, last_ns = (
        shake_ns + round(end * _NS) for end in (final.window_start, final.window_end)
    )
    used = [
        estimate
        for estimate in cycle.speeds
        if first_ns - 1000 <= estimate.stamp_ns <= last_ns + 1000
    ]
    time = np.array(
        [(estimate.stamp_ns - shake_ns) / _NS - final.cooling_start for estimate in used]
    )
    speed = np.array([estimate.mean_projected_speed.value for estimate in used])
    error = np.array([estimate.mean_projected_speed.error for estimate in used])
    true = np.array([_truth(cycle, estimate.stamp_ns / _NS, estimate.window) for estimate in used])
    known_ns = last_ns - KNOWN_AFTER_NS[PairCollision]
    complete = [contact for contact in cycle.contacts if contact.stamp_ns <= known_ns]
    return _MeasuredCycle(
        cycle=cycle,
        final=final,
        decay=Decay(time=time, speed=speed, error=error),
        true_decay=Decay(time=time, speed=true, error=error),
        contacts={
            'none': ContactTerms.of(()),
            'window': ContactTerms.of(
                contact for contact in complete if contact.stamp_ns >= first_ns
            ),
            'all': ContactTerms.of(
                contact for contact in complete if contact.stamp_ns >= shake_ns + _DELAY_NS
            ),
        },
    )


def _truth(cycle: Cycle, middle: float, window: float) -> float:
    inside = np.abs(cycle.time - middle) <= 0.5 * window + 1e-6
    return float(cycle.true_speed[inside].mean())


def _posterior(cycles: list[_MeasuredCycle], row: _Row) -> Posterior:
    """Posterior of some cycles of a tray, as in `LibraryReading`."""
    tray = load_trays()[cycles[0].cycle.tray]
    library = library_of(tray)
    prior = _TRAY_KNOWN if row.tray_known else _PRIOR
    tables = tables_of(library, tray, prior)
    camera = (math.hypot(prior.scale_error, library.misfit), prior.speed_bias)
    decays = [cycle.true_decay if row.true_speeds else cycle.decay for cycle in cycles]
    likelihoods = (
        decay_likelihood(tables, decay.time, decay.speed, decay.error, camera) for decay in decays
    )
    contacts = reduce(add, (cycle.contacts[row.contacts] for cycle in cycles))
    walls = cycles[0].cycle.walls
    return posterior_of(
        tables,
        reduce(add, likelihoods).integrated(),
        (walls, walls)
        if row.walls_known
        else (prior.min_wall_restitution, prior.max_wall_restitution),
        bead_likelihood=contacts.bead_likelihood(prior.collision_bias),
        wall_likelihood=contacts.wall_likelihood(prior.rebound_bias),
    )


def _print_speeds(measured: _Measurements) -> None:
    print('\nMeasured over true speed, and spread of the deviations in stated errors,')
    print('by the age of the window\n')
    titles = ' | '.join(f'{low:g} to {high:g} s' for low, high in _PARTS)
    print(f'| tray, beads / walls | window begins | contacts: of it | all | {titles} |')
    print('| --- ' * (4 + len(_PARTS)) + '|')
    for (number, truth), cycles in measured.items():
        start = np.median([cycle.final.window_start for cycle in cycles])
        row = f'| {number}, {truth} | {start:.1f} s '
        for kind in ('window', 'all'):
            counts = [
                (cycle.contacts[kind].rebounds, cycle.contacts[kind].collisions)
                for cycle in cycles
            ]
            rebounds, collisions = np.mean(counts, axis=0)
            row += f'| {rebounds:.0f} + {collisions:.0f} '
        age = np.concatenate([cycle.decay.time - cycle.decay.time[0] for cycle in cycles])
        ratio = np.concatenate([cycle.decay.speed / cycle.true_decay.speed for cycle in cycles])
        error = np.concatenate([cycle.decay.error / cycle.true_decay.speed for cycle in cycles])
        for low, high in _PARTS:
            part = (low <= age) & (age < high)
            spread = np.sqrt(np.mean(((ratio[part] - 1.0) / error[part]) ** 2))
            row += f'| {ratio[part].mean():.3f}, {spread:.2f} '
        print(row + '|', flush=True)


def _print_single(measured: _Measurements) -> None:
    print('\nOne cycle\n')
    head = '| tray, truth | from | cycles | beads: bias | sd | covered 68 % | 95 % | half '
    print(head + '| walls: bias | sd | covered 68 % | 95 % | half |')
    print('| --- ' * 13 + '|')
    for (number, truth), cycles in measured.items():
        label = f'| {number}, {truth} '
        for row_case in _ROWS:
            posteriors = [_posterior([cycle], row_case) for cycle in cycles]
            row = f'{label}| {row_case.name} | {len(cycles)} '
            row += _judged(
                [posterior.quantiles(_LEVELS) for posterior in posteriors],
                [cycle.cycle.pairs for cycle in cycles],
            )
            if row_case.walls_known:
                row += '| | | | | '
            else:
                row += _judged(
                    [posterior.wall_quantiles(_LEVELS) for posterior in posteriors],
                    [cycle.cycle.walls for cycle in cycles],
                )
            print(row + '|', flush=True)
        deviations = np.array(
            [cycle.final.paper_restitution - cycle.cycle.pairs for cycle in cycles]
        )
        print(
            f'{label}| paper | {deviations.size} | {deviations.mean():+.3f} '
            f'| {_sd(deviations):.3f} ' + '| ' * 9
        )


def _judged(estimates: list[np.ndarray], truth: list[float]) -> str:
    quantiles = np.array(estimates) - np.array(truth)[:, np.newaxis]
    middle = quantiles[:, 2]
    covered = [
        float(np.mean((quantiles[:, low] <= 0.0) & (quantiles[:, high] >= 0.0)))
        for low, high in ((1, 3), (0, 4))
    ]
    half = 0.5 * float((quantiles[:, 3] - quantiles[:, 1]).mean())
    row = f'| {middle.mean():+.3f} | {_sd(middle):.3f} '
    return row + f'| {covered[0]:.2f} | {covered[1]:.2f} | {half:.3f} '


def _print_together(measured: _Measurements) -> None:
    print(f'\n{_TOGETHER} cycles together: off by, stated standard deviation; each group\n')
    print('| tray, truth | from | beads | walls |\n| --- | --- | --- | --- |')
    for (number, truth), cycles in measured.items():
        if truth == 'drawn':
            continue
        for row_case in _ROWS:
            groups = [
                cycles[k : k + _TOGETHER] for k in range(0, len(cycles) - _TOGETHER + 1, _TOGETHER)
            ]
            posteriors = [_posterior(group, row_case) for group in groups]
            beads, walls = (
                ', '.join(
                    f'{posterior.mean[k] - true:+.4f}'
                    f' ± {math.sqrt(posterior.covariance[k, k]):.4f}'
                    for posterior in posteriors
                )
                for k, true in enumerate((cycles[0].cycle.pairs, cycles[0].cycle.walls))
            )
            if posteriors:
                walls_text = '' if row_case.walls_known else walls
                print(
                    f'| {number}, {truth} | {row_case.name} | {beads} | {walls_text} |', flush=True
                )


def _sd(values: np.ndarray) -> float:
    return float(values.std(ddof=1)) if values.size > 1 else math.nan
