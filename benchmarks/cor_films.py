"""Restitutions from films of whole cycles against their truth: bias, scatter and coverage.

Trays 1 and 3, filmed with all effects (lens, defocus, noise, uneven and flickering light, shadows,
glare on the plate, JPEG 85, and a plate that swings on its springs and knocks the beads) for
33 s after a shaking event that leaves a mean speed of 10 mm/s, by the stages as the pipeline
composes them. Each truth is filmed as the trays are in the books; "drawn" are films in which
each cell has restitutions (beads 0.7 to 0.95), floor and lid, height, diameter, count and start of
its own, from the defaults of `prior.`, of which the stages know nothing: there intervals should
cover as often as they say. "Nothing known": the defaults of `prior.`. "Tray known": floor and lid,
height, diameter, count and anisotropy are as in the books, and that is known. "Contacts": with
the rebounds and collisions of the same tracks. "True speeds": the same windows, but with the true
mean projected speeds, whose errors are those that were stated. Films are kept (`filmed_cycles`),
so that a second look takes seconds; NANOROCKS_FILMS names the folder.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
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

# Films of each: the first truth is what the goals are about.
_FILMS = {
    '0.89 / 0.97': [Film(pairs=0.89, walls=0.97, number=number) for number in range(9)],
    'drawn': [Film(number=number) for number in range(9)],
    '0.7 / 0.9': [Film(pairs=0.7, walls=0.9, number=0)],
    '0.8 / 0.97': [Film(pairs=0.8, walls=0.97, number=0)],
}
_TRAYS = (1, 3)
_TOGETHER = 18
_LEVELS = np.array([0.025, 0.16, 0.5, 0.84, 0.975])
_PAIR_GRID, _WALL_GRID = np.linspace(0.4, 1.0, 241), np.linspace(0.78, 1.0, 881)
_NS = 1e9
_PRIOR = PriorSettings()
_TRAY_KNOWN = replace(
    _PRIOR,
    floor_lid_spread=0.0,
    height_error=0.0,
    diameter_error=0.0,
    count_error=0.0,
    anisotropy_spread=0.0,
)
_ANY = (_PRIOR.wall_low, _PRIOR.wall_high)
# Beads that meet during the first moments were still being thrown about.
_FIRST_CONTACT = 1.75
# Parts of the window by the speed, of which the ratio to the truth is printed.
_PARTS = ((0.0, 4.0), (4.0, 8.0), (8.0, 14.0), (14.0, 21.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class _From:
    """A row of the table: what is used, and what is known.

    Parameters
    ----------
    name : str
    true_speeds, tray_known, walls_known, contacts : bool
    """

    name: str
    true_speeds: bool = False
    tray_known: bool = False
    walls_known: bool = False
    contacts: bool = False


_ROWS = (
    _From(name='true speeds, nothing known', true_speeds=True),
    _From(name='nothing known'),
    _From(name='walls known', walls_known=True),
    _From(name='walls and tray known', walls_known=True, tray_known=True),
    _From(name='contacts', contacts=True),
    _From(name='contacts, tray known', contacts=True, tray_known=True),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Said:
    """What one cycle says.

    Parameters
    ----------
    cycle : Cycle
    final : CorEstimate
        Of the fitter.
    decays : dict
        Likelihoods, by `_From.true_speeds` and `_From.tray_known`.
    of_beads, of_walls : ndarray
        Log likelihoods of the contacts.
    ratio, pull : ndarray (n,)
        Of each speed: over the truth, and its deviation in its own errors.
    age : ndarray (n,), [s]
        Of each speed, in the window.
    """

    cycle: Cycle
    final: CorEstimate
    decays: dict[tuple[bool, bool], DecayLikelihood]
    of_beads: np.ndarray
    of_walls: np.ndarray
    ratio: np.ndarray
    pull: np.ndarray
    age: np.ndarray


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
            judge = _Judge(load_trays()[number])
            found = [one for one in map(judge.said, cycles) if one]
            print(f'tray {number}, {truth}: {len(cycles)} cycles, {len(found)} with an estimate')
            if found:
                said[number, truth] = found
    _print_speeds(said)
    _print_table(said, 1)
    _print_table({key: one for key, one in said.items() if key[1] != 'drawn'}, _TOGETHER)


class _Judge:
    """Turns the records of cycles of one tray into what they say."""

    def __init__(self, tray: Tray) -> None:
        names = {'cooling.update_interval': 60.0}
        self._settings = with_values(PipelineSettings(), names, 'benchmark')
        self._tray = tray

    def said(self, cycle: Cycle) -> _Said | None:
        fitter = HaffFitter(self._settings, self._tray)
        made = [one for speed in cycle.speeds for one in fitter.push(speed)]
        # An estimate that is not yet known is not marked as cooling, so the last one it is.
        *_, final = (None, *made, *fitter.flush())
        if final is None or final.status is CorStatus.COOLING:
            return None
        shake = next(one.cycle_start_ns for one in cycle.speeds if one.cycle_start_ns) / _NS
        begin, end = shake + final.window_start - 1e-6, shake + final.window_end + 1e-6
        used = [one for one in cycle.speeds if begin <= one.stamp_ns / _NS <= end]
        middle = np.array([one.stamp_ns / _NS for one in used])
        speed = np.array([one.mean_projected_speed for one in used])
        error = np.array([one.mean_projected_speed_error for one in used])
        true = np.array([_truth(cycle, one.stamp_ns / _NS, one.window) for one in used])
        time = middle - shake - final.cooling_start
        first, last = shake + _FIRST_CONTACT, shake + final.window_end
        contacts = [one for one in cycle.contacts if first < one.stamp_ns / _NS < last]
        return _Said(
            cycle=cycle,
            final=final,
            decays={
                (is_true, known): self._likelihood(known, time, values, error)
                for is_true, values in ((False, speed), (True, true))
                for known in (False, True)
            },
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

    def _likelihood(
        self, known: bool, time: np.ndarray, speed: np.ndarray, error: np.ndarray
    ) -> DecayLikelihood:
        library = library_of(self._tray)
        camera = (math.hypot(_PRIOR.scale_error, library.misfit), _PRIOR.speed_bias)
        return decay_likelihood(_tables(self._tray.number, known), time, speed, error, camera)


def _tables(number: int, known: bool) -> DecayTables:
    tray = load_trays()[number]
    return tables_of(library_of(tray), tray, _TRAY_KNOWN if known else _PRIOR)


def _truth(cycle: Cycle, middle: float, window: float) -> float:
    inside = np.abs(cycle.time - middle) <= 0.5 * window + 1e-6
    return float(cycle.true_speed[inside].mean())


def _print_speeds(said: _All) -> None:
    print('\nMeasured over true speed, and spread of the deviations in stated errors,')
    print('by the age of the window\n')
    titles = ' | '.join(f'{low:g} to {high:g} s' for low, high in _PARTS)
    print(f'| tray, beads / walls | window begins | {titles} |')
    print('| --- ' * (2 + len(_PARTS)) + '|')
    for (number, truth), cycles in said.items():
        start = np.median([one.final.window_start for one in cycles])
        row = f'| {number}, {truth} | {start:.1f} s '
        age, ratio, pull = (
            np.concatenate([getattr(one, name) for one in cycles])
            for name in ('age', 'ratio', 'pull')
        )
        for low, high in _PARTS:
            part = (low <= age) & (age < high)
            row += '| '
            if part.any():
                row += f'{ratio[part].mean():.3f}, {np.sqrt(np.mean(pull[part] ** 2)):.2f} '
        print(row + '|', flush=True)


def _print_table(said: _All, together: int) -> None:
    many = f'{together} cycles together' if together > 1 else 'One cycle'
    print(f'\n{many}\n')
    head = '| tray, truth | from | number | beads: bias | sd | covered 68 % | 95 % | half '
    print(head + '| walls: bias | sd | covered 68 % | 95 % | half |')
    print('| --- ' * 13 + '|')
    for (number, truth), cycles in said.items():
        groups = [cycles[k : k + together] for k in range(0, len(cycles) - together + 1, together)]
        if not groups:
            continue
        pairs, walls = (
            np.array([getattr(one[0].cycle, name) for one in groups])
            for name in ('pairs', 'walls')
        )
        begin = f'| {number}, {truth} '
        for how in _ROWS:
            found = [_posterior(number, one, how) for one in groups]
            row = f'{begin}| {how.name} | {len(groups)} '
            row += _judged([one.quantiles(_LEVELS) for one in found], pairs)
            if how.walls_known:
                row += '| | | | | '
            else:
                row += _judged([one.wall_quantiles(_LEVELS) for one in found], walls)
            print(row + '|', flush=True)
        paper = [np.mean([one.final.paper_restitution for one in group]) for group in groups]
        off = np.array(paper) - pairs
        print(f'{begin}| paper | {len(groups)} | {off.mean():+.3f} | {_sd(off):.3f} ' + '| ' * 9)


def _posterior(number: int, cycles: list[_Said], how: _From) -> Posterior:
    total, *rest = (one.decays[how.true_speeds, how.tray_known] for one in cycles)
    for one in rest:
        total = total + one
    walls = cycles[0].cycle.walls
    beads = SingleTerm(
        restitution=_PAIR_GRID, log_likelihood=np.sum([one.of_beads for one in cycles], axis=0)
    )
    wall = SingleTerm(
        restitution=_WALL_GRID, log_likelihood=np.sum([one.of_walls for one in cycles], axis=0)
    )
    return posterior_of(
        _tables(number, how.tray_known),
        total.integrated(),
        (walls, walls) if how.walls_known else _ANY,
        of_beads=beads if how.contacts else None,
        of_walls=wall if how.contacts else None,
    )


def _judged(found: list[np.ndarray], truth: np.ndarray) -> str:
    quantiles = np.array(found) - truth[:, np.newaxis]
    middle = quantiles[:, 2]
    covered = [
        float(np.mean((quantiles[:, low] <= 0.0) & (quantiles[:, high] >= 0.0)))
        for low, high in ((1, 3), (0, 4))
    ]
    half = 0.5 * float((quantiles[:, 3] - quantiles[:, 1]).mean())
    row = f'| {middle.mean():+.3f} | {_sd(middle):.3f} '
    return row + f'| {covered[0]:.2f} | {covered[1]:.2f} | {half:.3f} '


def _sd(values: np.ndarray) -> float:
    return float(values.std(ddof=1)) if values.size > 1 else math.nan
