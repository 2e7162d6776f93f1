"""Films of drawn cameras, drawn trays and other code: restitutions, speeds and counts in them.

Drawn films (`drawn_films`): the pipeline is told the tray's nominal values, the scale and where
the floor is. Films by other code are read from the folder ``NANOROCKS_FOREIGN``, by default
``../shared/data/foreign``: videos with their truth in ``.npz`` files. ``NANOROCKS_FILM_COUNT`` is
the number of films a tray, 50 by default; ``NANOROCKS_DRAWN_FILMS`` names films by tray and number
instead: ``3_12,5_0``.
"""

from __future__ import annotations

import math
import os
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.stats import chisquare

from benchmarks.drawn_films import DrawnFilm, ReadFilm, draw, film_count, measured
from benchmarks.film_measurement import DECADES, FilmResult, is_flagged
from benchmarks.film_truth import FilmTruth
from nanorocks_ros.records import CorStatus, Quality
from nanorocks_ros.settings import PriorSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.records import Interval

FOREIGN = 'NANOROCKS_FOREIGN'
"""Environment variable with the folder of films made by other code."""
DRAWN = 'NANOROCKS_DRAWN_FILMS'
"""Environment variable with trays and numbers of the drawn films."""
_TRAYS = (1, 3, 5, 7)
_HALF_WIDTHS = 3.0
# Half of an interval of 95 % in standard deviations.
_SIGMAS = 1.96
# Parts of a posterior below the limits of its intervals of 95 and 68 %, and its median.
_QUANTILES = (0.0, 0.025, 0.16, 0.5, 0.84, 0.975, 1.0)
# Systematic errors of a film that are compared.
_SYSTEMATIC = np.arange(0.0002, 0.05, 0.0002)
# Factor within which stated errors count as right.
_FACTOR = 1.5


def report() -> None:
    """Make missing films, measure in all, and print the tables."""
    draw(_all_drawn())
    read = measured(films_drawn())
    print_drawn(read)
    foreign = films_by_other_code()
    if foreign:
        read_foreign = measured(foreign)
        print_foreign(read_foreign)
        read += read_foreign
    else:
        print(f'\nNo films by other code: set {FOREIGN} to a folder that holds some.')
    print_errors(read)


def films_drawn() -> list[Path]:
    """The drawn films that exist."""
    return [video for film in _all_drawn() if (video := film.video)]


def films_by_other_code() -> list[Path]:
    """The films by other code; none where there is no such folder."""
    default = Path(__file__).resolve().parents[2] / 'shared' / 'data' / 'foreign'
    return sorted(Path(os.environ.get(FOREIGN, default)).glob('*.mp4'))


def _all_drawn() -> list[DrawnFilm]:
    named = [name.split('_') for name in os.environ.get(DRAWN, '').split(',') if name]
    if named:
        return [DrawnFilm(tray=int(tray), number=int(number)) for tray, number in named]
    return [
        DrawnFilm(tray=tray, number=number) for number in range(film_count()) for tray in _TRAYS
    ]


def print_drawn(read: list[ReadFilm]) -> None:
    """Print what is measured in drawn films, tray by tray."""
    print('\nDrawn films: restitutions of the unflagged final estimates\n')
    print_restitutions(read)
    print('\nDrawn films: truths between the quantiles of the posterior\n')
    print_ranks(read)
    print('\nDrawn films: restitutions by contacts alone, in flagged films, too\n')
    print_contacts(read)
    print('\nDrawn films: measured over true; speeds by true mean projected speed in mm/s\n')
    groups = ' | '.join(f'{1e3 * low:g} to {1e3 * high:g}' for low, high in pairwise(DECADES))
    print(f'| tray | {groups} | speeds flagged | beads counted, by species | radii, by species |')
    print('| --- ' * (4 + len(DECADES) - 1) + '|')
    for tray, films in _by_tray(read).items():
        print(_speed_row(tray, [read_film.result for read_film in films]))
    print('\nDrawn films: errors of speeds over stated ones, and the share below twice of them\n')
    print(f'| tray | {groups} |')
    print('| --- ' * len(DECADES) + '|')
    for tray, films in _by_tray(read).items():
        print(_pull_row(tray, [read_film.result for read_film in films]))
    print('\nDrawn films: measured over true speeds, film by film\n')
    print(f'| film | {groups} | speeds flagged |')
    print('| --- ' * (2 + len(DECADES) - 1) + '|')
    for read_film in read:
        ratios = ' | '.join(f'{ratio:.3f}' for ratio in read_film.result.speed_ratios)
        name = read_film.film.video.stem
        print(f'| {name} | {ratios} | {read_film.result.flagged_speeds:.2f} |')


def print_restitutions(read: list[ReadFilm]) -> None:
    """Print biases and coverages of restitutions, tray by tray."""
    print(
        '| tray | films | one cycle | final, unflagged | beads: bias | sd | covered 68 % | 95 % '
        '| half | walls: bias | covered 95 % | far off, unflagged |'
    )
    print('| --- ' * 12 + '|')
    for tray, films in _by_tray(read).items():
        print(_restitution_row(tray, films))


def print_ranks(read: list[ReadFilm]) -> None:
    """Print how many truths lie between the quantiles of unflagged posteriors, tray by tray.

    Rank statistics in six bins: as many as their widths say if posteriors are right.
    """
    bins = ' | '.join(f'{100 * low:g} to {100 * high:g} %' for low, high in pairwise(_QUANTILES))
    print(f'| tray | of | films | {bins} | χ² p |')
    print('| --- ' * (3 + len(_QUANTILES)) + '|')
    by_tray = {str(tray): films for tray, films in _by_tray(read).items()}
    for name, films in [*by_tray.items(), ('all', read)]:
        final = [film for film in films if film.is_unflagged]
        for truth, field in (('beads', 'restitution'), ('walls', 'wall_restitution')):
            print(f'| {name} | {truth} {_rank_cells(final, truth, field)}|')


def _rank_cells(films: list[ReadFilm], truth: str, field: str) -> str:
    counts = np.zeros(len(_QUANTILES) - 1, dtype=np.int64)
    for film in films:
        wide, narrow = (
            getattr(cycles[0], field) for cycles in (film.result.cycles, film.result.sure)
        )
        limits = (wide.lower, narrow.lower, wide.value, narrow.upper, wide.upper)
        if np.isfinite(limits).all():
            counts[np.searchsorted(limits, getattr(film.film, truth))] += 1
    row = f'| {counts.sum()} ' + ''.join(f'| {count} ' for count in counts)
    if not counts.any():
        return row + '| '
    return row + f'| {chisquare(counts, counts.sum() * np.diff(_QUANTILES)).pvalue:.2g} '


def print_contacts(read: list[ReadFilm]) -> None:
    """Print errors of what contacts say over the stated ones, tray by tray and of all.

    The last column tells which systematic error of a film, normally distributed from film to film,
    fits best beside the errors that contacts tell, and which fits less by 2 in the logarithm.
    """
    print(
        '| tray | of | films | contacts | mean error over stated | root mean square '
        '| covered 68 % | weighted bias | systematic error of a film: best, at most |'
    )
    print('| --- ' * 9 + '|')
    prior = PriorSettings()
    by_tray = {str(tray): films for tray, films in _by_tray(read).items()}
    for kind in (
        _Contacts('beads', 'contact_restitution', 'collisions', prior.collision_bias),
        _Contacts('walls', 'contact_wall_restitution', 'rebounds', prior.rebound_bias),
    ):
        for name, films in [*by_tray.items(), ('all', read)]:
            print(f'| {name} | {kind.truth} {_contact_cells(kind, films)}|')


class _Contacts(NamedTuple):
    """Contacts of a kind: names of the truth, of the interval and of their number; stated bias."""

    truth: str
    interval: str
    number: str
    bias: float


def _contact_cells(kind: _Contacts, films: list[ReadFilm]) -> str:
    contacts, truths, wide, narrow = 0, [], [], []
    for read_film in films:
        if len(read_film.result.cycles) != 1:
            continue
        cycle, sure = read_film.result.cycles[0], read_film.result.sure[0]
        truth, number = getattr(read_film.film, kind.truth), getattr(cycle, kind.number)
        limits = _limits(getattr(cycle, kind.interval))
        if number and limits[2] > limits[1] and math.isfinite(truth):
            contacts += number
            truths.append(truth)
            wide.append(limits)
            narrow.append(_limits(getattr(sure, kind.interval)))
    if not truths:
        return '| 0 ' + '| ' * 6
    value, lower, upper = np.transpose(wide)
    errors, stated = value - truths, 0.5 * (upper - lower) / _SIGMAS
    ratios, weights = errors / stated, stated**-2.0
    return (
        f'| {len(truths)} | {contacts} | {ratios.mean():+.2f} '
        f'| {math.sqrt(np.mean(ratios**2)):.2f} '
        f'| {_covered(np.array(narrow), np.array(truths))} '
        f'| {np.average(errors, weights=weights):+.4f} ± {weights.sum() ** -0.5:.4f} '
        f'| {_systematic_cell(errors, stated, kind.bias)} '
    )


def _systematic_cell(errors: NDArray[np.float64], stated: NDArray[np.float64], bias: float) -> str:
    """The systematic error that fits best, and that whose log likelihood is lower by 2.

    The stated errors contain the standard deviation `bias` of such an error.
    """
    of_contacts = np.maximum(stated**2 - bias**2, 0.0)
    variances = of_contacts + _SYSTEMATIC[:, np.newaxis] ** 2
    logs = -0.5 * np.sum(errors**2 / variances + np.log(variances), axis=1)
    allowed = _SYSTEMATIC[logs > logs.max() - 2.0]
    return f'{_SYSTEMATIC[logs.argmax()]:.4f}, {allowed.max():.4f}'


def _by_tray(read: list[ReadFilm]) -> dict[int, list[ReadFilm]]:
    trays = sorted({read_film.film.tray for read_film in read})
    return {
        tray: [read_film for read_film in read if read_film.film.tray == tray] for tray in trays
    }


def _restitution_row(tray: int, films: list[ReadFilm]) -> str:
    final = [film for film in films if film.is_unflagged]
    single = sum(len(read_film.result.cycles) == 1 for read_film in films)
    row = f'| {tray} | {len(films)} | {single} '
    row += f'| {len(final)} '
    if not final:
        return row + '| ' * 8 + '|'
    beads, walls = (
        np.array([getattr(read_film.film, name) for read_film in final])
        for name in ('beads', 'walls')
    )
    wide = np.array([_limits(read_film.result.cycles[0].restitution) for read_film in final])
    narrow = np.array([_limits(read_film.result.sure[0].restitution) for read_film in final])
    of_walls = np.array(
        [_limits(read_film.result.cycles[0].wall_restitution) for read_film in final]
    )
    error, half = wide[:, 0] - beads, 0.5 * (wide[:, 2] - wide[:, 1])
    far = int(np.sum(np.abs(error) > _HALF_WIDTHS * half))
    row += f'| {_bias(error)}'
    row += f'| {_covered(narrow, beads)} | {_covered(wide, beads)} | {half.mean():.3f} '
    bias_of_walls = np.nanmean(of_walls[:, 0] - walls)
    return row + f'| {bias_of_walls:+.4f} | {_covered(of_walls, walls)} | {far} |'


def _bias(error: NDArray[np.float64]) -> str:
    """Mean and scatter of errors, for two columns; of a single film no scatter is known."""
    if error.size < 2:
        return f'{error.mean():+.4f} | - '
    standard_error = error.std(ddof=1) / math.sqrt(error.size)
    return f'{error.mean():+.4f} ± {standard_error:.4f} | {error.std():.3f} '


def _limits(interval: Interval) -> tuple[float, float, float]:
    return interval.value, interval.lower, interval.upper


def _covered(limits: NDArray[np.float64], truth: NDArray[np.float64]) -> str:
    return f'{np.mean((limits[:, 1] <= truth) & (truth <= limits[:, 2])):.2f}'


def _speed_row(tray: int, results: list[FilmResult]) -> str:
    row = f'| {tray} '
    for ratios in _by_column('speed_ratios', results):
        known = np.array(ratios)[np.isfinite(ratios)]
        row += f'| {np.median(known):.3f}, {_spread(known)} ' if known.size else '| '
    flagged = np.mean([result.flagged_speeds for result in results])
    row += f'| {flagged:.2f} '
    for name in ('counts', 'radii'):
        columns = _by_column(name, results)
        texts = [f'{np.nanmedian(kind):.3f}, {_spread(np.array(kind))}' for kind in columns]
        row += f'| {"; ".join(texts)} '
    return row + '|'


def _pull_row(tray: int, results: list[FilmResult]) -> str:
    row = f'| {tray} '
    for pulls, held in zip(
        _by_column('speed_pulls', results), _by_column('speeds_held', results), strict=True
    ):
        known = np.array(pulls)[np.isfinite(pulls)]
        row += (
            f'| {np.median(known):+.2f}, {_spread(known, "+.2f")}, {np.nanmean(held):.2f} '
            if known.size
            else '| '
        )
    return row + '|'


def _by_column(name: str, results: list[FilmResult]) -> list[tuple[float, ...]]:
    """The values of a tuple of numbers, first those of its first element."""
    rows = [getattr(result, name) for result in results if getattr(result, name)]
    return list(zip(*rows, strict=True))


def _spread(values: NDArray[np.float64], form: str = '.3f') -> str:
    """Range that holds nine of ten values."""
    low, high = np.nanquantile(values, (0.05, 0.95))
    return f'{low:{form}} to {high:{form}}'


def print_foreign(read: list[ReadFilm]) -> None:
    """Print what is measured in each film made by other code."""
    print('\nFilms by other code\n')
    print_heading()
    for read_film in read:
        print(foreign_row(read_film.film, read_film.result))


def print_heading() -> None:
    """Print the head of a table of `foreign_row`."""
    print(
        '| film | truth: beads, walls | cycles | beads | walls | flags | speeds | counted '
        '| radii | verdict |'
    )
    print('| --- ' * 10 + '|')


def foreign_row(film: FilmTruth, result: FilmResult) -> str:
    """A row of what was measured in a film."""
    beads = f'{film.beads:g}' if math.isfinite(film.beads) else 'depends on speed'
    row = f'| {film.video.stem} | {beads}, {film.walls:g} '
    if result.refusal:
        return row + f'| | refused: {result.refusal} ' + '| ' * 5 + '| flagged |'
    cycle = result.cycles[0] if result.cycles else None
    row += f'| {len(result.cycles)} '
    if cycle is None:
        row += '| no estimate | | '
    else:
        for interval in (cycle.restitution, cycle.wall_restitution):
            row += f'| {interval.value:.3f} [{interval.lower:.3f}, {interval.upper:.3f}] '
        words = [cycle.status.name.lower(), *Quality(cycle.quality).names()]
        row += f'| {", ".join(words)} '
    row += f'| {", ".join(f"{ratio:.3f}" for ratio in result.speed_ratios)} '
    row += f'| {", ".join(f"{count:.3f}" for count in result.counts)} '
    row += f'| {", ".join(f"{radius:.4f}" for radius in result.radii)} '
    return row + f'| {_verdict(film, result)} |'


def print_errors(read: list[ReadFilm]) -> None:
    """Print stated errors of places and radii over the true ones, film by film."""
    print('\nErrors of places and radii, by species\n')
    print(
        '| film | px/mm | common shift [px] | true error about it | between frames '
        '| stated / true | radii |'
    )
    print('| --- ' * 7 + '|')
    for read_film in read:
        errors = [error for error in read_film.result.errors if error]
        columns = [
            [f'{getattr(error, name):.2f}' for error in errors]
            for name in ('shift', 'true', 'white', 'place_ratio', 'radius_ratio')
        ]
        cells = ' | '.join(', '.join(column) for column in columns)
        print(f'| {read_film.film.video.stem} | {read_film.film.scale / 1000.0:.1f} | {cells} |')
    ratios = [error.place_ratio for film in read for error in film.result.errors if error]
    inside = np.mean([1.0 / _FACTOR <= ratio <= _FACTOR for ratio in ratios])
    print(f'\nPlaces: within a factor of {_FACTOR:g} in {inside:.2f} of films and species.')


def _verdict(film: FilmTruth, result: FilmResult) -> str:
    """Whether the restitution is right, flagged, or wrong without a word."""
    if len(result.cycles) != 1:
        return f'WRONG: {len(result.cycles)} cycles'
    cycle = result.cycles[0]
    if cycle.status is not CorStatus.FINAL or is_flagged(cycle):
        return 'flagged'
    if not math.isfinite(film.beads):
        return 'WRONG: one restitution, unflagged'
    wrong = [
        name
        for name, interval, true in (
            ('beads', cycle.restitution, film.beads),
            ('walls', cycle.wall_restitution, film.walls),
        )
        if not interval.lower <= true <= interval.upper
    ]
    return f'WRONG: {" and ".join(wrong)}' if wrong else 'right'
