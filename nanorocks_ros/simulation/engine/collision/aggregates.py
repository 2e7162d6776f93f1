"""Rigid bodies of beads that stick together: who belongs to them, and what all of them share."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import inlined
from nanorocks_ros.simulation.engine.flight.drag_rates import is_dragged, set_body_drag
from nanorocks_ros.simulation.engine.flight.gas_drag import (
    flight_in_gas,
    flown_time,
    joined_drag_rate,
    speed_left,
    spin_left,
)
from nanorocks_ros.simulation.engine.flight.turning_motion import is_turning, turned_bead, turns
from nanorocks_ros.simulation.engine.gas_state import (
    BODY,
    COUNTER,
    FOLLOWING,
    OF_BODY,
    OWN,
    TIME,
    VX,
    VY,
    VZ,
    State,
    X,
    Y,
    Z,
)
from nanorocks_ros.simulation.engine.integer_width import as_int64

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules


@inlined
def advance(state: State, i: int, now: float) -> None:
    """Move a bead in free flight to a time."""
    rows = state.rows
    if is_turning(state) and is_dragged(state):
        place, velocity = flight_in_gas(state, i, now)
        for axis in range(3):
            rows[i, X + axis] = place[axis]
            rows[i, VX + axis] = velocity[axis]
        rows[i, TIME] = now
        return
    if is_turning(state) and turns(state, i):
        place, velocity, _ = turned_bead(state, i, now)
        for axis in range(3):
            rows[i, X + axis] = place[axis]
            rows[i, VX + axis] = velocity[axis]
        rows[i, TIME] = now
        return
    since = now - rows[i, TIME]
    flown = flown_time(state, i, since)
    rows[i, X] += rows[i, VX] * flown
    rows[i, Y] += rows[i, VY] * flown
    rows[i, Z] += rows[i, VZ] * flown
    rows[i, TIME] = now
    if is_dragged(state):
        left = speed_left(state, i, since)
        rows[i, VX] *= left
        rows[i, VY] *= left
        rows[i, VZ] *= left
        if state.spins.shape[0]:
            left = spin_left(state, i, since)
            for axis in range(3):
                state.spins[i, axis] *= left


@inlined
def mass_of(state: State, rules: Rules, i: int) -> float:
    """Mass of the body of a bead, infinite when it is stuck to a wall, [kg]."""
    if rules.sticky:
        return state.masses[state.bodies[i, BODY], OF_BODY]
    return state.masses[i, OWN]


@inlined
def can_rotate(state: State, rules: Rules, i: int) -> bool:
    """Whether a bead can rotate: a single bead that is not stuck to a wall."""
    if not rules.rough:
        return False
    if not rules.sticky:
        return True
    single = state.bodies[i, FOLLOWING] == i
    return bool(single and not math.isinf(mass_of(state, rules, i)))


@inlined
def velocity_share(own: float, other: float) -> float:
    """Fraction of a change of relative velocity that a body takes, from both masses."""
    if math.isinf(own):
        return 0.0
    if math.isinf(other):
        return 1.0
    return other / (own + other)


@inlined
def propagate_velocity(state: State, rules: Rules, i: int, now: float, marked: int) -> int:
    """Give the new velocity of a bead to its body, which does not turn, and mark its beads.

    Parameters
    ----------
    state : State
    rules : Rules
    i : int
    now : float, [s]
    marked : int
        Beads marked before.

    Returns
    -------
    int
        Beads marked now.
    """
    rows = state.rows
    state.links[i, COUNTER] += 1
    state.dirty[marked] = i
    marked += 1
    if rules.sticky:
        k = as_int64(state.bodies[i, FOLLOWING])
        while k != i:
            advance(state, k, now)
            rows[k, VX] = rows[i, VX]
            rows[k, VY] = rows[i, VY]
            rows[k, VZ] = rows[i, VZ]
            state.links[k, COUNTER] += 1
            state.dirty[marked] = k
            marked += 1
            k = as_int64(state.bodies[k, FOLLOWING])
    return marked


@inlined
def mark_body(state: State, i: int, marked: int) -> int:
    """Mark the beads of a body; returns the number marked now."""
    k = i
    while True:
        state.dirty[marked] = k
        marked += 1
        k = as_int64(state.bodies[k, FOLLOWING])
        if k == i:
            return marked


@inlined
def mark_changed_body(state: State, i: int, marked: int) -> int:
    """Mark the beads of a body whose velocities change; returns the number marked now."""
    last = mark_body(state, i, marked)
    for k in range(marked, last):
        state.links[state.dirty[k], COUNTER] += 1
    return last


@inlined
def advance_marked(state: State, marked: int, now: float) -> None:
    """Move all marked beads to a time."""
    for k in range(marked):
        advance(state, as_int64(state.dirty[k]), now)


@inlined
def advance_body(state: State, i: int, now: float) -> None:
    """Move all beads of a body to a time."""
    k = i
    while True:
        advance(state, k, now)
        k = as_int64(state.bodies[k, FOLLOWING])
        if k == i:
            break


@inlined
def shift_body(state: State, rules: Rules, i: int, axis: int, by: float) -> None:
    """Move the other beads of a body along an axis, [m]."""
    if rules.sticky:
        k = as_int64(state.bodies[i, FOLLOWING])
        while k != i:
            state.rows[k, X + axis] += by
            k = as_int64(state.bodies[k, FOLLOWING])


@inlined
def clear_spin(state: State, rules: Rules, i: int) -> None:
    """Set the spin of a bead to 0."""
    if rules.rough:
        for axis in range(3):
            state.spins[i, axis] = 0.0


@inlined
def join_bodies(state: State, rules: Rules, i: int, j: int) -> None:
    """Join the bodies of two beads; velocities do not change."""
    first = as_int64(state.bodies[i, BODY])
    second = as_int64(state.bodies[j, BODY])
    label = min(first, second)
    mass = state.masses[first, OF_BODY] + state.masses[second, OF_BODY]
    rate = 0.0
    if is_dragged(state):
        rate = joined_drag_rate(
            state, i, j, state.masses[first, OF_BODY], state.masses[second, OF_BODY]
        )
    k = i
    while True:
        state.bodies[k, BODY] = label
        clear_spin(state, rules, k)
        if is_dragged(state):
            set_body_drag(state, k, rate)
        k = as_int64(state.bodies[k, FOLLOWING])
        if k == i:
            break
    k = j
    while True:
        state.bodies[k, BODY] = label
        clear_spin(state, rules, k)
        if is_dragged(state):
            set_body_drag(state, k, rate)
        k = as_int64(state.bodies[k, FOLLOWING])
        if k == j:
            break
    state.bodies[i, FOLLOWING], state.bodies[j, FOLLOWING] = (
        state.bodies[j, FOLLOWING],
        state.bodies[i, FOLLOWING],
    )
    state.masses[first, OF_BODY] = 0.0
    state.masses[second, OF_BODY] = 0.0
    state.masses[label, OF_BODY] = mass


@inlined
def fix_body(state: State, rules: Rules, i: int) -> None:
    """Fix a body to a wall: its mass becomes infinite."""
    state.masses[state.bodies[i, BODY], OF_BODY] = np.inf
    k = i
    while True:
        clear_spin(state, rules, k)
        k = as_int64(state.bodies[k, FOLLOWING])
        if k == i:
            break
