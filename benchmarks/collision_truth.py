"""Collisions in drawn films beside the true ones: which of their measures shifts the restitution.

The films and the measurements are those of ``python -m benchmarks foreign_world``; true collisions
are those of `true_collisions`. A shift is the restitution that all collisions of a tray together
like best, less the true one, in brackets where their log likelihood is lower by 1/2: as measured,
with the radii that are told in place of those that show, and with true distances or velocities in
place of measured ones.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.drawn_films import measured
from benchmarks.foreign_world import films_drawn
from benchmarks.true_collisions import counted, true_collision
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.contacts.contact_likelihood import EXCESSES
from nanorocks_ros.inference.contacts.contact_terms import BEADS, ContactTerms
from nanorocks_ros.numerics.log_sums import log_sum

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from benchmarks.drawn_films import ReadFilm
    from benchmarks.film_truth import FilmTruth
    from nanorocks_ros.records import PairCollision

_SHIFTS = np.linspace(-0.15, 0.1, 251)
_NAMES = ('as measured', 'radii told', 'true distances', 'true velocities', 'both true')


@dataclass(frozen=True, slots=True, kw_only=True)
class _Match:
    """A collision and the truth of it.

    Parameters
    ----------
    seen : PairCollision
    true_radii : ndarray (2,), [m]
    true_distances, true_velocities : PairCollision
        With the truth in place of what was measured.
    told : PairCollision
        With the radii that the trays file tells, where a species has one.
    """

    seen: PairCollision
    true_radii: NDArray[np.float64]
    told: PairCollision
    true_distances: PairCollision
    true_velocities: PairCollision

    @property
    def excess(self) -> float:
        """Radii over true ones, less distance over the true one, relative."""
        radii = float(self.seen.radii.sum() / self.true_radii.sum())
        return 1.0 - _distance(self.seen) / _distance(self.true_distances) / radii

    @property
    def versions(self) -> tuple[PairCollision, ...]:
        """As in `_NAMES`."""
        both = replace(self.true_velocities, separation=self.true_distances.separation)
        return self.seen, self.told, self.true_distances, self.true_velocities, both


def report() -> None:
    """Measure in the drawn films that exist and print a row for each tray."""
    films = defaultdict(list)
    for read_film in measured(films_drawn()):
        if read_film.is_unflagged:
            films[read_film.film.tray].append(read_film)
    columns = (
        'tray',
        'films',
        'collisions',
        'the true ones',
        'distances, measured over true',
        *_NAMES,
        'excess of radii [%]',
        'as told, error [%]',
        'stated [%]',
    )
    print('| ' + ' | '.join(columns) + ' |')
    print('| --- ' * len(columns) + '|')
    for tray, of_tray in sorted(films.items()):
        print(_row(tray, of_tray), flush=True)


def _row(tray: int, films: list[ReadFilm]) -> str:
    total, ratios, excesses = 0, [], []
    likelihoods = np.zeros((len(_NAMES), _SHIFTS.size))
    for read_film in films:
        film = read_film.film
        collisions = list(counted(read_film))
        found = (_match(film, read_film.result.epoch_ns, collision) for collision in collisions)
        matches = [match for match in found if match is not None]
        total += len(collisions)
        excess = _excesses(matches)
        if excess is not None:
            excesses.append(excess)
        ratios += [_distance(match.seen) / _distance(match.true_distances) for match in matches]
        versions = zip(*(match.versions for match in matches), strict=True)
        for likelihood, version in zip(likelihoods, versions, strict=False):
            likelihood += _likelihood(version, film.beads)
    shifts = ' | '.join(map(_best, likelihoods))
    ratio = f'{np.median(ratios):.4f}' if ratios else ''
    told = ' | '.join(
        f'{100.0 * median:.2f}' for median in np.median(np.reshape(excesses, (-1, 3)), axis=0)
    )
    return f'| {tray} | {len(films)} | {total} | {len(ratios)} | {ratio} | {shifts} | {told} |'


def _excesses(matches: list[_Match]) -> tuple[float, float, float] | None:
    """Of one film: true excess of the radii, absolute error of the one told, stated error.

    None without true collisions of beads of known sizes.
    """
    alike = [match for match in matches if not match.seen.radius_errors.any()]
    if not alike:
        return None
    true = float(np.median([match.excess for match in alike]))
    table = ContactTerms.of(match.seen for match in alike).beads
    by_excess = np.moveaxis(table.reshape(-1, len(EXCESSES), BEADS.size), 1, 0)
    logs = np.array([float(log_sum(rows.reshape(-1, 1))[0]) for rows in by_excess])
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    told = np.array([excess.all_radii for excess in EXCESSES])
    mean = float(weights @ told)
    return true, abs(mean - true), math.sqrt(float(weights @ (told - mean) ** 2))


def _distance(collision: PairCollision) -> float:
    return float(np.hypot(*collision.separation))


def _match(film: FilmTruth, epoch_ns: int, seen: PairCollision) -> _Match | None:
    """A collision with its truth; None if these two beads did not collide alone then."""
    true = true_collision(film, epoch_ns, seen)
    if true is None:
        return None
    radii = film.radii[list(true.beads)]
    return _Match(
        seen=seen,
        true_radii=radii,
        told=replace(seen, radii=_told_radii(seen)),
        true_distances=replace(seen, separation=true.line[:2] * radii.sum()),
        true_velocities=replace(seen, before=true.before[:, :2], after=true.after[:, :2]),
    )


def _told_radii(seen: PairCollision) -> NDArray[np.float64]:
    kinds = [load_trays()[seen.tray].species[kind] for kind in seen.species.tolist()]
    return np.array(
        [
            0.5 * kind.diameter if kind.diameter_low == kind.diameter_high else radius
            for kind, radius in zip(kinds, seen.radii.tolist(), strict=True)
        ]
    )


def _likelihood(collisions: Iterable[PairCollision], truth: float) -> NDArray[np.float64]:
    """Log likelihood of each of `_SHIFTS`; of restitutions above 1 that of 1."""
    term = ContactTerms.of(collisions).bead_likelihood()
    if term is None:
        return np.zeros(_SHIFTS.size)
    return np.interp(np.minimum(truth + _SHIFTS, 1.0), term.restitution, term.log_likelihood)


def _best(likelihood: NDArray[np.float64]) -> str:
    likely = _SHIFTS[likelihood > likelihood.max() - 0.5]
    best = _SHIFTS[np.argmax(likelihood)]
    return f'{best:+.3f} [{likely[0]:+.3f}, {likely[-1]:+.3f}]'
