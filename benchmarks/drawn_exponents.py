"""Films of drawn cameras whose beads lose more the faster they meet: exponents and headlines.

Films of trays and cameras that are drawn (`drawn_films`), with beads whose loss goes with the
impact speed to the power of 0, 0.2 and 0.6; ``NANOROCKS_FILM_COUNT`` is the number of films a row,
40 by default. "Unflagged" films have one cycle with a final estimate, and no flag but that the
restitution depends on speed; all columns behind are of them. The truth of the headline is the
restitution that loses as much energy in the true collisions among those found. "Together" is the
mean of 18 films, weighted by what they state: each has beads of its own.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.drawn_films import DrawnFilm, ReadFilm, measured_rows
from benchmarks.film_measurement import HARMLESS
from benchmarks.true_collisions import counted, true_collision
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Quality

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from benchmarks.true_collisions import TrueCollision

_TRAYS = (1, 3)
_EXPONENTS = (0.0, 0.2, 0.6)
_FILMS, _TOGETHER = 40, 18
_HEADER = (
    '\n| tray | exponent | films | unflagged | speed_dependent | exponents | mean error over '
    'stated | root mean square | 95 % hold | stated sd: median | together: error ± stated, of '
    f'{_TOGETHER} | headline: holds | median error | half-width | constant: holds |\n'
    + '| --- ' * 15
    + '|'
)


def report() -> None:
    """Make missing films, measure in all, and print the table."""
    rows = {
        (tray, exponent): partial(_film, tray, exponent)
        for tray in _TRAYS
        for exponent in _EXPONENTS
    }
    print(_HEADER)
    for (tray, exponent), read in measured_rows(rows, _FILMS):
        print(f'| {tray} | {exponent:g} | {_cells(read, exponent)} |', flush=True)


def _film(tray: int, exponent: float, number: int) -> DrawnFilm:
    return DrawnFilm(tray=tray, number=number, exponent=exponent)


def _cells(read: Sequence[ReadFilm], exponent: float) -> str:
    """All cells but those of the case."""
    used = [film for film in read if is_unflagged(film)]
    depends = sum(bool(film.result.cycles[0].quality & Quality.SPEED_DEPENDENT) for film in used)
    return f'{len(read)} | {len(used)} | {depends} | {_exponents(used, exponent)} | ' + (
        _headlines(used)
    )


def is_unflagged(film: ReadFilm) -> bool:
    """Whether a film has a final estimate, and no flag but that beads lose more when faster."""
    final = film.result.final
    return final is not None and not final.quality & ~(HARMLESS | Quality.SPEED_DEPENDENT)


def _exponents(films: Sequence[ReadFilm], exponent: float) -> str:
    rows = []
    for film in films:
        cycle = film.result.cycles[0]
        interval = cycle.restitution_exponent
        stated = 0.5 * (cycle.restitution_exponent_upper_68 - cycle.restitution_exponent_lower_68)
        if math.isfinite(interval.value) and stated > 0.0:
            holds = interval.lower <= exponent <= interval.upper
            rows.append((interval.value - exponent, stated, holds))
    if not rows:
        return '0 | | | | | '
    errors, stated, holds = np.array(rows).T
    ratios = errors / stated
    return (
        f'{errors.size} | {ratios.mean():+.2f} | {math.sqrt(np.mean(ratios**2)):.2f} '
        f'| {holds.mean():.2f} | {np.median(stated):.2f} | {_together(errors, stated)}'
    )


def _together(errors: NDArray[np.float64], stated: NDArray[np.float64]) -> str:
    groups = []
    for first in range(0, errors.size - _TOGETHER + 1, _TOGETHER):
        own = slice(first, first + _TOGETHER)
        weights = stated[own] ** -2.0
        mean = np.average(errors[own], weights=weights)
        groups.append(f'{mean:+.3f} ± {weights.sum() ** -0.5:.3f}')
    return ', '.join(groups)


def _headlines(films: Sequence[ReadFilm]) -> str:
    """How often headline and constant restitution hold the truth; error, and half-width."""
    rows = []
    for film in films:
        truth = energy_truth(film)
        published, constant = (
            getattr(film.result.cycles[0], name) for name in ('restitution', 'contact_restitution')
        )
        if math.isfinite(truth) and math.isfinite(published.value):
            rows.append(
                (
                    published.lower <= truth <= published.upper,
                    published.value - truth,
                    0.5 * (published.upper - published.lower),
                    constant.lower <= truth <= constant.upper,
                )
            )
    if not rows:
        return '| | | '
    holds, errors, halves, constant_holds = np.array(rows, dtype=np.float64).T
    return (
        f'{holds.mean():.2f} of {holds.size} | {np.median(errors):+.4f} | '
        f'{np.median(halves):.4f} | {constant_holds.mean():.2f}'
    )


def energy_truth(read_film: ReadFilm) -> float:
    """Restitution that loses as much energy as the true collisions among those found."""
    film = read_film.film
    found = (
        true_collision(film, read_film.result.epoch_ns, collision)
        for collision in counted(read_film)
    )
    true = [collision for collision in found if collision is not None]
    if not true:
        return math.nan
    speeds = [collision.impact_speed for collision in true]
    squares = [film.restitution_at(speed) ** 2 for speed in speeds]
    masses = [_reduced_mass(read_film, collision) for collision in true]
    return math.sqrt(np.average(squares, weights=np.array(masses) * np.square(speeds)))


def _reduced_mass(read_film: ReadFilm, collision: TrueCollision) -> float:
    film = read_film.film
    beads = list(collision.beads)
    species = load_trays()[film.tray].species
    densities = [species[kind].density for kind in film.species[beads].tolist()]
    first, second = (np.array(densities) * film.radii[beads] ** 3).tolist()
    return float(first * second / (first + second))
