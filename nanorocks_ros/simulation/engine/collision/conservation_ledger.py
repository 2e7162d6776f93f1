"""Ledger of the energy, momentum and angular momentum that leave the beads."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.numerics.compiled import inlined
from nanorocks_ros.simulation.engine.collision.aggregates import advance, can_rotate, mass_of
from nanorocks_ros.simulation.engine.collision.rigid_bodies import (
    moment_of_body,
    rotation_energy,
    velocity_of_body,
)
from nanorocks_ros.simulation.engine.flight.turning_motion import is_turning
from nanorocks_ros.simulation.engine.gas_state import (
    AGGREGATE_SPIN,
    FOLLOWING,
    INERTIA,
    MOMENTUM,
    OWN,
    RADIUS,
    SPIN,
    State,
    X,
    Y,
    Z,
)
from nanorocks_ros.simulation.engine.integer_width import as_int64
from nanorocks_ros.simulation.engine.vectors import cross, sum_of

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules
    from nanorocks_ros.simulation.engine.vectors import Vector


@inlined
def centre_of_mass(state: State, i: int, now: float) -> Vector:
    """Centre of mass of the body of a bead; moves its beads to the time."""
    x, y, z, mass = 0.0, 0.0, 0.0, 0.0
    k = i
    while True:
        advance(state, k, now)
        x += state.masses[k, OWN] * state.rows[k, X]
        y += state.masses[k, OWN] * state.rows[k, Y]
        z += state.masses[k, OWN] * state.rows[k, Z]
        mass += state.masses[k, OWN]
        k = as_int64(state.bodies[k, FOLLOWING])
        if k == i:
            break
    return x / mass, y / mass, z / mass


@inlined
def add_vector(state: State, place: int, vector: Vector) -> None:
    """Add a vector to three places of the ledger."""
    for axis in range(3):
        state.ledger[place + axis] += vector[axis]


@inlined
def book_lost_torque(
    state: State, rules: Rules, i: int, contact: Vector, impulse: Vector, now: float
) -> None:
    """Book the angular momentum of an impulse on a body that cannot rotate.

    Parameters
    ----------
    state : State
    rules : Rules
    i : int
    contact : tuple of 3 floats, [m]
    impulse : tuple of 3 floats, [kg m/s]
        On the body of bead i.
    now : float, [s]
    """
    if not rules.sticky:
        return
    if math.isinf(mass_of(state, rules, i)):
        add_vector(state, MOMENTUM, impulse)
        add_vector(state, SPIN, cross(contact, impulse))
    elif not (is_turning(state) or can_rotate(state, rules, i)):
        centre = centre_of_mass(state, i, now)
        lever = contact[0] - centre[0], contact[1] - centre[1], contact[2] - centre[2]
        add_vector(state, AGGREGATE_SPIN, cross(lever, impulse))


@inlined
def angular_momentum(state: State, rules: Rules, i: int, now: float) -> Vector:
    """Angular momentum about the origin of a body that is free to move, [kg m^2/s]."""
    mass = mass_of(state, rules, i)
    v = velocity_of_body(state, i)
    x, y, z = cross(centre_of_mass(state, i, now), (mass * v[0], mass * v[1], mass * v[2]))
    if is_turning(state):
        x, y, z = sum_of((x, y, z), moment_of_body(state, i))
    if rules.rough and state.bodies[i, FOLLOWING] == i:
        radius = state.rows[i, RADIUS]
        inertia = INERTIA * state.masses[i, OWN] * radius * radius
        x += inertia * state.spins[i, 0]
        y += inertia * state.spins[i, 1]
        z += inertia * state.spins[i, 2]
    return x, y, z


@inlined
def energy_of(state: State, rules: Rules, i: int) -> float:
    """Kinetic energy of a body, 0 when stuck, [J]."""
    mass = mass_of(state, rules, i)
    if math.isinf(mass):
        return 0.0
    rows = state.rows
    v = velocity_of_body(state, i)
    square = v[0] ** 2 + v[1] ** 2 + v[2] ** 2
    energy = 0.5 * mass * square + rotation_energy(state, i)
    if rules.rough and state.bodies[i, FOLLOWING] == i:
        radius = rows[i, RADIUS]
        spin = state.spins[i, 0] ** 2 + state.spins[i, 1] ** 2 + state.spins[i, 2] ** 2
        energy += 0.5 * INERTIA * state.masses[i, OWN] * radius * radius * spin
    return float(energy)
