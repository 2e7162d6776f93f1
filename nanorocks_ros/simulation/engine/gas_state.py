"""State of a gas in memory: one row and one pending event per bead.

Tested by ``test/simulation/engine/test_epochs.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined
from nanorocks_ros.simulation.engine.event_queue import new_queue
from nanorocks_ros.simulation.engine.recent_contacts import new_contact_table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules

# Columns of State.rows: 64 bytes, one cache line, per bead.
X, Y, Z, VX, VY, VZ, TIME, RADIUS = range(8)

# Columns of State.links.
COUNTER, PARTNER, PARTNER_COUNTER, FLAGS, ORIGINAL, SLOT = range(6)

# Columns of State.bodies.
BODY, FOLLOWING, BOND, BONDED = range(4)

# State.links[:, FLAGS]: two bits for each axis whose walls or edges are near, then the species.
NEAR = 63
SPECIES = 6

# Columns of State.masses.
OWN, OF_BODY = range(2)

# Partners of a pending event below 0 are walls: -1 - (2 axis + side), side 1 being the far one.
WALLS = 6
RENEW = -1 - WALLS

# Places in State.counts.
PAIR, WALL, MERGE, FIX, ELASTIC_PAIR, ELASTIC_WALL, STALE, MISSED, RENEWED, BREAK_UP = range(10)
COUNTS = 10

# Places in State.ledger: energy lost; normal momentum given to each wall; momentum and angular
# momentum given to walls and to what sticks to them; angular momentum taken by aggregates that
# cannot turn, and by the spin that smooth beads lose when they leave one.
PAIR_LOSS, WALL_LOSS, MERGE_LOSS, WALL_IMPULSE = 0, 1, 2, 3
MOMENTUM, SPIN, AGGREGATE_SPIN = 9, 12, 15
LEDGER_SIZE = 18

# Places in State.clock.
NOW, EPOCH, QUANTUM, PREDICTED = range(4)

# Places in State.last.
KIND, SPEED, IMPULSE = range(3)

# Places in State.reach.
LARGEST_RADIUS, HALF_SKIN, PER_CELL, CELLS, AHEAD = 0, 1, 2, 5, 8
REACHES = 9

# Moment of inertia of a solid sphere: 2/5 m r^2.
INERTIA = 0.4

# An epoch lasts about this many crossings of the box.
_CROSSINGS = 64.0

# Outcomes of a run.
DONE, TOO_MANY_EVENTS, LISTS_FULL, LOG_FULL = range(4)


class State(NamedTuple):
    """Beads and pending events, for compiled code.

    Times are counted from ``clock[EPOCH]``.

    Parameters
    ----------
    rows : ndarray (n, 8), [m, m/s, s, m]
        Position, velocity, the time that the position is of, radius.
    links : ndarray of int32, (n, 6)
        Changes of velocity of the bead; partner of its pending event; the changes of velocity
        of that partner when the event was predicted (an event is stale when its partner has
        moved on); flags; number of the bead as given (lists keep neighbours in space close in
        memory); its place in its cell of space.
    bodies : ndarray of int32, (n, 4) or (0, 4)
        With sticking: the smallest given number in the body of each bead, and the next bead of
        the body, round and round. Of bodies that turn also the bonds, two beads each, in any
        row; -1 where there is none.
    times : ndarray, [s]
    levels : ndarray of int64
        The queue.
    drag : ndarray (0,) or (n, 2), [1/s]
        Without drag, or with it: decay rate of the velocity of each bead, and of its body. The
        number of axes tells the compiler which.
    motions : ndarray (0,) or (n + 2, columns)
        Without bodies that turn, or with them: see `flight.turning_motion`. The number of axes
        tells the compiler which.
    masses : ndarray (n, 1) or (n, 2), [kg]
        Of each bead; with sticking also of the body of that number, infinite when it is stuck
        to a wall.
    spins : ndarray (n, 3) or (0, 3), [rad/s]
        Of rough beads.
    images : ndarray of int32, (n, 3) or (0, 3)
        Box lengths to add to a position, with periodic sides.
    contacts : ndarray (room, 3)
        The latest contacts of each pair, for the contact duration.
    references : ndarray of float32, (n, 4) or (0, 4), [m]
        Centre of the shell that a bead's neighbour list holds good in; radius.
    neighbours : ndarray of int32, (n, 1 + most) or (0, 1)
        How many, and which.
    cells : ndarray of int32, (n_cells, 1 + most) or (0, 1)
        How many beads there are in each cell of space, and which.
    reach : ndarray (9,)
        Largest radius and half the skin [m], cells per length [1/m], cells along each axis, how
        far ahead of a bead its new reference lies, as a fraction of half the skin.
    dirty : ndarray of int32, (as many as can be marked at once + 8,)
        Marked beads: their next event must be predicted again.
    clock : ndarray (4,), [s]
        How far the gas has been followed, since the epoch; the epoch; when to set a new one;
        0 until the first events are predicted.
    last : ndarray (3,)
        The last collision: its kind (a place in `counts`, plus 1), normal relative speed [m/s]
        and impulse [kg m/s].
    counts : ndarray of int64, (10,)
        Events by type.
    ledger : ndarray (18,)
        Energy [J], momentum [kg m/s] and angular momentum [kg m^2/s] that left the beads.
    """

    rows: NDArray[np.float64]
    links: NDArray[np.int32]
    bodies: NDArray[np.int32]
    times: NDArray[np.float64]
    levels: NDArray[np.int64]
    drag: NDArray[np.float64]
    motions: NDArray[np.float64]
    masses: NDArray[np.float64]
    spins: NDArray[np.float64]
    images: NDArray[np.int32]
    contacts: NDArray[np.float64]
    references: NDArray[np.float32]
    neighbours: NDArray[np.int32]
    cells: NDArray[np.int32]
    reach: NDArray[np.float64]
    dirty: NDArray[np.int32]
    clock: NDArray[np.float64]
    last: NDArray[np.float64]
    counts: NDArray[np.int64]
    ledger: NDArray[np.float64]


@compiled
def new_state(
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64],
    radii: NDArray[np.float64],
    masses: NDArray[np.float64],
    species: NDArray[np.int32],
    drag: NDArray[np.float64],
    motions: NDArray[np.float64],
    rules: Rules,
) -> State:
    """State at time 0, without lists and without predicted events.

    Parameters
    ----------
    positions, velocities : ndarray (n, 3), [m], [m/s]
    radii, masses : ndarray (n,), [m], [kg]
    species : ndarray of int32, (n,)
    drag : ndarray (0,) or (n, 2), [1/s]
    motions : ndarray (0,) or (n + 2, columns)
        See `State`.
    rules : Rules
    """
    n = radii.size
    memory = np.zeros(8 * n + 8)
    first = (64 - memory.ctypes.data % 64) % 64 // 8
    rows = memory[first : first + 8 * n].reshape((n, 8))
    for i in range(n):
        for axis in range(3):
            rows[i, X + axis] = positions[i, axis]
            rows[i, VX + axis] = velocities[i, axis]
        rows[i, RADIUS] = radii[i]
    times, levels = new_queue(n)
    periodic = rules.periodic[0] or rules.periodic[1] or rules.periodic[2]
    links = np.zeros((n, 6), dtype=np.int32)
    bodies = np.full((n if rules.sticky else 0, 4), -1, dtype=np.int32)
    for i in range(bodies.shape[0]):
        bodies[i, BODY] = i
        bodies[i, FOLLOWING] = i
    weights = np.zeros((n, 2 if rules.sticky else 1))
    for i in range(n):
        links[i, ORIGINAL] = i
        links[i, FLAGS] = species[i] << SPECIES
        weights[i, :] = masses[i]
    reach = np.zeros(REACHES)
    reach[LARGEST_RADIUS] = radii.max()
    return State(
        rows,
        links,
        bodies,
        times,
        levels,
        drag,
        motions,
        weights,
        np.zeros((n if rules.rough else 0, 3)),
        np.zeros((n if periodic else 0, 3), dtype=np.int32),
        new_contact_table(n, rules.contact_duration),
        np.zeros((0, 4), dtype=np.float32),
        np.zeros((0, 1), dtype=np.int32),
        np.zeros((0, 1), dtype=np.int32),
        reach,
        np.zeros(n + 8, dtype=np.int32),
        np.array((0.0, 0.0, time_quantum(velocities, rules), 0.0)),
        np.zeros(3),
        np.zeros(COUNTS, dtype=np.int64),
        np.zeros(LEDGER_SIZE),
    )


@compiled
def time_quantum(velocities: NDArray[np.float64], rules: Rules) -> float:
    """Length of an epoch, [s]: a power of two, some dozens of crossings of the box."""
    total = 0.0
    for i in range(velocities.shape[0]):
        square = 0.0
        for axis in range(3):
            square += velocities[i, axis] * velocities[i, axis]
        total += math.sqrt(square)
    mean = total / velocities.shape[0]
    quantum = 1024.0
    if mean > 0.0:
        minimum = _CROSSINGS * max(rules.sides[0], rules.sides[1], rules.sides[2]) / mean
        while quantum < minimum:
            quantum *= 2.0
        while quantum > 2.0 * minimum:
            quantum *= 0.5
    return quantum


@inlined
def record_collision(state: State, kind: int, speed: float, impulse: float) -> None:
    """Store the last collision for the event log."""
    state.last[KIND] = kind + 1
    state.last[SPEED] = speed
    state.last[IMPULSE] = impulse
