"""The beads of a tray that are believed, as they are now."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, kernel
from nanorocks_ros.stages.tracking.linking.motion_prediction import SIZE_FLOOR2, Walls, predicted
from nanorocks_ros.stages.tracking.linking.track_store import CONFIRM, Followed

if TYPE_CHECKING:
    from numpy.typing import NDArray


class InView(NamedTuple):
    """Beads that are believed; lengths in pixels, NaN where a velocity is not known.

    Parameters
    ----------
    ids, species : ndarrays of int32, (n,)
    places, velocities : ndarray (n, 2), [px], [px/s]
    errors, velocity_errors, radii, radius_errors : ndarray (n,)
    seen : ndarray of bool, (n,)
        In this picture; of others the place is where they should be.
    """

    ids: NDArray[np.int32]
    species: NDArray[np.int32]
    places: NDArray[np.float64]
    errors: NDArray[np.float64]
    velocities: NDArray[np.float64]
    velocity_errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    seen: NDArray[np.bool_]


@compiled
def room_in_view(room: int) -> InView:
    """Room for so many beads."""
    return InView(
        np.empty(room, dtype=np.int32),
        np.empty(room, dtype=np.int32),
        np.empty((room, 2)),
        np.empty(room),
        np.empty((room, 2)),
        np.empty(room),
        np.empty(room),
        np.empty(room),
        np.empty(room, dtype=np.bool_),
    )


@kernel
def show(
    followed: Followed,
    used: int,
    time: float,
    walls: Walls,
    systematic: float,
    collisions: tuple[float, float],
    species: int,
    view: InView,
    first: int,
) -> int:
    """Write those tracks that are believed.

    Parameters
    ----------
    followed, used, time
        See `take`.
    walls : Walls
    systematic : float, [px]
        Error of all places of a bead together.
    collisions : tuple of 2 floats, [1/s], [px/s]
        How often a bead collides, and how much that changes its velocity.
    species : int
    view : InView
        Written from number `first` on.

    Returns
    -------
    int
        Where they end.
    """
    rate, kick = collisions
    row = first
    for k in range(used):
        if followed.hits[k] < CONFIRM:
            continue
        line = followed.lines[k]
        seen = followed.last[k] == time
        if seen:
            x, y = followed.places[k, 0, 0], followed.places[k, 0, 1]
            error = followed.errors[k, 0]
        else:
            # By collisions that nobody saw; on average one was half way.
            wait = time - followed.last[k]
            strayed = min(rate * wait, 1.0) * (kick * wait) * (kick * wait) / 3.0
            x, y, variance = predicted(line, followed.radii[k], time, walls)
            error = math.sqrt(variance + strayed)
        known = abs(line[6]) < math.inf
        view.ids[row], view.species[row], view.seen[row] = followed.numbers[k], species, seen
        view.places[row, 0], view.places[row, 1] = x, y
        view.errors[row] = math.sqrt(error * error + systematic * systematic)
        for axis in range(2):
            view.velocities[row, axis] = line[3 + axis] if known else np.nan
        view.velocity_errors[row] = math.sqrt(line[6]) if known else np.nan
        view.radii[row] = followed.radii[k]
        view.radius_errors[row] = math.sqrt(1.0 / followed.radius_weights[k] + SIZE_FLOOR2)
        row += 1
    return row


@compiled
def in_metres(
    view: InView, order: NDArray[np.int64], metre: float, displacement: NDArray[np.float64]
) -> InView:
    """The same beads in another order, with lengths in metres and places in the tray.

    Parameters
    ----------
    view : InView
    order : ndarray of int64, (n,)
        Which comes first.
    metre : float, [m/px]
    displacement : ndarray (2,), [m]
        Of the tray.
    """
    found = room_in_view(order.size)
    for row in range(order.size):
        k = order[row]
        found.ids[row], found.species[row] = view.ids[k], view.species[k]
        found.seen[row] = view.seen[k]
        for axis in range(2):
            found.places[row, axis] = metre * view.places[k, axis] - displacement[axis]
            found.velocities[row, axis] = metre * view.velocities[k, axis]
        found.errors[row] = metre * view.errors[k]
        found.velocity_errors[row] = metre * view.velocity_errors[k]
        found.radii[row] = metre * view.radii[k]
        found.radius_errors[row] = metre * view.radius_errors[k]
    return found


@compiled
def count_seen(
    species: NDArray[np.int32], seen: NDArray[np.bool_], kinds: int
) -> NDArray[np.int64]:
    """How many beads of each of so many species are seen."""
    counts = np.zeros(kinds, dtype=np.int64)
    for k in range(species.size):
        counts[species[k]] += seen[k]
    return counts
