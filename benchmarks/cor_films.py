"""Restitutions from films of whole cycles against their truth: bias, scatter and coverage.

Trays 1 and 3, filmed with all effects (lens, defocus, noise, uneven and flickering light, shadows,
glare on the plate, JPEG 85, and a plate that swings on its springs and knocks the beads) for
38 s after a shaking event that leaves a mean speed of 10 mm/s, by the stages as the pipeline
composes them. "Nothing known": the defaults of `prior.`. "Decay, contacts": with the rebounds and
collisions of the same tracks, all else as before. "True speeds": the same windows, but with the
true mean projected speeds, whose errors are those that were stated. Coverage: how many intervals
of 68 and 95 % hold the truth. Films are kept (`filmed_cycles`), so that a second look takes
seconds; NANOROCKS_FILMS names the folder.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.filmed_cycles import Cycle, Film, load, make
from nanorocks_ros.experiment.settings import PipelineSettings, PriorSettings, with_values
from nanorocks_ros.experiment.trays import Tray, load_trays
from nanorocks_ros.inference.contacts import pair_log_likelihood, rebound_log_likelihood
from nanorocks_ros.inference.decay_library import library_of
from nanorocks_ros.inference.decay_likelihood import DecayLikelihood, decay_likelihood
from nanorocks_ros.inference.restitution import Posterior, SingleTerm, posterior_of, tables_of
from nanorocks_ros.records import CorEstimate, CorStatus, PairCollision, Rebound
from nanorocks_ros.stages.cooling import HaffFitter
from nanorocks_ros.study.tasks import Workers

if TYPE_CHECKING:
    from nanorocks_ros.inference.decay_likelihood import DecayTables

# Restitutions of beads and walls, and films of each: the first is what the goals are about.
_TRUTHS = ((0.89, 0.97, 50), (0.7, 0.9, 6), (0.8, 0.97, 6))
_TRAYS = (1, 3)
_TOGETHER = 18
_LEVELS = np.array([0.025, 0.16, 0.5, 0.84, 0.975])
_PAIR_GRID, _WALL_GRID = np.linspace(0.4, 1.0, 241), np.linspace(0.78, 1.0, 881)
_NS = 1e9
# Beads that meet during the first moments were still being thrown about.
_FIRST_CONTACT = 1.75
# Parts of the window by the speed, of which the ratio to the truth is printed.
_PARTS = ((0.0, 4.0), (4.0, 8.0), (8.0, 14.0), (14.0, 21.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Said:
    """What one cycle says.

    Parameters
    ----------
    final : CorEstimate
        Of the fitter.
    decay, true_decay : DecayLikelihood
        By measured and by true speeds.
    of_beads, of_walls : ndarray
        Log likelihoods of the contacts.
    ratio, pull : ndarray (n,)
        Of each speed: over the truth, and its deviation in its own errors.
    age : ndarray (n,), [s]
        Of each speed, in the window.
    """

    final: CorEstimate
    decay: DecayLikelihood
    true_decay: DecayLikelihood
    of_beads: np.ndarray
    of_walls: np.ndarray
    ratio: np.ndarray
    pull: np.ndarray
    age: np.ndarray


def report() -> None:
    """Make the films that are missing and print the tables."""
    for pairs, walls, count in _TRUTHS:
        films = [Film(pairs=pairs, walls=walls, number=number) for number in range(count)]
        make(films, Workers())
    report_made()


def report_made() -> None:
    """Print the tables of the films that there are."""
    said = {}
    for pairs, walls, count in _TRUTHS:
        films = [Film(pairs=pairs, walls=walls, number=number) for number in range(count)]
        for number, cycles in load(films).items():
            judge = _Judge(load_trays()[number])
            said[number, pairs, walls] = [one for one in map(judge.said, cycles) if one]
            print(
                f'tray {number}, {pairs:g} / {walls:g}: {len(cycles)} cycles, '
                f'{len(said[number, pairs, walls])} of them with an estimate'
            )
    _print_speeds(said)
    _print_table(said, 1)
    _print_table(said, _TOGETHER)


class _Judge:
    """Turns the records of cycles of one tray into what they say."""

    def __init__(self, tray: Tray) -> None:
        names = {'cooling.update_interval': 60.0}
        self._settings = with_values(PipelineSettings(), names, 'benchmark')
        self._tray = tray
        prior = PriorSettings()
        library = library_of(tray)
        self._tables = tables_of(library, tray, prior)
        self._camera = (math.hypot(prior.scale_error, library.misfit), prior.speed_bias)

    def said(self, cycle: Cycle) -> _Said | None:
        fitter = HaffFitter(self._settings, self._tray)
        made = [one for speed in cycle.speeds for one in fitter.push(speed)]
        # An estimate that is not yet known is not marked as cooling, so the last one it is.
        *_, final = (None, *made, *fitter.flush())
        if final is None or final.status is CorStatus.COOLING:
            return None
        shake = next(one.cycle_start_ns for one in cycle.speeds if one.cycle_start_ns) / _NS
        used = [
            one
            for one in cycle.speeds
            if final.window_start - 1e-6 <= one.stamp_ns / _NS - shake <= final.window_end + 1e-6
            and one.mean_projected_speed > 0.0
        ]
        middle = np.array([one.stamp_ns / _NS for one in used])
        speed = np.array([one.mean_projected_speed for one in used])
        error = np.array([one.mean_projected_speed_error for one in used])
        true = np.array([_truth(cycle, one.stamp_ns / _NS, one.window) for one in used])
        time = middle - shake - final.cooling_start
        contacts = [one for one in cycle.contacts if one.stamp_ns / _NS - shake > _FIRST_CONTACT]
        return _Said(
            final=final,
            decay=decay_likelihood(self._tables, time, speed, error, self._camera),
            true_decay=decay_likelihood(self._tables, time, true, error, self._camera),
            of_beads=pair_log_likelihood(
                [one for one in contacts if isinstance(one, PairCollision)], _PAIR_GRID
            ),
            of_walls=rebound_log_likelihood(
                [one for one in contacts if isinstance(one, Rebound)], _WALL_GRID
            ),
            ratio=speed / true,
            pull=(speed - true) / error,
            age=middle - middle[0],
        )


def _truth(cycle: Cycle, middle: float, window: float) -> float:
    inside = np.abs(cycle.time - middle) <= 0.5 * window + 1e-6
    return float(cycle.true_speed[inside].mean())


_All = dict[tuple[int, float, float], list[_Said]]


def _print_speeds(said: _All) -> None:
    print('\nMeasured over true speed, and spread of the deviations in stated errors,')
    print('by the age of the window\n')
    titles = ' | '.join(f'{low:g} to {high:g} s' for low, high in _PARTS)
    print(f'| tray, beads / walls | window begins | {titles} |')
    print('| --- ' * (2 + len(_PARTS)) + '|')
    for (number, pairs, walls), cycles in said.items():
        if not cycles:
            continue
        start = np.median([one.final.window_start for one in cycles])
        row = f'| {number}, {pairs:g} / {walls:g} | {start:.1f} s '
        age, ratio, pull = (
            np.concatenate([getattr(one, name) for one in cycles])
            for name in ('age', 'ratio', 'pull')
        )
        for low, high in _PARTS:
            part = (low <= age) & (age < high)
            if not part.any():
                row += '| '
                continue
            deviation = np.sqrt(np.mean(pull[part] ** 2))
            row += f'| {ratio[part].mean():.3f}, {deviation:.2f} '
        print(row + '|', flush=True)


def _print_table(said: _All, together: int) -> None:
    many = f'{together} cycles together' if together > 1 else 'One cycle'
    print(f'\n{many}\n')
    head = '| tray, truth | from | number | beads: bias | sd | covered 68 % | 95 % | half '
    print(head + '| walls: bias | sd | covered 68 % | 95 % |')
    print('| --- ' * 12 + '|')
    for (number, pairs, walls), cycles in said.items():
        groups = [cycles[k : k + together] for k in range(0, len(cycles) - together + 1, together)]
        if not groups:
            continue
        prior = PriorSettings()
        anything = (prior.wall_low, prior.wall_high)
        for name, speeds, contacts, known in (
            ('true speeds', 'true_decay', False, anything),
            ('decay, nothing known', 'decay', False, anything),
            ('true speeds, walls known', 'true_decay', False, (walls, walls)),
            ('decay, walls known', 'decay', False, (walls, walls)),
            ('decay, contacts', 'decay', True, anything),
        ):
            found = [_posterior(number, one, speeds, contacts, known) for one in groups]
            row = f'| {number}, {pairs:g} / {walls:g} | {name} | {len(groups)} '
            row += _judged([one.quantiles(_LEVELS) for one in found], pairs, width=True)
            if known == anything:
                row += _judged([one.wall_quantiles(_LEVELS) for one in found], walls)
            else:
                row += '| | | | '
            print(row + '|', flush=True)
        paper = [np.mean([one.final.paper_restitution for one in group]) for group in groups]
        print(
            f'| {number}, {pairs:g} / {walls:g} | paper | {len(groups)} '
            f'| {np.mean(paper) - pairs:+.3f} | {_sd(np.array(paper)):.3f} | | | | | | | |'
        )


def _posterior(
    number: int, cycles: list[_Said], speeds: str, contacts: bool, walls: tuple[float, float]
) -> Posterior:
    tray = load_trays()[number]
    tables: DecayTables = tables_of(library_of(tray), tray, PriorSettings())
    total, *rest = (getattr(one, speeds) for one in cycles)
    for one in rest:
        total = total + one
    beads = SingleTerm(
        restitution=_PAIR_GRID, log_likelihood=np.sum([one.of_beads for one in cycles], axis=0)
    )
    wall = SingleTerm(
        restitution=_WALL_GRID, log_likelihood=np.sum([one.of_walls for one in cycles], axis=0)
    )
    return posterior_of(
        tables,
        total.integrated(),
        walls,
        of_beads=beads if contacts else None,
        of_walls=wall if contacts else None,
    )


def _judged(found: list[np.ndarray], truth: float, *, width: bool = False) -> str:
    quantiles = np.array(found)
    middle = quantiles[:, 2]
    covered = [
        float(np.mean((quantiles[:, low] <= truth) & (truth <= quantiles[:, high])))
        for low, high in ((1, 3), (0, 4))
    ]
    row = f'| {middle.mean() - truth:+.3f} | {_sd(middle):.3f} '
    row += f'| {covered[0]:.2f} | {covered[1]:.2f} '
    half = 0.5 * float((quantiles[:, 3] - quantiles[:, 1]).mean())
    return row + (f'| {half:.3f} ' if width else '')


def _sd(values: np.ndarray) -> float:
    return float(values.std(ddof=1)) if values.size > 1 else math.nan
