"""Restitutions from films of whole cycles against their truth: bias, scatter and coverage.

Trays 1 and 3, filmed with all effects (lens, defocus, noise, uneven and flickering light, shadows,
glare on the plate, JPEG 85, and a plate that swings on its springs and knocks the beads) for
33 s after a shaking event that leaves a mean speed of 10 mm/s, by the stages as the pipeline
composes them. Each truth is filmed as the trays are in the books; "drawn" are films in which
each cell has restitutions (beads 0.7 to 0.95), floor and lid, height, diameter, count and start of
its own, from the defaults of `prior.`, of which the stages know nothing: there intervals should
cover as often as they say. "All": decay, rebounds and collisions, as published by default.
"Tray known": floor and lid, height, diameter, count and anisotropy are as in the books, and that
is known. "True speeds": the same windows, but with the true mean projected speeds, whose errors
are those that were stated. Films are kept (`filmed_cycles`), so that a second look takes a
minute; NANOROCKS_FILMS names the folder. One film takes about a minute.
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
from nanorocks_ros.stages.restitution.restitution_methods import Decay

# Films of each: the first truth is what the goals are about.
_FILMS = {
    '0.89 / 0.97': [Film(pairs=0.89, walls=0.97, number=number) for number in range(12)],
    'drawn': [Film(number=number) for number in range(11)],
    '0.7 / 0.9': [Film(pairs=0.7, walls=0.9, number=0)],
    '0.8 / 0.97': [Film(pairs=0.8, walls=0.97, number=0)],
}
_TOGETHER = 18
_LEVELS = np.array([0.025, 0.16, 0.5, 0.84, 0.975])
_NS = 1e9
# Parts of the window of which the ratio of speeds to the truth is printed, [s].
_PARTS = ((0.0, 4.0), (4.0, 8.0), (8.0, 14.0), (14.0, 21.0))
_DELAY_NS = 1_750_000_000
_ALONE = {'cooling.rebounds': False, 'cooling.collisions': False}
_PRIOR = PriorSettings()
_TRAY_KNOWN = replace(
    _PRIOR,
    floor_lid_spread=0.0,
    height_error=0.0,
    diameter_error=0.0,
    count_error=0.0,
    anisotropy_spread=0.0,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _From:
    """A row of the table: what is used, and what is known.

    Parameters
    ----------
    name : str
    true_speeds, tray_known, walls_known : bool
    contacts : str
        Those of the 'window', 'all' since the shaking was over, or 'none'.
    """

    name: str
    true_speeds: bool = False
    tray_known: bool = False
    walls_known: bool = False
    contacts: str = 'none'


_ROWS = (
    _From(name='decay of true speeds', true_speeds=True),
    _From(name='decay'),
    _From(name='decay, walls known', walls_known=True),
    _From(name='decay, walls and tray known', walls_known=True, tray_known=True),
    _From(name='all, contacts of the window', contacts='window'),
    _From(name='all', contacts='all'),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Said:
    """What the stages made of one cycle.

    Parameters
    ----------
    cycle : Cycle
    final : CorEstimate
        Of the fitter, without contacts.
    decay, true_decay : Decay
        Of its window.
    contacts : dict of str to ContactTerms
        By `_From.contacts`.
    """

    cycle: Cycle
    final: CorEstimate
    decay: Decay
    true_decay: Decay
    contacts: dict[str, ContactTerms]


_All = dict[tuple[int, str], list[_Said]]


def report() -> None:
    """Make the films that are missing and print the tables."""
    for films in _FILMS.values():
        make(films, Workers())
    print_tables(_FILMS)


def print_tables(films: dict[str, list[Film]]) -> None:
    """Print the tables of those films that there are."""
    said: _All = {}
    for truth, some in films.items():
        for number, cycles in load(some).items():
            tray = load_trays()[number]
            found = [one for one in (_said(tray, cycle) for cycle in cycles) if one]
            print(f'tray {number}, {truth}: {len(cycles)} cycles, {len(found)} with an estimate')
            if found:
                said[number, truth] = found
    _print_speeds(said)
    _print_single(said)
    _print_together(said)


def _said(tray: Tray, cycle: Cycle) -> _Said | None:
    names = {'cooling.update_interval': 60.0, **_ALONE}
    fitter = RestitutionEstimator(with_values(PipelineSettings(), names, 'benchmark'), tray)
    made = [estimate for speed in cycle.speeds for estimate in fitter.push(speed)]
    # An estimate that is not yet known is not marked as cooling, so the last one it is.
    *_, final = (None, *made, *fitter.flush())
    if final is None or final.status is CorStatus.COOLING:
        return None
    shake_ns = next(one.cycle_start_ns for one in cycle.speeds if one.cycle_start_ns)
    first_ns, last_ns = (
        shake_ns + round(one * _NS) for one in (final.window_start, final.window_end)
    )
    used = [one for one in cycle.speeds if first_ns - 1000 <= one.stamp_ns <= last_ns + 1000]
    time = np.array(
        [(estimate.stamp_ns - shake_ns) / _NS - final.cooling_start for estimate in used]
    )
    speed = np.array([estimate.mean_projected_speed.value for estimate in used])
    error = np.array([estimate.mean_projected_speed.error for estimate in used])
    true = np.array([_truth(cycle, estimate.stamp_ns / _NS, estimate.window) for estimate in used])
    ripe = [
        contact
        for contact in cycle.contacts
        if contact.stamp_ns <= last_ns - KNOWN_AFTER_NS[PairCollision]
    ]
    return _Said(
        cycle=cycle,
        final=final,
        decay=Decay(time=time, speed=speed, error=error),
        true_decay=Decay(time=time, speed=true, error=error),
        contacts={
            'none': ContactTerms.of(()),
            'window': ContactTerms.of(one for one in ripe if one.stamp_ns >= first_ns),
            'all': ContactTerms.of(one for one in ripe if one.stamp_ns >= shake_ns + _DELAY_NS),
        },
    )


def _truth(cycle: Cycle, middle: float, window: float) -> float:
    inside = np.abs(cycle.time - middle) <= 0.5 * window + 1e-6
    return float(cycle.true_speed[inside].mean())


def _posterior(cycles: list[_Said], how: _From) -> Posterior:
    """What `DecayLibraryMethod` makes of some cycles of a tray."""
    tray = load_trays()[cycles[0].cycle.tray]
    library = library_of(tray)
    prior = _TRAY_KNOWN if how.tray_known else _PRIOR
    tables = tables_of(library, tray, prior)
    camera = (math.hypot(prior.scale_error, library.misfit), prior.speed_bias)
    decays = [cycle.true_decay if how.true_speeds else cycle.decay for cycle in cycles]
    likelihoods = (
        decay_likelihood(tables, decay.time, decay.speed, decay.error, camera) for decay in decays
    )
    contacts = reduce(add, (cycle.contacts[how.contacts] for cycle in cycles))
    walls = cycles[0].cycle.walls
    return posterior_of(
        tables,
        reduce(add, likelihoods).integrated(),
        (walls, walls)
        if how.walls_known
        else (prior.min_wall_restitution, prior.max_wall_restitution),
        bead_likelihood=contacts.bead_likelihood(prior.collision_bias),
        wall_likelihood=contacts.wall_likelihood(prior.rebound_bias),
    )


def _print_speeds(said: _All) -> None:
    print('\nMeasured over true speed, and spread of the deviations in stated errors,')
    print('by the age of the window\n')
    titles = ' | '.join(f'{low:g} to {high:g} s' for low, high in _PARTS)
    print(f'| tray, beads / walls | window begins | contacts: of it | all | {titles} |')
    print('| --- ' * (4 + len(_PARTS)) + '|')
    for (number, truth), cycles in said.items():
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


def _print_single(said: _All) -> None:
    print('\nOne cycle\n')
    head = '| tray, truth | from | cycles | beads: bias | sd | covered 68 % | 95 % | half '
    print(head + '| walls: bias | sd | covered 68 % | 95 % | half |')
    print('| --- ' * 13 + '|')
    for (number, truth), cycles in said.items():
        begin = f'| {number}, {truth} '
        for how in _ROWS:
            posteriors = [_posterior([cycle], how) for cycle in cycles]
            row = f'{begin}| {how.name} | {len(cycles)} '
            row += _judged(
                [posterior.quantiles(_LEVELS) for posterior in posteriors],
                [one.cycle.pairs for one in cycles],
            )
            if how.walls_known:
                row += '| | | | | '
            else:
                row += _judged(
                    [posterior.wall_quantiles(_LEVELS) for posterior in posteriors],
                    [one.cycle.walls for one in cycles],
                )
            print(row + '|', flush=True)
        off = np.array([one.final.paper_restitution - one.cycle.pairs for one in cycles])
        print(f'{begin}| paper | {off.size} | {off.mean():+.3f} | {_sd(off):.3f} ' + '| ' * 9)


def _judged(found: list[np.ndarray], truth: list[float]) -> str:
    quantiles = np.array(found) - np.array(truth)[:, np.newaxis]
    middle = quantiles[:, 2]
    covered = [
        float(np.mean((quantiles[:, low] <= 0.0) & (quantiles[:, high] >= 0.0)))
        for low, high in ((1, 3), (0, 4))
    ]
    half = 0.5 * float((quantiles[:, 3] - quantiles[:, 1]).mean())
    row = f'| {middle.mean():+.3f} | {_sd(middle):.3f} '
    return row + f'| {covered[0]:.2f} | {covered[1]:.2f} | {half:.3f} '


def _print_together(said: _All) -> None:
    print(f'\n{_TOGETHER} cycles together: off by, stated standard deviation; each group\n')
    print('| tray, truth | from | beads | walls |\n| --- | --- | --- | --- |')
    for (number, truth), cycles in said.items():
        if truth == 'drawn':
            continue
        for how in _ROWS:
            groups = [
                cycles[k : k + _TOGETHER] for k in range(0, len(cycles) - _TOGETHER + 1, _TOGETHER)
            ]
            posteriors = [_posterior(one, how) for one in groups]
            beads, walls = (
                ', '.join(
                    f'{posterior.mean[k] - true:+.4f}'
                    f' ± {math.sqrt(posterior.covariance[k, k]):.4f}'
                    for posterior in posteriors
                )
                for k, true in enumerate((cycles[0].cycle.pairs, cycles[0].cycle.walls))
            )
            if posteriors:
                known = '' if how.walls_known else walls
                print(f'| {number}, {truth} | {how.name} | {beads} | {known} |', flush=True)


def _sd(values: np.ndarray) -> float:
    return float(values.std(ddof=1)) if values.size > 1 else math.nan
