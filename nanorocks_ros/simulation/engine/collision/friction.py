"""Friction of rough spheres: the tangential impulse of a contact, which makes beads spin.

Tested by ``test/simulation/engine/collision/test_conservation_ledger.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.numerics.compiled import inlined
from nanorocks_ros.simulation.engine.collision.aggregates import can_rotate, mass_of
from nanorocks_ros.simulation.engine.gas_state import INERTIA, OWN, RADIUS, VX, State
from nanorocks_ros.simulation.engine.vectors import cross

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules
    from nanorocks_ros.simulation.engine.vectors import Vector


@inlined
def tangential_compliance(state: State, rules: Rules, i: int) -> float:
    """Change of the surface velocity of a bead per tangential impulse, [1/kg]."""
    mass = mass_of(state, rules, i)
    inverse = 0.0 if math.isinf(mass) else 1.0 / mass
    if can_rotate(state, rules, i):
        inverse += 1.0 / (INERTIA * state.masses[i, OWN])
    return inverse


@inlined
def surface_velocity(state: State, i: int, normal: Vector, side: float) -> Vector:
    """Velocity of the surface at a contact relative to the centre of the bead, [m/s].

    Parameters
    ----------
    state : State
    i : int
    normal : tuple of 3 floats
        From the first partner to the second.
    side : float
        1 for the first partner, -1 for the second.
    """
    arm = side * state.rows[i, RADIUS]
    spin = state.spins[i, 0], state.spins[i, 1], state.spins[i, 2]
    return cross(spin, (arm * normal[0], arm * normal[1], arm * normal[2]))


@inlined
def apply_tangential_impulse(
    state: State, rules: Rules, i: int, impulse: Vector, normal: Vector, sign: float
) -> None:
    """Apply a tangential impulse to a bead: velocity of its body, and spin if it can rotate.

    Parameters
    ----------
    state : State
    rules : Rules
    i : int
    impulse : tuple of 3 floats, [kg m/s]
        On the second partner.
    normal : tuple of 3 floats
        From the first partner to the second.
    sign : float
        -1 for the first partner, 1 for the second.
    """
    mass = mass_of(state, rules, i)
    if not math.isinf(mass):
        for axis in range(3):
            state.rows[i, VX + axis] += sign * impulse[axis] / mass
    if can_rotate(state, rules, i):
        turn = cross(normal, impulse)
        per = 1.0 / (INERTIA * state.masses[i, OWN] * state.rows[i, RADIUS])
        for axis in range(3):
            state.spins[i, axis] -= per * turn[axis]


@inlined
def tangential_part(slip: Vector, normal: Vector) -> Vector:
    """Component of a velocity perpendicular to a normal."""
    along = slip[0] * normal[0] + slip[1] * normal[1] + slip[2] * normal[2]
    return (
        slip[0] - along * normal[0],
        slip[1] - along * normal[1],
        slip[2] - along * normal[2],
    )


@inlined
def stick_or_slip(restitution: float, mass: float, slip: Vector, limit: float) -> float:
    """Tangential restitution of a contact, reduced where the surfaces slide.

    Parameters
    ----------
    restitution : float
        Of a contact that grips.
    mass : float, [kg]
        Tangential impulse for a change of the slip, per (1 + restitution).
    slip : tuple of 3 floats, [m/s]
    limit : float, [kg m/s]
        Coefficient of friction times the normal impulse.

    References
    ----------
    Foerster, Louge, Chang, Allia 1994, Phys. Fluids 6, 1108 (from memory).
    """
    speed = math.sqrt(slip[0] * slip[0] + slip[1] * slip[1] + slip[2] * slip[2])
    if mass * (1.0 + restitution) * speed > limit:
        return limit / (mass * speed) - 1.0
    return restitution


@inlined
def apply_pair_friction(
    state: State, rules: Rules, i: int, j: int, normal: Vector, restitution: float, along: float
) -> tuple[Vector, float]:
    """Apply the tangential impulse of a collision of two beads.

    Parameters
    ----------
    state : State
    rules : Rules
    i, j : int
    normal : tuple of 3 floats
    restitution : float
        Tangential one of a contact that grips.
    along : float, [kg m/s]
        Normal impulse, of either sign.

    Returns
    -------
    impulse : tuple of 3 floats, [kg m/s]
        On bead j.
    loss : float, [J]
    """
    rows = state.rows
    a = surface_velocity(state, i, normal, 1.0)
    b = surface_velocity(state, j, normal, -1.0)
    slip = tangential_part(
        (
            rows[j, VX] - rows[i, VX] + b[0] - a[0],
            rows[j, VX + 1] - rows[i, VX + 1] + b[1] - a[1],
            rows[j, VX + 2] - rows[i, VX + 2] + b[2] - a[2],
        ),
        normal,
    )
    mass = 1.0 / (tangential_compliance(state, rules, i) + tangential_compliance(state, rules, j))
    restitution = stick_or_slip(restitution, mass, slip, rules.friction * abs(along))
    per = -mass * (1.0 + restitution)
    impulse = per * slip[0], per * slip[1], per * slip[2]
    apply_tangential_impulse(state, rules, i, impulse, normal, -1.0)
    apply_tangential_impulse(state, rules, j, impulse, normal, 1.0)
    square = slip[0] * slip[0] + slip[1] * slip[1] + slip[2] * slip[2]
    return impulse, 0.5 * mass * (1.0 - restitution * restitution) * square


@inlined
def apply_wall_friction(
    state: State,
    rules: Rules,
    i: int,
    normal: Vector,
    wall_velocity: Vector,
    restitution: float,
    along: float,
) -> tuple[Vector, float]:
    """Apply the tangential impulse of a collision with a wall; see `apply_pair_friction`.

    Returns
    -------
    impulse : tuple of 3 floats, [kg m/s]
        On the wall.
    loss : float, [J]
        Where the wall is at rest.
    """
    rows = state.rows
    a = surface_velocity(state, i, normal, 1.0)
    slip = tangential_part(
        (
            wall_velocity[0] - rows[i, VX] - a[0],
            wall_velocity[1] - rows[i, VX + 1] - a[1],
            wall_velocity[2] - rows[i, VX + 2] - a[2],
        ),
        normal,
    )
    mass = 1.0 / tangential_compliance(state, rules, i)
    restitution = stick_or_slip(restitution, mass, slip, rules.wall_friction * abs(along))
    per = -mass * (1.0 + restitution)
    impulse = per * slip[0], per * slip[1], per * slip[2]
    apply_tangential_impulse(state, rules, i, impulse, normal, -1.0)
    square = slip[0] * slip[0] + slip[1] * slip[1] + slip[2] * slip[2]
    return impulse, 0.5 * mass * (1.0 - restitution * restitution) * square
