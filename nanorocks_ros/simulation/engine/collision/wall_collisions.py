"""Collisions of beads with walls, at rest or moving: their times and their outcome.

Tested by ``test/simulation/engine/collision/test_conservation_ledger.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import inlined
from nanorocks_ros.simulation.engine.collision.aggregates import (
    advance,
    advance_body,
    fix_body,
    mass_of,
    propagate_velocity,
    shift_body,
)
from nanorocks_ros.simulation.engine.collision.conservation_ledger import (
    add_vector,
    angular_momentum,
    book_lost_torque,
    energy_of,
)
from nanorocks_ros.simulation.engine.collision.contact_laws import wall_restitution
from nanorocks_ros.simulation.engine.collision.friction import apply_wall_friction
from nanorocks_ros.simulation.engine.collision.moving_walls import (
    largest_acceleration,
    time_to_moving_wall,
    tray_displacement,
)
from nanorocks_ros.simulation.engine.collision.rigid_bodies import count_from, velocity_of_body
from nanorocks_ros.simulation.engine.collision.rigid_collisions import push_off_wall
from nanorocks_ros.simulation.engine.collision.turning_walls import next_wall_of_turning
from nanorocks_ros.simulation.engine.flight.drag_rates import drag_rate, is_dragged
from nanorocks_ros.simulation.engine.flight.gas_drag import flight_time, position_at, velocity_at
from nanorocks_ros.simulation.engine.flight.pair_times import speed_square
from nanorocks_ros.simulation.engine.flight.turning_contacts import ROUNDING
from nanorocks_ros.simulation.engine.flight.turning_motion import is_turning, turns
from nanorocks_ros.simulation.engine.gas_state import (
    EPOCH,
    FIX,
    IMPULSE,
    MOMENTUM,
    ORIGINAL,
    RADIUS,
    SPIN,
    VX,
    WALL,
    WALL_IMPULSE,
    WALL_LOSS,
    State,
    X,
    Y,
    Z,
    record_collision,
)
from nanorocks_ros.simulation.engine.integer_width import as_int64
from nanorocks_ros.simulation.engine.recent_contacts import is_repeated
from nanorocks_ros.simulation.engine.vectors import cross, length

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules

# A bead farther from a wall than this fraction of its radius does not touch it.
_APART = 1e-6


@inlined
def time_to_wall(
    position: float, velocity: float, radius: float, side: float
) -> tuple[float, int]:
    """Time until a bead hits a wall of an axis, and which one (0: low, 1: high).

    0 for a bead on or behind the wall that it moves towards; infinite for one at rest.
    """
    if velocity > 0.0:
        return max((side - radius - position) / velocity, 0.0), 1
    if velocity < 0.0:
        return max((radius - position) / velocity, 0.0), 0
    return np.inf, 0


@inlined
def next_wall_event(
    state: State, rules: Rules, i: int, now: float, near: int
) -> tuple[float, int]:
    """Time and partner of the first wall event of a bead.

    Parameters
    ----------
    state : State
    rules : Rules
    i : int
    now : float, [s]
    near : int
        Bits of the walls to check, two for each axis.
    """
    if is_turning(state) and turns(state, i):
        return next_wall_of_turning(state, rules, i, now, near)
    rows = state.rows
    rate = drag_rate(state, i) if is_dragged(state) else 0.0
    place = position_at(state, i, now)
    flying = velocity_at(state, i, now)
    best = np.inf
    partner = -1
    for axis in range(3):
        if rules.periodic[axis] or (near >> (2 * axis)) & 3 == 0:
            continue
        velocity = flying[axis]
        position = place[axis]
        if rules.moving and rules.amplitude[axis] != 0.0:
            epoch = state.clock[EPOCH]
            for far in range(2):
                bead = position, velocity, rows[i, RADIUS], rate
                when = time_to_moving_wall(rules, axis, bead, far, epoch + now) - epoch
                if when < best:
                    best = max(when, now)
                    partner = -1 - (2 * axis + far)
        else:
            wait, far = time_to_wall(position, velocity, rows[i, RADIUS], rules.sides[axis])
            wait = flight_time(state, i, wait)
            if now + wait < best:
                best = now + wait
                partner = -1 - (2 * axis + far)
    return best, partner


@inlined
def sticks_to_wall(state: State, rules: Rules, i: int, axis: int) -> bool:
    """Whether a bead hits a wall at rest slowly enough to stick."""
    if not (rules.sticky and rules.wall_sticking_speed > 0.0):
        return False
    measure = abs(state.rows[i, VX + axis])
    if rules.total_measure:
        measure = math.sqrt(speed_square(state.rows, i))
    return bool(measure < rules.wall_sticking_speed)


@inlined
def stick_to_wall(state: State, rules: Rules, i: int, wall: int, now: float) -> int:
    """Fix a body to a wall; returns the number of marked beads."""
    rows = state.rows
    mass = mass_of(state, rules, i)
    outward = 1.0 if wall % 2 else -1.0
    count_from(state, i, now)
    velocity = velocity_of_body(state, i)
    state.ledger[WALL_IMPULSE + wall] += outward * mass * velocity[wall // 2]
    state.ledger[WALL_LOSS] += energy_of(state, rules, i)
    add_vector(state, MOMENTUM, (mass * velocity[0], mass * velocity[1], mass * velocity[2]))
    add_vector(state, SPIN, angular_momentum(state, rules, i, now))
    state.counts[FIX] += 1
    record_collision(state, FIX, abs(rows[i, VX + wall // 2]), mass * length(velocity))
    fix_body(state, rules, i)
    for axis in range(3):
        rows[i, VX + axis] = 0.0
    return propagate_velocity(state, rules, i, now, 0)


@inlined
def bounce_off_wall(state: State, rules: Rules, i: int, wall: int, now: float) -> int:
    """Reflect the body of a bead at a wall, or fix it there.

    Returns
    -------
    int
        Beads marked; 0 when the bead has not reached the wall.
    """
    rows = state.rows
    advance(state, i, now)
    axis = wall // 2
    radius = rows[i, RADIUS]
    moved, wall_speed = 0.0, 0.0
    if rules.moving:
        moved, wall_speed = tray_displacement(rules, axis, state.clock[EPOCH] + now)
    surface = moved + (rules.sides[axis] - radius if wall % 2 else radius)
    if rules.moving and abs(rows[i, X + axis] - surface) > _APART * radius:
        return 0
    if is_turning(state) and turns(state, i):
        # A search that takes many steps ends before the contact.
        distant = abs(rows[i, X + axis] - surface) > _APART * radius
        if distant or is_leaving(state, i, wall, wall_speed):
            return 0
        advance_body(state, i, now)
    shift_body(state, rules, i, axis, surface - rows[i, X + axis])
    rows[i, X + axis] = surface
    number = as_int64(state.links[i, ORIGINAL])
    key = rows.shape[0] + wall
    elastic = is_repeated(state.contacts, number, key, now, rules.contact_duration)
    if sticks_to_wall(state, rules, i, axis):
        return stick_to_wall(state, rules, i, wall, now)
    state.counts[WALL] += 1
    before = rows[i, VX + axis] - wall_speed
    after = -wall_restitution(state, rules, wall, abs(before), elastic) * before
    if rules.moving:
        after = with_least_rebound(state, rules, i, wall, now, after)
    marked = 0
    if is_turning(state) and turns(state, i):
        marked, mass, after = push_off_wall(state, rules, i, axis, now, (before, after))
    else:
        rows[i, VX + axis] = wall_speed + after
        mass = mass_of(state, rules, i)
    normal_impulse = mass * (before - after)
    state.ledger[WALL_LOSS] += (
        0.5 * mass * (before * before - after * after) + normal_impulse * wall_speed
    )
    state.ledger[WALL_IMPULSE + wall] += normal_impulse if wall % 2 else -normal_impulse
    state.ledger[MOMENTUM + axis] += normal_impulse
    record_collision(state, WALL, abs(before), abs(normal_impulse))
    if rules.rough or rules.sticky:
        book_wall_collision(state, rules, i, wall, now, normal_impulse, elastic)
    if marked:
        return marked
    return propagate_velocity(state, rules, i, now, 0)


@inlined
def is_leaving(state: State, i: int, wall: int, wall_speed: float) -> bool:
    """Whether a bead of a body that turns does not approach a wall, but for rounding."""
    outward = 1.0 if wall % 2 else -1.0
    approach = outward * (state.rows[i, VX + wall // 2] - wall_speed)
    return bool(approach <= ROUNDING * math.sqrt(speed_square(state.rows, i)))


@inlined
def with_least_rebound(
    state: State, rules: Rules, i: int, wall: int, now: float, after: float
) -> float:
    """Speed relative to a moving wall after a bounce, at least that of half a contact duration.

    Without this, an accelerating wall would hit the same bead without end at one instant.
    """
    time = state.clock[EPOCH] + now
    if not rules.start <= time < rules.end:
        return after
    pressing = largest_acceleration(rules, wall // 2, time)
    if is_dragged(state):
        pressing += drag_rate(state, i) * abs(state.rows[i, VX + wall // 2])
    least = 0.5 * pressing * rules.contact_duration
    if abs(after) >= least:
        return after
    return -least if wall % 2 else least


@inlined
def book_wall_collision(
    state: State, rules: Rules, i: int, wall: int, now: float, normal_impulse: float, elastic: bool
) -> None:
    """Apply the friction of a wall collision, and book its angular momentum."""
    axis = wall // 2
    outward = 1.0 if wall % 2 else -1.0
    normal = outward * (axis == 0), outward * (axis == 1), outward * (axis == 2)
    impulse = (
        normal_impulse * (axis == 0),
        normal_impulse * (axis == 1),
        normal_impulse * (axis == 2),
    )
    rows = state.rows
    if rules.rough:
        time = state.clock[EPOCH] + now
        velocity = (
            tray_displacement(rules, 0, time)[1],
            tray_displacement(rules, 1, time)[1],
            tray_displacement(rules, 2, time)[1],
        )
        restitution = -1.0 if elastic else rules.wall_tangential
        tangential_impulse, heat = apply_wall_friction(
            state, rules, i, normal, velocity, restitution, normal_impulse
        )
        work = (
            tangential_impulse[0] * velocity[0]
            + tangential_impulse[1] * velocity[1]
            + tangential_impulse[2] * velocity[2]
        )
        state.ledger[WALL_LOSS] += heat + work
        add_vector(state, MOMENTUM, tangential_impulse)
        impulse = (
            impulse[0] + tangential_impulse[0],
            impulse[1] + tangential_impulse[1],
            impulse[2] + tangential_impulse[2],
        )
        state.last[IMPULSE] = length(impulse)
    arm = rows[i, RADIUS]
    contact = (
        rows[i, X] + arm * normal[0],
        rows[i, Y] + arm * normal[1],
        rows[i, Z] + arm * normal[2],
    )
    add_vector(state, SPIN, cross(contact, impulse))
    book_lost_torque(state, rules, i, contact, (-impulse[0], -impulse[1], -impulse[2]), now)
