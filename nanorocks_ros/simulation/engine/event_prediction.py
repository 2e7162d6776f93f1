"""Prediction of the next event of a bead: its time and its partner.

Tested by ``test/simulation/engine/test_reference_agreement.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import inlined
from nanorocks_ros.simulation.engine.collision.wall_collisions import next_wall_event
from nanorocks_ros.simulation.engine.event_queue import schedule
from nanorocks_ros.simulation.engine.flight.drag_rates import drag_rate, is_dragged
from nanorocks_ros.simulation.engine.flight.gas_drag import flight_time, position_at, velocity_at
from nanorocks_ros.simulation.engine.flight.pair_times import square_of, wait_for_contact
from nanorocks_ros.simulation.engine.flight.turning_contacts import (
    end_of_stretch,
    shell_exit_of_turning,
    wait_with_turning,
)
from nanorocks_ros.simulation.engine.flight.turning_motion import is_turning, turns
from nanorocks_ros.simulation.engine.flight.unequal_drag import wait_with_unequal_drag
from nanorocks_ros.simulation.engine.gas_state import (
    COUNTER,
    FLAGS,
    HALF_SKIN,
    LARGEST_RADIUS,
    NEAR,
    PARTNER,
    PARTNER_COUNTER,
    RENEW,
    VX,
    State,
)
from nanorocks_ros.simulation.engine.integer_width import as_index, as_int64

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules
    from nanorocks_ros.simulation.engine.vectors import Vector

_ALL = 63


@inlined
def wait_for_pair(
    state: State,
    rules: Rules,
    i: int,
    flight: tuple[Vector, Vector],
    j: int,
    now: float,
    folded: bool,
    limit: float,
) -> float:
    """Time until two beads touch, infinite when they do not before a limit, [s].

    Parameters
    ----------
    state : State
    rules : Rules
    i : int
    flight : tuple of 2 vectors, [m], [m/s]
        Place and velocity of bead i now.
    j : int
    now : float, [s]
    folded : bool
        Whether the nearest image of j is to be found.
    limit : float, [s]
        Later contacts may be left out.
    """
    if is_turning(state) and (turns(state, i) or turns(state, j)):
        return wait_with_turning(state, rules, i, j, now, limit)
    place = position_at(state, j, now)
    velocity = velocity_at(state, j, now)
    flights = flight[0], flight[1], place, velocity
    if is_dragged(state) and drag_rate(state, i) != drag_rate(state, j):
        return wait_with_unequal_drag(state, rules, i, flights, j, now, folded, limit)
    wait = wait_for_contact(state, rules, i, flights, j, folded)
    return flight_time(state, i, wait)


@inlined
def set_pending(state: State, i: int, time: float, partner: int) -> None:
    """Set the pending event of a bead."""
    state.links[i, PARTNER] = partner
    if partner >= 0:
        state.links[i, PARTNER_COUNTER] = state.links[partner, COUNTER]
    schedule(state.times, state.levels, i, time)


@inlined
def image_horizon(state: State, rules: Rules, i: int, now: float) -> float:
    """Time until which only the nearest images of the other beads can collide, [s]."""
    best = np.inf
    for axis in range(3):
        speed = abs(state.rows[i, VX + axis])
        if rules.periodic[axis] and speed > 0.0:
            # Two beads together move less than lies between the second image and a contact.
            free = 0.25 * (rules.sides[axis] - 4.0 * state.reach[LARGEST_RADIUS])
            best = min(best, now + free / speed)
    return best


@inlined
def predict_among_all(state: State, rules: Rules, i: int, now: float, folded: bool) -> None:
    """Predict the next event of a bead by a scan of all beads and walls.

    At equal times walls come before beads, and beads by index.
    """
    best, partner = next_wall_event(state, rules, i, now, _ALL)
    if folded:
        horizon = image_horizon(state, rules, i, now)
        if horizon < best:
            best = horizon
            partner = RENEW
    if is_turning(state):
        horizon = end_of_stretch(state, i)
        if horizon < best:
            best = horizon
            partner = RENEW
    flight = position_at(state, i, now), velocity_at(state, i, now)
    for j in range(state.rows.shape[0]):
        if j != i:
            when = now + wait_for_pair(state, rules, i, flight, j, now, folded, best - now)
            if when < best:
                best = when
                partner = j
    set_pending(state, i, best, partner)


@inlined
def predict_among_neighbours(state: State, rules: Rules, i: int, now: float) -> None:
    """Predict the next event of a bead from its neighbour list and the near walls."""
    flight = position_at(state, i, now), velocity_at(state, i, now)
    near = state.links[i, FLAGS] & NEAR
    partner = RENEW
    if is_turning(state) and turns(state, i):
        best = shell_exit_of_turning(state, i, now)
    else:
        best = shell_exit(state, i, now, flight)
    if near:
        wall_time, wall = next_wall_event(state, rules, i, now, near)
        if wall_time < best:
            best = wall_time
            partner = wall
    neighbours = state.neighbours
    for k in range(1, neighbours[i, 0] + 1):
        j = as_index(neighbours[i, k])
        when = now + wait_for_pair(state, rules, i, flight, j, now, near != 0, best - now)
        if when < best:
            best = when
            partner = as_int64(j)
    set_pending(state, i, best, partner)


@inlined
def shell_exit(state: State, i: int, now: float, flight: tuple[Vector, Vector]) -> float:
    """Time at which a bead leaves the shell in which its neighbour list is valid."""
    place, velocity = flight
    a = square_of(velocity)
    if a == 0.0:
        return np.inf
    qx = place[0] - state.references[i, 0]
    qy = place[1] - state.references[i, 1]
    qz = place[2] - state.references[i, 2]
    b = qx * velocity[0] + qy * velocity[1] + qz * velocity[2]
    c = qx * qx + qy * qy + qz * qz - state.reach[HALF_SKIN] * state.reach[HALF_SKIN]
    if c >= 0.0:
        return now
    root = math.sqrt(b * b - a * c)
    return now + flight_time(state, i, -c / (b + root) if b > 0.0 else (root - b) / a)


@inlined
def predict(state: State, rules: Rules, i: int, now: float) -> None:
    """Predict the next event of a bead and make it pending."""
    if state.references.shape[0]:
        predict_among_neighbours(state, rules, i, now)
    elif rules.periodic[0] or rules.periodic[1] or rules.periodic[2]:
        predict_among_all(state, rules, i, now, True)
    else:
        predict_among_all(state, rules, i, now, False)
