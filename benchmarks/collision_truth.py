"""Collisions in drawn films beside the true ones: which of their measures shifts the restitution.

The films and the measurements are those of ``python -m benchmarks foreign_world``. A collision is
the true one if both beads change their velocities between the same two frames by the restitution
of the film. A shift is the restitution that all collisions of a tray together like best, less the
true one, in brackets where their log likelihood is lower by 1/2: as measured, with the radii that
are told in place of those that show, and with true distances or velocities in place of measured
ones.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.drawn_films import measured
from benchmarks.foreign_world import films_drawn
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.contacts.contact_likelihood import EXCESSES
from nanorocks_ros.inference.contacts.contact_terms import BEADS, ContactTerms
from nanorocks_ros.numerics.log_sums import log_sum
from nanorocks_ros.records import NS, PairCollision

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from benchmarks.drawn_films import ReadFilm
    from benchmarks.film_truth import FilmTruth

# Before the window and after it collisions do not count [s].
_BEGIN, _END = 1.75, 2.0
# Frames before and after the stated time in which the true collision is looked for.
_FRAMES = 4
_SAME_RESTITUTION = 0.03
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
        collisions = list(_counted(read_film))
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


def _counted(read_film: ReadFilm) -> Iterable[PairCollision]:
    film = read_film.film
    end = len(film.positions) / film.frame_rate - _END
    for collision in read_film.result.collisions:
        if film.shake + _BEGIN <= _time(read_film.result.epoch_ns, collision) <= end:
            yield collision


def _time(epoch_ns: int, collision: PairCollision) -> float:
    return (collision.stamp_ns - epoch_ns) / NS


def _distance(collision: PairCollision) -> float:
    return float(np.hypot(*collision.separation))


def _match(film: FilmTruth, epoch_ns: int, seen: PairCollision) -> _Match | None:
    """The truth of a collision; None if these two beads did not collide alone then."""
    frame = int(_time(epoch_ns, seen) * film.frame_rate)
    if not _FRAMES <= frame < len(film.positions) - _FRAMES - 1:
        return None
    beads = [
        _nearest(film, frame, place, int(kind))
        for place, kind in zip(
            (seen.place, seen.place + seen.separation), seen.species, strict=True
        )
    ]
    velocities = np.concatenate(
        [film.velocities[:, beads], film.vertical_velocities[:, beads, np.newaxis]], axis=-1
    )
    near = velocities[frame - _FRAMES : frame + _FRAMES + 2]
    relative = near[:, 1] - near[:, 0]
    change = int(np.argmax(np.linalg.norm(np.diff(relative, axis=0), axis=1)))
    before, after = near[change], near[change + 1]
    here = frame - _FRAMES + change
    places = np.column_stack([film.positions[here, beads], film.heights[here, beads]])
    line = _line_at_contact(places[1] - places[0], relative[change], film.radii[beads].sum())
    if line is None:
        return None
    approach, parting = relative[change] @ line, relative[change + 1] @ line
    if approach == 0.0 or abs(-parting / approach - film.beads) > _SAME_RESTITUTION:
        return None
    separation = line[:2] * film.radii[beads].sum()
    return _Match(
        seen=seen,
        true_radii=film.radii[beads],
        told=replace(seen, radii=_told_radii(seen)),
        true_distances=replace(seen, separation=separation),
        true_velocities=replace(seen, before=before[:, :2], after=after[:, :2]),
    )


def _nearest(film: FilmTruth, frame: int, place: NDArray[np.float64], kind: int) -> int:
    distances = np.hypot(*(film.positions[frame] - place).T)
    return int(np.argmin(np.where(film.species == kind, distances, np.inf)))


def _line_at_contact(
    line: NDArray[np.float64], velocity: NDArray[np.float64], reach: float
) -> NDArray[np.float64] | None:
    """Unit line of centres where beads that fly on touch; None if they miss each other."""
    square, along = float(velocity @ velocity), float(line @ velocity)
    root = along**2 - square * (float(line @ line) - reach**2)
    if root <= 0.0 or square == 0.0:
        return None
    touching: NDArray[np.float64] = line - velocity * (along + np.sqrt(root)) / square
    return touching / np.linalg.norm(touching)


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
