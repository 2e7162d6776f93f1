"""Films of gases with drag and friction: restitutions, their intervals and the drag.

Films of trays and cameras that are drawn (`drawn_films`), each with and without drag and friction;
``NANOROCKS_FILM_COUNT`` is the number of films a row, 40 by default, and ``NANOROCKS_FIRST_FILM``
the number of the first one, 0 by default. The intervals are those of all final headlines of beads,
and of walls: how many hold the truth of all, and of those that no flag warns of; "unflagged" is
the share of these. "Over ideal" is the median over films of the half-width over that of the same
film without drag and friction. Of the drag: the median error, that of its size, and the share of
films in which it is within two of the stated ones.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from benchmarks.coverage import coverage
from benchmarks.drawn_films import DrawnFilm, ReadFilm, measured_rows
from nanorocks_ros.records import Interval

_TRAYS = (1, 3)
ROWS = (
    (0.0, 0.0),
    *((drag, 0.0) for drag in (0.005, 0.02, 0.07)),
    *((0.0, friction) for friction in (0.01, 0.03, 0.1)),
    *((0.02, friction) for friction in (0.01, 0.03)),
)
"""Drag and friction of each row; the first is the ideal one."""

_FILMS = 40
_NAMES = ('restitution', 'wall_restitution')


def report() -> None:
    """Make missing films, measure in all, and print the table."""
    rows = {
        (tray, drag, friction): partial(_film, tray, drag, friction)
        for tray in _TRAYS
        for drag, friction in ROWS
    }
    print(
        '\n| tray | drag [1/s] | friction | error of the drag, its size, within 2 | final | '
        'unflagged | beads: holds, unflagged | half-width | over ideal | median error | '
        'walls: holds, unflagged | half-width | over ideal | median error |\n'
        + '| --- ' * 14
        + '|'
    )
    ideal: list[ReadFilm] = []
    for (tray, drag, friction), read in measured_rows(rows, _FILMS):
        if (drag, friction) == ROWS[0]:
            ideal = read
        print(f'| {tray} | {drag:g} | {friction:g} | {_cells(read, ideal, drag)} |', flush=True)


def _film(tray: int, drag: float, friction: float, number: int) -> DrawnFilm:
    return DrawnFilm(tray=tray, number=number, drag=drag, friction=friction)


def _cells(read: list[ReadFilm], ideal: list[ReadFilm], drag: float) -> str:
    """All cells but those of the case."""
    estimates = [film.result.final for film in read if film.result.final]
    off = np.array([estimate.drag.value - drag for estimate in estimates])
    within = np.abs(off) <= 2.0 * np.array([estimate.drag.error for estimate in estimates])
    told = np.isfinite(off)
    size = np.median(np.abs(off[told]))
    cells = [
        f'{np.median(off[told]):+.4f}, {size:.4f}, {within[told].mean():.2f}',
        f'{len(estimates)}/{len(read)}',
        f'{np.mean([film.is_unflagged for film in read]):.2f}',
    ]
    for name, truth in zip(_NAMES, ('beads', 'walls'), strict=True):
        errors = [_error(film, name, getattr(film.film, truth)) for film in read]
        seen = coverage(errors, 0.0)
        ratios = [
            _half_width(film, name) / _half_width(same, name)
            for film, same in zip(read, ideal, strict=True)
        ]
        unflagged = [error for error, film in zip(errors, read, strict=True) if film.is_unflagged]
        holds = f'{seen.holds:.2f}, {coverage(unflagged, 0.0).holds:.2f}'
        cells += [holds, f'{seen.half_width:.4f}', f'{np.nanmedian(ratios):.2f}']
        cells.append(f'{seen.median_error:+.4f}')
    return ' | '.join(cells)


def _error(film: ReadFilm, name: str, truth: float) -> Interval:
    """A final restitution less the true one; NaN where there is none."""
    if film.result.final is None:
        return Interval()
    measured_interval: Interval = getattr(film.result.final, name)
    limits = (measured_interval.value, measured_interval.lower, measured_interval.upper)
    return Interval(*(limit - truth for limit in limits))


def _half_width(film: ReadFilm, name: str) -> float:
    interval = _error(film, name, 0.0)
    known = math.isfinite(interval.value)
    return 0.5 * (interval.upper - interval.lower) if known else math.nan
