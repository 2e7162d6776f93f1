"""The gas in memory: one row per bead, one pending event per bead."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.physics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Columns of State.rows: 64 bytes, one cache line, per bead.
X, Y, Z, VX, VY, VZ, TIME, RADIUS = range(8)

# Partners of a pending event below 0 are walls: -1 - (2 axis + side), side 1 being the far one.
WALLS = 6
NOTHING = -1 - WALLS

# Places in State.counts.
PAIR, WALL, ELASTIC_PAIR, ELASTIC_WALL, STALE, MISSED = range(6)
COUNTS = 6

# What following a gas can end with.
DONE, TOO_MANY_EVENTS = range(2)


class State(NamedTuple):
    """Beads and pending events, for compiled code.

    Parameters
    ----------
    rows : ndarray (n, 8), [m, m/s, s, m]
        Position, velocity, the time that the position is of, radius.
    masses : ndarray (n,), [kg]
    event_time : ndarray (n,), [s]
        Of the earliest event of each bead; infinite when there is none.
    event_partner : ndarray of int64, (n,)
        Another bead, a wall, or ``NOTHING``.
    event_counter : ndarray of int64, (n,)
        Counter of the partner when the event was predicted.
    counter : ndarray of int64, (n,)
        Changes of velocity of each bead. A partner's event is stale when it has moved on.
    pair_contact : ndarray (n, n), [s]
        Last contact of each pair.
    wall_contact : ndarray (n, 6), [s]
        Last contact of each bead with each wall.
    clock : ndarray (1,), [s]
        How far the gas has been followed.
    counts : ndarray of int64, (6,)
        Events by type.
    """

    rows: NDArray[np.float64]
    masses: NDArray[np.float64]
    event_time: NDArray[np.float64]
    event_partner: NDArray[np.int64]
    event_counter: NDArray[np.int64]
    counter: NDArray[np.int64]
    pair_contact: NDArray[np.float64]
    wall_contact: NDArray[np.float64]
    clock: NDArray[np.float64]
    counts: NDArray[np.int64]


class Rules(NamedTuple):
    """What happens in a collision, for compiled code.

    Parameters
    ----------
    side_x, side_y, side_z : float, [m]
        Of the box, whose corner is the origin.
    restitution, wall_restitution : float, 0 to 1
    contact_duration : float, [s]
        A contact is elastic when the last of the same pair was less than this ago.
    """

    side_x: float
    side_y: float
    side_z: float
    restitution: float
    wall_restitution: float
    contact_duration: float


@compiled
def new_state(
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64],
    radii: NDArray[np.float64],
    masses: NDArray[np.float64],
) -> State:
    """State at time 0, before any event is predicted."""
    n = radii.size
    rows = np.zeros((n, 8))
    for i in range(n):
        for axis in range(3):
            rows[i, X + axis] = positions[i, axis]
            rows[i, VX + axis] = velocities[i, axis]
        rows[i, RADIUS] = radii[i]
    return State(
        rows,
        masses.copy(),
        np.full(n, np.inf),
        np.full(n, NOTHING, dtype=np.int64),
        np.zeros(n, dtype=np.int64),
        np.zeros(n, dtype=np.int64),
        np.full((n, n), -np.inf),
        np.full((n, WALLS), -np.inf),
        np.zeros(1),
        np.zeros(COUNTS, dtype=np.int64),
    )


@compiled
def snapshot(
    state: State, time: float, positions: NDArray[np.float64], velocities: NDArray[np.float64]
) -> None:
    """Write down where the beads are at a time, x + v (t - t_i), and leave them untouched.

    Parameters
    ----------
    state : State
    time : float, [s]
    positions, velocities : ndarray (n, 3), [m], [m/s]
        Written.
    """
    rows = state.rows
    for i in range(rows.shape[0]):
        since = time - rows[i, TIME]
        for axis in range(3):
            positions[i, axis] = rows[i, X + axis] + rows[i, VX + axis] * since
            velocities[i, axis] = rows[i, VX + axis]
