"""Films in which two things that the model leaves out come together, and what is headlined.

Films of trays and cameras that are drawn (`drawn_films`), whose beads lose more the faster they
meet, with drag or with friction besides; ``NANOROCKS_FILM_COUNT`` is the number of films a row, 20
by default. The truth of the beads is the restitution that loses as much energy in the true
collisions among those found. "Unflagged" films have one cycle with a final estimate, and no flag
but that the restitution depends on speed.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.drawn_exponents import energy_truth, is_unflagged
from benchmarks.drawn_films import DrawnFilm, ReadFilm, measured_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

_TRAYS = (1, 3)
# Drag [1/s], friction and exponent of each row.
_ROWS = ((0.02, 0.0, 0.4), (0.0, 0.03, 0.4))
_FILMS = 20


def report() -> None:
    """Make missing films, measure in all, and print the table."""
    rows = {
        (tray, *physics): partial(_film, tray, *physics) for tray in _TRAYS for physics in _ROWS
    }
    print(
        '\n| tray | drag [1/s] | friction | exponent | films | final | unflagged | beads: hold, '
        'unflagged | half-width | walls: hold, unflagged | half-width | drag found - true, sd |\n'
        + '| --- ' * 12
        + '|'
    )
    for (tray, drag, friction, exponent), read in measured_rows(rows, _FILMS):
        case = f'{tray} | {drag:g} | {friction:g} | {exponent:g}'
        print(f'| {case} | {_cells(read, drag)} |', flush=True)


def _film(tray: int, drag: float, friction: float, exponent: float, number: int) -> DrawnFilm:
    return DrawnFilm(tray=tray, number=number, drag=drag, friction=friction, exponent=exponent)


def _cells(read: Sequence[ReadFilm], drag: float) -> str:
    """All cells but those of the case."""
    final = [film for film in read if film.result.final is not None]
    clear = [film for film in final if is_unflagged(film)]
    drags = np.array([film.result.cycles[0].drag.value - drag for film in clear])
    return (
        f'{len(read)} | {len(final)} | {len(clear)} | {_held(final, clear, "restitution")} '
        f'| {_held(final, clear, "wall_restitution")} '
        f'| {np.nanmean(drags):+.4f}, {np.nanstd(drags):.4f}'
    )


def _held(final: Sequence[ReadFilm], clear: Sequence[ReadFilm], name: str) -> str:
    """How many intervals hold the truth, of all and of unflagged ones, and their half-width."""
    counts = []
    for films in (final, clear):
        holds = [_holds(film, name) for film in films]
        known = [hold for hold in holds if hold is not None]
        counts.append(f'{sum(known)} of {len(known)}')
    intervals = [getattr(film.result.cycles[0], name) for film in clear]
    halves = [0.5 * (interval.upper - interval.lower) for interval in intervals]
    return f'{counts[0]}, {counts[1]} | {np.median(halves):.3f}'


def _holds(film: ReadFilm, name: str) -> bool | None:
    """Whether an interval holds the truth; None where there is none."""
    truth = film.film.walls if name == 'wall_restitution' else energy_truth(film)
    interval = getattr(film.result.cycles[0], name)
    if not (math.isfinite(truth) and math.isfinite(interval.value)):
        return None
    return bool(interval.lower <= truth <= interval.upper)
