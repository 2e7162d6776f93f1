"""Films of drawn cameras in which beads stick: restitutions, sticking speed and onset.

Films of trays and cameras that are drawn (`drawn_films`), each with sticking speeds of 1, 3 and 10
mm/s and without, and two of them in a gas that slows the beads; bodies turn.
``NANOROCKS_FILM_COUNT`` is the number of films a row, 8 by default. "Unflagged" films have one
cycle, and no flag but that beads stick; all columns behind are those of them. "Holds" is the share
of 95 % intervals with the truth, those from 0 to 1 among them, and one-sided ones of the sticking
speed. Onsets are first merges since the kick. "From the true merges" are the sticking speeds that
these and the true speeds of the same films would give: what is wrong there is the theory of the
rates.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.drawn_films import DrawnFilm, ReadFilm, measured_rows
from benchmarks.film_measurement import HARMLESS
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.sticking.sticking_cycle import sticking_cycle
from nanorocks_ros.inference.sticking.sticking_speed import StickingEstimate, sticking_estimate
from nanorocks_ros.physics.sticking_rates import slow_contacts
from nanorocks_ros.records import NS, CorStatus, Merge, Quality, StickingStatus

if TYPE_CHECKING:
    from collections.abc import Sequence

    from benchmarks.film_truth import FilmTruth
    from nanorocks_ros.records import ClusterEstimate

_TRAYS = (1, 3)
# Sticking speeds [m/s] and drag [1/s].
_GASES = ((0.0, 0.0), (1e-3, 0.0), (3e-3, 0.0), (10e-3, 0.0), (1e-3, 0.07), (3e-3, 0.07))
_FILMS = 8
# Between the true speeds that count, [s].
_EVERY = 0.1
# Within which a sticking speed counts as right.
_FACTOR = 1.3
_HEADER = (
    '\n| tray, sticking speed | films | unflagged | final | walls known | hold | half-width '
    '| median error | beads known | hold | half-width | median error | merges found, true '
    '| first merge found later by: mean (largest) [s], in | sticking speed / truth: mean (sd) of '
    f'those measured, within a factor of {_FACTOR} | hold | upper limits below the truth '
    '| from the true merges | hold |\n' + '| --- ' * 19 + '|'
)


def report() -> None:
    """Make missing films, measure in all, and print the table."""
    rows = {
        (tray, sticking, drag): partial(_film, tray, sticking, drag)
        for tray in _TRAYS
        for sticking, drag in _GASES
    }
    print(_HEADER)
    for (tray, sticking, drag), read in measured_rows(rows, _FILMS):
        name = f'{tray}, {1e3 * sticking:g} mm/s' if sticking else f'{tray}, never'
        name += f', drag {drag:g} /s' if drag else ''
        print(f'| {name} | {_cells(read)} |', flush=True)


def _film(tray: int, sticking: float, drag: float, number: int) -> DrawnFilm:
    return DrawnFilm(tray=tray, number=number, sticking=sticking, drag=drag)


def _cells(read: Sequence[ReadFilm]) -> str:
    """All cells but that of the case."""
    unflagged = [film for film in read if _is_unflagged(film)]
    final = sum(film.result.cycles[0].status is CorStatus.FINAL for film in unflagged)
    return ' | '.join(
        (
            f'{len(read)}',
            f'{len(unflagged)}',
            f'{final}',
            *_restitution_cells(unflagged, 'wall_restitution', 'walls'),
            *_restitution_cells(unflagged, 'restitution', 'beads'),
            *_merge_cells(unflagged),
            *_speed_cells(unflagged),
            *_cells_of_true_merges(unflagged),
        )
    )


def _is_unflagged(film: ReadFilm) -> bool:
    cycles = film.result.cycles
    return len(cycles) == 1 and not cycles[0].quality & ~(HARMLESS | Quality.STICKING)


def _restitution_cells(
    read: Sequence[ReadFilm], name: str, truth: str
) -> tuple[str, str, str, str]:
    """Values, share of the intervals that hold, median half-width, median error."""
    rows = []
    for film in read:
        interval, true = getattr(film.result.cycles[0], name), getattr(film.film, truth)
        limits = np.array([interval.value, interval.lower, interval.upper]) - true
        rows.append(limits)
    value, lower, upper = np.array(rows).reshape(-1, 3).T
    limited, known = np.isfinite(upper), np.isfinite(value)
    holds = np.mean((lower <= 0.0) & (upper >= 0.0), where=limited) if limited.any() else math.nan
    if not known.any():
        return '0', f'{holds:.2f}', '', ''
    half_width, error = np.median([0.5 * (upper - lower)[known], value[known]], axis=1)
    return f'{known.sum()}', f'{holds:.2f}', f'{half_width:.4f}', f'{error:+.4f}'


def _merge_cells(read: Sequence[ReadFilm]) -> tuple[str, str]:
    """Merges that make bodies fewer, and how late the first is found."""
    found = sum(merge.joins for film in read for merge in film.result.merges)
    true = sum(film.film.merges.size for film in read)
    late = np.array(
        [
            film.result.clusters[-1].onset - film.film.merges.min()
            for film in read
            if film.film.merges.size
        ]
    )
    seen = late[np.isfinite(late)]
    if not seen.size:
        return f'{found}, {true}', f'0/{late.size}' if late.size else ''
    return (
        f'{found}, {true}',
        f'{seen.mean():+.2f} ({np.abs(seen).max():.2f}), {seen.size}/{late.size}',
    )


def _speed_cells(read: Sequence[ReadFilm]) -> tuple[str, str, str]:
    """Sticking speeds over the truth, share of the intervals that hold, upper limits too low."""
    found = [(film.result.clusters[-1], film.film.sticking) for film in read]
    known = [
        (cluster, true)
        for cluster, true in found
        if cluster.sticking_status is not StickingStatus.UNKNOWN
    ]
    if not known:
        return '', '', ''
    low = sum(cluster.sticking_speed.upper < true for cluster, true in known)
    holds = np.mean([_holds(cluster, true) for cluster, true in known])
    ratios = [cluster.sticking_speed.value / true for cluster, true in known if true]
    return _scatter(ratios), f'{holds:.2f}', f'{low}'


def _scatter(ratios: Sequence[float]) -> str:
    """Mean and standard deviation of those that are known, and the share within the factor."""
    seen = np.array(ratios)[np.isfinite(ratios)]
    if not seen.size:
        return ''
    within = np.mean(np.abs(np.log(seen)) < math.log(_FACTOR))
    return f'{np.mean(seen):.2f} ({np.std(seen):.2f}) of {seen.size}, {within:.0%}'


def _cells_of_true_merges(read: Sequence[ReadFilm]) -> tuple[str, str]:
    """Sticking speeds over the truth from true merges and speeds, and how many intervals hold."""
    films = [film.film for film in read if film.film.sticking]
    if not films:
        return '', ''
    estimates = [_by_true_merges(film) for film in films]
    holds = [
        estimate.lower <= film.sticking <= estimate.upper
        for estimate, film in zip(estimates, films, strict=True)
    ]
    ratios = [
        estimate.sticking_speed / film.sticking
        for estimate, film in zip(estimates, films, strict=True)
    ]
    return _scatter(ratios), f'{np.mean(holds):.2f}'


def _by_true_merges(film: FilmTruth) -> StickingEstimate:
    beads = film.positions.shape[1]
    every = max(round(_EVERY * film.frame_rate), 1)
    frames = np.arange(round((film.shake + _EVERY) * film.frame_rate), len(film.positions), every)
    stamps = [round((film.shake + time) * NS) for time in film.merges.tolist()]
    fields = {'tray': film.tray, 'cycle': 1, 'tracks': np.zeros(2, dtype=np.int32), 'joins': True}
    cycle = sticking_cycle(
        beads,
        [Merge(stamp_ns=stamp_ns, known_ns=stamp_ns, **fields) for stamp_ns in stamps],
        np.rint(frames / film.frame_rate * NS).astype(np.int64),
        film.mean_projected_speed[frames],
        round(film.shake * NS),
    )
    return sticking_estimate([cycle], slow_contacts(load_trays()[film.tray]), beads)


def _holds(cluster: ClusterEstimate, true: float) -> bool:
    # No limit is NaN.
    return not (true < cluster.sticking_speed.lower or true > cluster.sticking_speed.upper)
