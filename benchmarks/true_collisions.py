"""The true collision of two beads of a film where one was found."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from benchmarks.drawn_films import ReadFilm
    from benchmarks.film_truth import FilmTruth
    from nanorocks_ros.records import PairCollision

# Before the window and after it collisions do not count [s].
_BEGIN, _END = 1.75, 2.0
# Frames before and after the stated time in which the true collision is looked for.
_FRAMES = 4
_SAME_RESTITUTION = 0.03


class TrueCollision(NamedTuple):
    """What two beads really did.

    Parameters
    ----------
    beads : tuple of 2 ints
        As the film counts them.
    before, after : ndarray (2, 3), [m/s]
    line : ndarray (3,)
        Unit vector from the first centre to the second at the contact.
    """

    beads: tuple[int, int]
    before: NDArray[np.float64]
    after: NDArray[np.float64]
    line: NDArray[np.float64]

    @property
    def impact_speed(self) -> float:
        """Along the line of centres, [m/s]."""
        return float((self.before[0] - self.before[1]) @ self.line)


def counted(read_film: ReadFilm) -> Iterable[PairCollision]:
    """Collisions that were found after the shaking event, but for the last two seconds."""
    film = read_film.film
    end = len(film.positions) / film.frame_rate - _END
    for collision in read_film.result.collisions:
        if film.shake + _BEGIN <= _time(read_film.result.epoch_ns, collision) <= end:
            yield collision


def true_collision(film: FilmTruth, epoch_ns: int, seen: PairCollision) -> TrueCollision | None:
    """The truth of a collision; None if these two beads did not collide alone then.

    Both change their velocities between the same two frames, by the restitution of the film.
    """
    frame = int(_time(epoch_ns, seen) * film.frame_rate)
    if not _FRAMES <= frame < len(film.positions) - _FRAMES - 1:
        return None
    first, second = (
        _nearest(film, frame, place, int(kind))
        for place, kind in zip(
            (seen.place, seen.place + seen.separation), seen.species, strict=True
        )
    )
    beads = [first, second]
    velocities = np.concatenate(
        [film.velocities[:, beads], film.vertical_velocities[:, beads, np.newaxis]], axis=-1
    )
    near = velocities[frame - _FRAMES : frame + _FRAMES + 2]
    relative = near[:, 1] - near[:, 0]
    change = int(np.argmax(np.linalg.norm(np.diff(relative, axis=0), axis=1)))
    here = frame - _FRAMES + change
    places = np.column_stack([film.positions[here, beads], film.heights[here, beads]])
    line = _line_at_contact(places[1] - places[0], relative[change], film.radii[beads].sum())
    if line is None:
        return None
    true = TrueCollision((first, second), near[change], near[change + 1], line)
    impact = true.impact_speed
    if impact == 0.0:
        return None
    restitution = float(relative[change + 1] @ line) / impact
    if abs(restitution - film.restitution_at(impact)) > _SAME_RESTITUTION:
        return None
    return true


def _time(epoch_ns: int, collision: PairCollision) -> float:
    return (collision.stamp_ns - epoch_ns) / NS


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
