"""Observables of a gas: frames of all beads, and sums over the beads."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined
from nanorocks_ros.simulation.engine.flight.gas_drag import (
    flown_time,
    speed_left,
    spin_left,
    velocity_at,
)
from nanorocks_ros.simulation.engine.flight.turning_motion import is_turning, turned_bead, turns
from nanorocks_ros.simulation.engine.gas_state import (
    BODY,
    COUNTS,
    FLAGS,
    LEDGER_SIZE,
    ORIGINAL,
    SPECIES,
    TIME,
    VX,
    State,
    X,
)
from nanorocks_ros.simulation.engine.integer_width import as_int64

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules

# Columns of a row of observations; then for each species how many beads it has and their mean
# squares of velocity along x, y and z.
MEAN_SPEED, MEAN_PROJECTED_SPEED, BODIES, FIRST_COUNT = range(4)
FIRST_LEDGER = FIRST_COUNT + COUNTS
FIRST_SPECIES = FIRST_LEDGER + LEDGER_SIZE
PER_SPECIES = 4


@inlined
def write_frame(
    state: State,
    rules: Rules,
    time: float,
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64],
    spins: NDArray[np.float64],
    bodies: NDArray[np.int32],
) -> None:
    """Write the positions at a time, x + v (t - t_i), without a change of the state.

    Parameters
    ----------
    state : State
    rules : Rules
    time : float, [s]
        Since the epoch.
    positions, velocities : ndarray (n, 3), [m], [m/s]
        Written, by original number; positions continuous across periodic sides.
    spins : ndarray (n, 3) or (0, 3), [rad/s]
        Of rough beads, and of beads of bodies that turn; (n, 3) where there can be any.
    bodies : ndarray of int32, (n,) or (0,)
    """
    rows = state.rows
    for i in range(rows.shape[0]):
        number = as_int64(state.links[i, ORIGINAL])
        if bodies.shape[0]:
            bodies[number] = state.bodies[i, BODY]
        if is_turning(state) and turns(state, i):
            write_turned_bead(state, i, time, positions[number], velocities[number], spins)
            continue
        since = time - rows[i, TIME]
        flown = flown_time(state, i, since)
        left = speed_left(state, i, since)
        for axis in range(3):
            position = rows[i, X + axis] + rows[i, VX + axis] * flown
            if state.images.shape[0]:
                position += state.images[i, axis] * rules.sides[axis]
            positions[number, axis] = position
            velocities[number, axis] = rows[i, VX + axis] * left
        if spins.shape[0]:
            left = spin_left(state, i, since)
            for axis in range(3):
                spins[number, axis] = state.spins[i, axis] * left if state.spins.shape[0] else 0.0


@inlined
def write_turned_bead(
    state: State,
    i: int,
    time: float,
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    spins: NDArray[np.float64],
) -> None:
    """Write place, velocity and spin of a bead of a body that turns, see `write_frame`.

    Parameters
    ----------
    state : State
    i : int
    time : float, [s]
    position, velocity : ndarray (3,), [m], [m/s]
        Written.
    spins : ndarray (n, 3) or (0, 3), [rad/s]
        Written in the row of the bead's number, if there is one.
    """
    place, flying, spin = turned_bead(state, i, time)
    number = as_int64(state.links[i, ORIGINAL])
    for axis in range(3):
        position[axis] = place[axis]
        velocity[axis] = flying[axis]
        if spins.shape[0]:
            spins[number, axis] = spin[axis]


@inlined
def write_observation(state: State, rules: Rules, time: float, row: NDArray[np.float64]) -> None:
    """Write sums over the beads at a time.

    Parameters
    ----------
    state : State
    rules : Rules
    time : float, [s]
        Since the epoch.
    row : ndarray (n_columns,)
        Written; see the columns.
    """
    rows = state.rows
    n = rows.shape[0]
    for k in range(FIRST_SPECIES, row.size):
        row[k] = 0.0
    speed = 0.0
    projected = 0.0
    bodies = 0 if state.bodies.shape[0] else n
    for i in range(n):
        vx, vy, vz = velocity_at(state, i, time)
        in_plane = vx * vx + vy * vy
        speed += math.sqrt(in_plane + vz * vz)
        projected += math.sqrt(in_plane)
        if state.bodies.shape[0]:
            bodies += as_int64(state.bodies[i, BODY] == state.links[i, ORIGINAL])
        first = FIRST_SPECIES + PER_SPECIES * as_int64(state.links[i, FLAGS] >> SPECIES)
        row[first] += 1.0
        row[first + 1] += vx * vx
        row[first + 2] += vy * vy
        row[first + 3] += vz * vz
    row[MEAN_SPEED] = speed / n
    row[MEAN_PROJECTED_SPEED] = projected / n
    row[BODIES] = bodies
    for k in range(COUNTS):
        row[FIRST_COUNT + k] = state.counts[k]
    for k in range(LEDGER_SIZE):
        row[FIRST_LEDGER + k] = state.ledger[k]
    for first in range(FIRST_SPECIES, row.size, PER_SPECIES):
        if row[first] > 0.0:
            for axis in range(1, PER_SPECIES):
                row[first + axis] /= row[first]


@compiled
def columns(n_species: int) -> int:
    """Number of columns of a row of observations."""
    return FIRST_SPECIES + PER_SPECIES * n_species
