"""The beads of a species that are followed: what is kept of each, from picture to picture."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined, kernel
from nanorocks_ros.stages.tracking.linking.free_flight import (
    KEPT,
    extend_flight,
    median_square_speed,
)
from nanorocks_ros.stages.tracking.linking.link_probabilities import Seen

if TYPE_CHECKING:
    from numpy.typing import NDArray

CONFIRM = 3
"""Pictures in a row that a new bead must be seen in."""

# Share of a new mean speed taken over in each picture.
_SPEED_SHARE = 0.1


class Followed(NamedTuple):
    """Tracks, one an entry, and room for more; lengths in pixels, times in seconds.

    Parameters
    ----------
    numbers : ndarray of int32, (room,)
    last : ndarray (room,), [s]
        When each was seen last.
    hits : ndarray of int64, (room,)
        In how many pictures.
    radii, radius_weights : ndarray (room,), [px], [1/px^2]
    shares : ndarray (room,)
        Of the disc that was seen last, halved in each picture since.
    times, places, errors : ndarrays (room, KEPT), (room, KEPT, 2), (room, KEPT)
        Of the flight, newest first.
    counts : ndarray of int64, (room,)
        Places of it.
    lines : ndarray (room, 9)
        See `fit_line`.
    """

    numbers: NDArray[np.int32]
    last: NDArray[np.float64]
    hits: NDArray[np.int64]
    radii: NDArray[np.float64]
    radius_weights: NDArray[np.float64]
    shares: NDArray[np.float64]
    times: NDArray[np.float64]
    places: NDArray[np.float64]
    errors: NDArray[np.float64]
    counts: NDArray[np.int64]
    lines: NDArray[np.float64]


class Habits(NamedTuple):
    """What is known of the beads of a species, and how they are followed.

    Parameters
    ----------
    expected : int
        Beads there are.
    longest_gap, window : float, [s]
        See `TrackingSettings`.
    """

    expected: int
    longest_gap: float
    window: float


def room_to_follow(room: int) -> Followed:
    """Room for so many tracks, with nothing in it."""
    return Followed(
        numbers=np.empty(room, dtype=np.int32),
        last=np.empty(room),
        hits=np.empty(room, dtype=np.int64),
        radii=np.empty(room),
        radius_weights=np.empty(room),
        shares=np.empty(room),
        times=np.empty((room, KEPT)),
        places=np.empty((room, KEPT, 2)),
        errors=np.empty((room, KEPT)),
        counts=np.empty(room, dtype=np.int64),
        lines=np.empty((room, 9)),
    )


@kernel
def take(
    followed: Followed,
    used: int,
    chosen: NDArray[np.int64],
    found: Seen,
    shares: NDArray[np.float64],
    time: float,
    habits: Habits,
) -> None:
    """Add to each track the place chosen for it, if any.

    Parameters
    ----------
    followed : Followed
        Of which the first `used` are tracks.
    chosen : ndarray of int64, (used,)
        Of the beads that are seen; or -1.
    found, shares : Seen, ndarray (m,)
        These, and how much of the disc of each is seen.
    time : float, [s]
    habits : Habits
    """
    for k in range(used):
        j = chosen[k]
        if j < 0:
            followed.shares[k] *= 0.5
            continue
        followed.counts[k] = extend_flight(
            followed.times[k],
            followed.places[k],
            followed.errors[k],
            followed.counts[k],
            followed.lines[k],
            time,
            found.places[j, 0],
            found.places[j, 1],
            found.errors[j],
            habits.window,
        )
        weight = 1.0 / (found.radius_errors[j] * found.radius_errors[j])
        total = followed.radius_weights[k] + weight
        followed.radii[k] += (found.radii[j] - followed.radii[k]) * weight / total
        followed.radius_weights[k] = total
        followed.last[k] = time
        followed.shares[k] = shares[j]
        followed.hits[k] += 1


@compiled
def learn_speed(followed: Followed, used: int, speed: float) -> float:
    """A usual component of a velocity, [px/s]: half of the beads are faster."""
    known = np.empty(used, dtype=np.bool_)
    some = False
    for k in range(used):
        known[k] = followed.counts[k] >= 2 and followed.hits[k] >= CONFIRM
        some |= known[k]
    if not some:
        return speed
    square = median_square_speed(followed.lines[:used], known)
    # Of a Maxwellian gas; the median does not heed beads that were confused.
    usual = math.sqrt(square / (2.0 * math.log(2.0)))
    share = 1.0 if usual > speed else _SPEED_SHARE
    return speed + share * (usual - speed)


@kernel
def drop(
    followed: Followed, used: int, chosen: NDArray[np.int64], time: float, habits: Habits
) -> int:
    """Forget those that were not confirmed or lost for too long; how many tracks are left.

    `chosen` is -1 for those that are not seen; changed.
    """
    surplus = -habits.expected
    for k in range(used):
        confirmed = followed.hits[k] >= CONFIRM
        if chosen[k] < 0 and not (confirmed and time - followed.last[k] <= habits.longest_gap):
            chosen[k] = _DROPPED
        surplus += confirmed and chosen[k] != _DROPPED
    # There are no more beads than that: those lost for longest came back as others.
    for _ in range(surplus):
        longest, lost = -math.inf, -1
        for k in range(used):
            if chosen[k] == -1 and time - followed.last[k] > longest:
                longest, lost = time - followed.last[k], k
        if lost < 0:
            break
        chosen[lost] = _DROPPED
    kept = 0
    for k in range(used):
        if chosen[k] != _DROPPED:
            if kept < k:
                _move(followed, k, kept)
            kept += 1
    return kept


_DROPPED = -2


@inlined
def _move(followed: Followed, here: int, there: int) -> None:
    followed.numbers[there] = followed.numbers[here]
    followed.last[there] = followed.last[here]
    followed.hits[there] = followed.hits[here]
    followed.radii[there] = followed.radii[here]
    followed.radius_weights[there] = followed.radius_weights[here]
    followed.shares[there] = followed.shares[here]
    followed.counts[there] = followed.counts[here]
    for k in range(9):
        followed.lines[there, k] = followed.lines[here, k]
    for k in range(followed.counts[here]):
        followed.times[there, k] = followed.times[here, k]
        followed.errors[there, k] = followed.errors[here, k]
        followed.places[there, k, 0] = followed.places[here, k, 0]
        followed.places[there, k, 1] = followed.places[here, k, 1]


@kernel
def add(
    followed: Followed,
    used: int,
    new: NDArray[np.bool_],
    found: Seen,
    shares: NDArray[np.float64],
    time: float,
    first_number: int,
    hits: int,
) -> int:
    """Begin a track with each bead that is new, as often seen as `hits`; how many tracks are used.

    Parameters
    ----------
    followed, used, found, shares, time
        See `take`; there must be room.
    new : ndarray of bool, (m,)
    first_number : int
        Of the first new track.
    """
    first = used
    for j in range(new.size):
        if not new[j]:
            continue
        followed.numbers[used] = first_number + used - first
        followed.last[used], followed.hits[used] = time, hits
        followed.radii[used] = found.radii[j]
        followed.radius_weights[used] = 1.0 / (found.radius_errors[j] * found.radius_errors[j])
        followed.shares[used], followed.counts[used] = shares[j], 1
        followed.times[used, 0], followed.errors[used, 0] = time, found.errors[j]
        line = followed.lines[used]
        line[0], line[3], line[4], line[7], line[8] = time, 0.0, 0.0, 0.0, 0.0
        line[5], line[6] = found.errors[j] * found.errors[j], math.inf
        for axis in range(2):
            followed.places[used, 0, axis] = found.places[j, axis]
            line[1 + axis] = found.places[j, axis]
        used += 1
    return used


@compiled
def advance(
    followed: Followed,
    used: int,
    chosen: NDArray[np.int64],
    found: Seen,
    shares: NDArray[np.float64],
    time: float,
    habits: Habits,
    speed: float,
    first_number: int,
    hits: int,
) -> tuple[int, int, float]:
    """Take, learn, drop and add what the next picture shows.

    Returns
    -------
    int, int
        Tracks, and how many of them are new.
    float, [px/s]
        See `learn_speed`.
    """
    new = np.ones(found.radii.size, dtype=np.bool_)
    for k in range(used):
        if chosen[k] >= 0:
            new[chosen[k]] = False
    take(followed, used, chosen, found, shares, time, habits)
    speed = learn_speed(followed, used, speed)
    kept = drop(followed, used, chosen, time, habits)
    used = add(followed, kept, new, found, shares, time, first_number, hits)
    return used, used - kept, speed
