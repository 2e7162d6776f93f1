"""Dynamics of bodies that turn: how they form, what an impulse does to them, what they carry.

Tested by ``test/simulation/engine/collision/test_rigid_bodies.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.numerics.compiled import inlined, kernel, kernel_where
from nanorocks_ros.physics.stokes_drag import TURNING_PER_MOVING
from nanorocks_ros.simulation.engine.flight.drag_rates import (
    drag_rate,
    is_dragged,
    own_rate,
    turns_in_gas,
)
from nanorocks_ros.simulation.engine.flight.rotation_series import expand, rebase
from nanorocks_ros.simulation.engine.flight.turning_motion import (
    ARM,
    CENTRE,
    FROM,
    INVERSE,
    MOMENT,
    RATE,
    SERIES,
    TORQUE,
    VELOCITY,
    arm_now,
    body_of,
    centre_at,
    conjugate,
    is_turning,
    motion_vector,
    place_of_row,
    rotated,
    set_motion,
    set_motion_vector,
    times_inverse_inertia,
    turn_power,
    turns,
)
from nanorocks_ros.simulation.engine.gas_state import (
    FOLLOWING,
    INERTIA,
    OF_BODY,
    OWN,
    RADIUS,
    VX,
    VY,
    VZ,
)
from nanorocks_ros.simulation.engine.integer_width import as_int64
from nanorocks_ros.simulation.engine.vectors import cross, difference, product, scaled, sum_of

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.gas_state import State
    from nanorocks_ros.simulation.engine.vectors import Vector


@inlined
def velocity_of_body(state: State, i: int) -> Vector:
    """Velocity of the centre of mass of the body of a bead, [m/s].

    Where the gas slows bodies, that at the beginning of its motion: `count_from` comes before.
    """
    if is_turning(state) and turns(state, i):
        return motion_vector(state, body_of(state, i), VELOCITY)
    rows = state.rows
    return rows[i, VX], rows[i, VY], rows[i, VZ]


@inlined
def centre_of_body(state: State, i: int, now: float) -> Vector:
    """Centre of a free body; of a single bead at the time of its row, [m]."""
    if turns(state, i):
        return centre_at(state, body_of(state, i), now)
    return place_of_row(state, i)


@inlined
def moment_of_body(state: State, i: int) -> Vector:
    """Angular momentum about its centre of a body that turns, otherwise 0, [kg m^2/s]."""
    if is_turning(state) and turns(state, i):
        return motion_vector(state, body_of(state, i), MOMENT)
    return 0.0, 0.0, 0.0


@inlined
def rotation_energy(state: State, i: int) -> float:
    """Energy of the rotation of a body that turns, otherwise 0, [J]."""
    if is_turning(state) and turns(state, i):
        body = body_of(state, i)
        moment = rotated(conjugate(turn_power(state, body, 0)), moment_of_body(state, i))
        return 0.5 * product(moment, times_inverse_inertia(state, body, moment))
    return 0.0


@inlined
def _tensor(state: State, i: int, per_rate: bool) -> tuple[Vector, Vector]:
    """Tensor of inertia of a body along its axes, (xx, yy, zz) and (xy, xz, yz), [kg m^2].

    With `per_rate` that of the torque of the gas per angular velocity, [kg m^2/s]: the forces on
    the beads add up, as if they were far apart, and each has the torque of a bead that turns about
    its own centre.
    """
    xx, yy, zz, xy, xz, yz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    k = i
    while True:
        mass, radius = state.masses[k, OWN], state.rows[k, RADIUS]
        spinning = INERTIA
        if per_rate:
            mass *= own_rate(state, k)
            spinning *= TURNING_PER_MOVING
        x, y, z = motion_vector(state, k, ARM)
        own = spinning * mass * radius * radius
        xx += own + mass * (y * y + z * z)
        yy += own + mass * (x * x + z * z)
        zz += own + mass * (x * x + y * y)
        xy -= mass * x * y
        xz -= mass * x * z
        yz -= mass * y * z
        k = as_int64(state.bodies[k, FOLLOWING])
        if k == i:
            break
    return (xx, yy, zz), (xy, xz, yz)


@inlined
def _set_inverse_inertia(state: State, i: int) -> None:
    """Set the inverse tensor of inertia of a body from the arms of its beads."""
    (xx, yy, zz), (xy, xz, yz) = _tensor(state, i, False)
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    per = 1.0 / (xx * a + xy * b + xz * c)
    body = body_of(state, i)
    set_motion_vector(state, body, INVERSE, (per * a, per * (xx * zz - xz * xz), 0.0))
    set_motion(state, body, INVERSE + 2, per * (xx * yy - xy * xy))
    set_motion(state, body, INVERSE + 3, per * b)
    set_motion(state, body, INVERSE + 4, per * c)
    set_motion(state, body, INVERSE + 5, per * (xy * xz - xx * yz))


@inlined
def _set_drag(state: State, i: int) -> None:
    """Set the rate of the velocity of a body, and its torque per angular velocity."""
    diagonal, other = _tensor(state, i, True)
    body = body_of(state, i)
    set_motion(state, body, RATE, drag_rate(state, i))
    set_motion_vector(state, body, TORQUE, diagonal)
    set_motion_vector(state, body, TORQUE + 3, other)


@inlined
def _set_arms(state: State, i: int, centre: Vector) -> None:
    """Set the arms of the beads of a body from their rows, along the axes of space."""
    k = i
    while True:
        set_motion_vector(state, k, ARM, difference(place_of_row(state, k), centre))
        k = as_int64(state.bodies[k, FOLLOWING])
        if k == i:
            break


@kernel
def set_rigid_body(
    state: State, i: int, now: float, centre: Vector, velocity: Vector, moment: Vector
) -> None:
    """Make a body that turns of beads that have just been joined.

    Parameters
    ----------
    state : State
        The rows of its beads are of now; changed.
    i : int
    now : float, [s]
    centre, velocity : tuple of 3 floats, [m], [m/s]
    moment : tuple of 3 floats, [kg m^2/s]
        Angular momentum about the centre.
    """
    body = body_of(state, i)
    _set_arms(state, i, centre)
    _set_inverse_inertia(state, i)
    if is_dragged(state):
        _set_drag(state, i)
    set_motion(state, body, FROM, now)
    set_motion_vector(state, body, CENTRE, centre)
    set_motion_vector(state, body, VELOCITY, velocity)
    set_motion_vector(state, body, MOMENT, moment)
    set_motion(state, body, SERIES, 1.0)
    set_motion_vector(state, body, SERIES + 1, (0.0, 0.0, 0.0))
    expand(state, body)


@inlined
def inertia_times(state: State, i: int, spin: Vector) -> Vector:
    """Tensor of inertia of a body times an angular velocity, by the arms of its beads.

    The axes of the body must be those of space.
    """
    x, y, z = 0.0, 0.0, 0.0
    k = i
    while True:
        mass, radius = state.masses[k, OWN], state.rows[k, RADIUS]
        arm = motion_vector(state, k, ARM)
        carried = cross(arm, cross(spin, arm))
        own = INERTIA * radius * radius
        x += mass * (carried[0] + own * spin[0])
        y += mass * (carried[1] + own * spin[1])
        z += mass * (carried[2] + own * spin[2])
        k = as_int64(state.bodies[k, FOLLOWING])
        if k == i:
            break
    return x, y, z


@kernel
def set_fragment(state: State, i: int, now: float, spin: Vector) -> None:
    """Make a body that turns of a fragment, whose beads keep their velocities.

    Parameters
    ----------
    state : State
        The rows of its beads are of now; changed.
    i : int
    now : float, [s]
    spin : tuple of 3 floats, [rad/s]
        Angular velocity, which the fragment keeps as well.
    """
    centre, velocity, mass = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    k = i
    while True:
        own = state.masses[k, OWN]
        mass += own
        centre = sum_of(centre, scaled(place_of_row(state, k), own))
        velocity = sum_of(
            velocity, scaled((state.rows[k, VX], state.rows[k, VY], state.rows[k, VZ]), own)
        )
        k = as_int64(state.bodies[k, FOLLOWING])
        if k == i:
            break
    centre, velocity = scaled(centre, 1.0 / mass), scaled(velocity, 1.0 / mass)
    _set_arms(state, i, centre)
    moment = inertia_times(state, i, spin)
    set_rigid_body(state, i, now, centre, velocity, moment)


@inlined
def inverse_mass_along(state: State, i: int, normal: Vector) -> float:
    """Change of the velocity of a bead along a normal per impulse along it, [1/kg].

    Parameters
    ----------
    state : State
    i : int
        After `start_impact`; its row is of now.
    normal : tuple of 3 floats
    """
    mass = state.masses[body_of(state, i), OF_BODY]
    if math.isinf(mass):
        return 0.0
    if not turns(state, i):
        return 1.0 / mass
    body = body_of(state, i)
    q = turn_power(state, body, 0)
    lever = rotated(conjugate(q), cross(arm_now(state, i), normal))
    return 1.0 / mass + product(lever, times_inverse_inertia(state, body, lever))


@inlined
def start_impact(state: State, i: int, now: float) -> None:
    """Count the motion of the body of a bead from now on, if it turns; `push` must follow."""
    if turns(state, i):
        rebase(state, body_of(state, i), now)


@kernel_where(turns_in_gas, 0)
def count_from(state: State, i: int, now: float) -> int:
    """Count the motion of a body that the gas slows from now on: it is about to end or to merge.

    Returns
    -------
    int
        Nothing: 0.
    """
    start_impact(state, i, now)
    return 0


@inlined
def push(state: State, i: int, impulse: Vector) -> None:
    """Apply an impulse at a bead, towards or from its centre, to its body.

    Parameters
    ----------
    state : State
        After `start_impact`; the row of the bead is of now.
    i : int
    impulse : tuple of 3 floats, [kg m/s]
    """
    body = body_of(state, i)
    mass = state.masses[body, OF_BODY]
    if math.isinf(mass):
        return
    change = scaled(impulse, 1.0 / mass)
    if not turns(state, i):
        for axis in range(3):
            state.rows[i, VX + axis] += change[axis]
        return
    set_motion_vector(state, body, VELOCITY, sum_of(velocity_of_body(state, i), change))
    turning = cross(arm_now(state, i), impulse)
    set_motion_vector(state, body, MOMENT, sum_of(moment_of_body(state, i), turning))
    expand(state, body)
