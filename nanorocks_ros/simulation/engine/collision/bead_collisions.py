"""Collisions of two beads: restitution, friction, merging."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.numerics.compiled import inlined
from nanorocks_ros.simulation.engine.collision.aggregates import (
    advance,
    advance_body,
    join_bodies,
    mass_of,
    propagate_velocity,
    velocity_share,
)
from nanorocks_ros.simulation.engine.collision.conservation_ledger import (
    add_vector,
    angular_momentum,
    book_lost_torque,
    energy_of,
)
from nanorocks_ros.simulation.engine.collision.contact_laws import (
    is_same_contact,
    pair_restitution,
    sticking_threshold,
)
from nanorocks_ros.simulation.engine.collision.friction import apply_pair_friction
from nanorocks_ros.simulation.engine.collision.rigid_bodies import count_from, velocity_of_body
from nanorocks_ros.simulation.engine.collision.rigid_collisions import (
    collide_rigid_bodies,
    merge_rigid_bodies,
)
from nanorocks_ros.simulation.engine.flight.drag_rates import is_dragged
from nanorocks_ros.simulation.engine.flight.pair_times import (
    is_rounding,
    minimum_image,
    speed_square,
)
from nanorocks_ros.simulation.engine.flight.turning_motion import is_turning, turns
from nanorocks_ros.simulation.engine.flight.unequal_drag import is_apart, with_least_separation
from nanorocks_ros.simulation.engine.gas_state import (
    AGGREGATE_SPIN,
    ELASTIC_PAIR,
    IMPULSE,
    MERGE,
    MERGE_LOSS,
    MOMENTUM,
    PAIR,
    PAIR_LOSS,
    RADIUS,
    SPIN,
    VX,
    VY,
    VZ,
    State,
    X,
    Y,
    Z,
    record_collision,
)
from nanorocks_ros.simulation.engine.vectors import length

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules
    from nanorocks_ros.simulation.engine.vectors import Vector

_SMOOTH = -1.0


@inlined
def is_stuck(state: State, rules: Rules, i: int) -> bool:
    """Whether a bead is stuck to a wall."""
    return math.isinf(mass_of(state, rules, i))


@inlined
def reduced_mass(state: State, rules: Rules, i: int, j: int) -> float:
    """Reduced mass of two bodies, one of which may be stuck to a wall, [kg]."""
    mass_i = mass_of(state, rules, i)
    mass_j = mass_of(state, rules, j)
    if math.isinf(mass_i):
        return mass_j
    return mass_i * velocity_share(mass_i, mass_j)


@inlined
def book_merging_body(state: State, rules: Rules, i: int, stuck: bool, now: float) -> None:
    """Book the momentum and angular momentum of a body before it merges."""
    turning = angular_momentum(state, rules, i, now)
    if not stuck:
        add_vector(state, AGGREGATE_SPIN, turning)
        return
    mass = mass_of(state, rules, i)
    add_vector(state, SPIN, turning)
    velocity = velocity_of_body(state, i)
    add_vector(state, MOMENTUM, (mass * velocity[0], mass * velocity[1], mass * velocity[2]))
    state.last[IMPULSE] = mass * length(velocity)


@inlined
def merge(state: State, rules: Rules, i: int, j: int, now: float) -> int:
    """Merge two bodies that touch, with their momentum; returns the number of marked beads."""
    rows = state.rows
    free_i = not math.isinf(mass_of(state, rules, i))
    free_j = not math.isinf(mass_of(state, rules, j))
    before = energy_of(state, rules, i) + energy_of(state, rules, j)
    stuck = not (free_i and free_j)
    if is_turning(state):
        advance_body(state, i, now)
        advance_body(state, j, now)
        count_from(state, i, now)
        count_from(state, j, now)
    if free_i:
        book_merging_body(state, rules, i, stuck, now)
    if free_j:
        book_merging_body(state, rules, j, stuck, now)
    to_i = velocity_share(mass_of(state, rules, i), mass_of(state, rules, j))
    for axis in range(3):
        u = rows[j, VX + axis] - rows[i, VX + axis]
        common = rows[j, VX + axis] if to_i == 1.0 else rows[i, VX + axis] + to_i * u
        rows[i, VX + axis] = common
        rows[j, VX + axis] = common
    marked = propagate_velocity(state, rules, j, now, propagate_velocity(state, rules, i, now, 0))
    join_bodies(state, rules, i, j)
    if not stuck:
        x, y, z = angular_momentum(state, rules, i, now)
        add_vector(state, AGGREGATE_SPIN, (-x, -y, -z))
    state.ledger[MERGE_LOSS] += before - energy_of(state, rules, i)
    state.counts[MERGE] += 1
    return marked


@inlined
def merge_touching(
    state: State, rules: Rules, i: int, j: int, now: float, speeds: tuple[float, float]
) -> int:
    """Merge the bodies of two beads that touch; returns the number of marked beads.

    Parameters
    ----------
    state : State
    rules : Rules
    i, j : int
    now : float, [s]
    speeds : tuple of 2 floats, [m/s]
        Of the approach, along the normal and in total.
    """
    stuck = is_stuck(state, rules, i) or is_stuck(state, rules, j)
    if is_turning(state) and not stuck:
        return merge_rigid_bodies(state, rules, i, j, now, speeds[0])
    record_collision(state, MERGE, speeds[0], reduced_mass(state, rules, i, j) * speeds[1])
    return merge(state, rules, i, j, now)


@inlined
def collide_pair(state: State, rules: Rules, i: int, j: int, now: float) -> int:
    """Collide two beads, or merge them when they are slow enough.

    Returns
    -------
    int
        Beads marked; 0, and no change of velocity, when they do not approach.
    """
    advance(state, i, now)
    advance(state, j, now)
    rows = state.rows
    dx = minimum_image(rules, 0, rows[j, X] - rows[i, X])
    dy = minimum_image(rules, 1, rows[j, Y] - rows[i, Y])
    dz = minimum_image(rules, 2, rows[j, Z] - rows[i, Z])
    ux = rows[j, VX] - rows[i, VX]
    uy = rows[j, VY] - rows[i, VY]
    uz = rows[j, VZ] - rows[i, VZ]
    approach = dx * ux + dy * uy + dz * uz
    square = dx * dx + dy * dy + dz * dz
    speeds = speed_square(rows, i), speed_square(rows, j)
    if approach >= 0.0 or is_rounding(approach, square, speeds[0], speeds[1]):
        return 0
    bent = is_dragged(state) or is_turning(state)
    if bent and is_apart(rows[i, RADIUS] + rows[j, RADIUS], square):
        return 0
    distance = math.sqrt(square)
    closing = approach / distance
    elastic = is_same_contact(state, rules, i, j, now)
    if rules.sticky and rules.sticking_speed > 0.0:
        speed = math.sqrt(ux * ux + uy * uy + uz * uz)
        measure = speed if rules.total_measure else -closing
        if measure < sticking_threshold(state, rules, i, j):
            return merge_touching(state, rules, i, j, now, (-closing, speed))
    restitution = 1.0
    if elastic:
        state.counts[ELASTIC_PAIR] += 1
    else:
        restitution = pair_restitution(state, rules, i, j, -closing)
    if is_dragged(state):
        along_i = (dx * rows[i, VX] + dy * rows[i, VY] + dz * rows[i, VZ]) / distance
        restitution = with_least_separation(
            state, rules, i, j, (along_i, along_i + closing), restitution
        )
    if is_turning(state) and (turns(state, i) or turns(state, j)):
        return collide_rigid_bodies(state, rules, i, j, now, closing, restitution)
    state.counts[PAIR] += 1
    change = (1.0 + restitution) * closing
    per_length = (1.0 + restitution) * approach / square
    mass_i = mass_of(state, rules, i)
    mass_j = mass_of(state, rules, j)
    to_i = per_length * velocity_share(mass_i, mass_j)
    to_j = per_length * velocity_share(mass_j, mass_i)
    rows[i, VX] += to_i * dx
    rows[i, VY] += to_i * dy
    rows[i, VZ] += to_i * dz
    rows[j, VX] -= to_j * dx
    rows[j, VY] -= to_j * dy
    rows[j, VZ] -= to_j * dz
    reduced = reduced_mass(state, rules, i, j)
    record_collision(state, PAIR, -closing, -reduced * change)
    loss = 0.5 * reduced * (1.0 - restitution * restitution) * closing * closing
    if rules.rough or rules.sticky:
        normal = dx / distance, dy / distance, dz / distance
        along = -reduced * change
        impulse = along * normal[0], along * normal[1], along * normal[2]
        if rules.rough:
            tangential = _SMOOTH if elastic else rules.tangential
            tangential_impulse, heat = apply_pair_friction(
                state, rules, i, j, normal, tangential, along
            )
            loss += heat
            impulse = (
                impulse[0] + tangential_impulse[0],
                impulse[1] + tangential_impulse[1],
                impulse[2] + tangential_impulse[2],
            )
            record_collision(state, PAIR, -closing, length(impulse))
        book_lost_torques(state, rules, i, j, normal, impulse, now)
    state.ledger[PAIR_LOSS] += loss
    return propagate_velocity(state, rules, j, now, propagate_velocity(state, rules, i, now, 0))


@inlined
def book_lost_torques(
    state: State,
    rules: Rules,
    i: int,
    j: int,
    normal: Vector,
    impulse: Vector,
    now: float,
) -> None:
    """Book the angular momentum of an impulse on j and its opposite on i that no body takes up."""
    arm = state.rows[i, RADIUS]
    contact = (
        state.rows[i, X] + arm * normal[0],
        state.rows[i, Y] + arm * normal[1],
        state.rows[i, Z] + arm * normal[2],
    )
    opposite = -impulse[0], -impulse[1], -impulse[2]
    book_lost_torque(state, rules, i, contact, opposite, now)
    book_lost_torque(state, rules, j, contact, impulse, now)
