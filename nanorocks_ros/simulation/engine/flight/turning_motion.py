"""Free motion of rigid bodies that turn: exact, and evaluated at any time.

A body moves with the constant velocity of its centre and turns with its constant angular
momentum. Its orientation is a quaternion, a power series in time that holds for a *stretch* of
time, see `rotation_series`. Where every bead is follows from it: the shape of a body never
changes. Whether bodies turn is in the type of the state; where they do not, the compiler leaves
this module out.

With drag its velocity decays as that of a bead (`gas_drag`), and its angular momentum along its
own axes is a power series as well.

Tested by ``test/simulation/engine/flight/test_turning_motion.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.numerics.compiled import inlined, kernel_where
from nanorocks_ros.numerics.exponentials import decayed
from nanorocks_ros.simulation.engine.flight.drag_rates import flown, is_dragged
from nanorocks_ros.simulation.engine.gas_state import (
    BODY,
    FOLLOWING,
    OF_BODY,
    X,
    Y,
    Z,
)
from nanorocks_ros.simulation.engine.integer_width import as_int64
from nanorocks_ros.simulation.engine.vectors import cross, difference, scaled, sum_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from nanorocks_ros.numerics.compiled import Function
    from nanorocks_ros.simulation.engine.gas_state import State
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules
    from nanorocks_ros.simulation.engine.vectors import Vector

Quaternion = tuple[float, float, float, float]

# Highest power of time in the series.
ORDER = 16

# Columns of State.motions, in the row of the number of the body: the stretch of time; centre,
# velocity and angular momentum (about the centre), the inverse tensor of inertia along the axes
# of the body (xx, yy, zz, xy, xz, yz); bounds during the stretch on the angular velocity, and on
# the acceleration of a bead per distance from the centre; with drag the rate at which the velocity
# decays, and the torque per angular velocity, a tensor like that of inertia; the series, power by
# power.
FROM, UNTIL = range(2)
CENTRE, VELOCITY, MOMENT, INVERSE, MAX_SPIN, MAX_BEND = 2, 5, 8, 11, 17, 18
RATE, TORQUE = 19, 20
SERIES = 26
# In the row of a bead: where it is from the centre, along the axes of the body.
ARM = SERIES + 4 * (ORDER + 1)
# With drag, the series of the angular momentum along the axes of the body.
MOMENTS = ARM + 3
COLUMNS = MOMENTS + 3 * (ORDER + 1)
# Rows after those of the bodies, in which a series is computed.
_SCRATCH_ROWS = 2

_TURNING = 2
_NOTHING = 0.0, 0.0, 0.0


def new_motions(n: int, rules: Rules) -> NDArray[np.float64]:
    """`State.motions` of n beads without bodies."""
    return np.zeros((n + _SCRATCH_ROWS, COLUMNS) if rules.rotating else 0)


def _has_motions(state: Any) -> bool:
    """Whether the type of a state is that of bodies that turn."""
    return bool(state.types[state.fields.index('motions')].ndim == _TURNING)


def where_turning(otherwise: object) -> Callable[[Function], Function]:
    """Compile a kernel of a state, see `compiled.kernel_where`, only where bodies turn."""
    return kernel_where(_has_motions, otherwise)


@inlined
def is_turning(state: State) -> bool:
    """Whether bodies turn; a constant for the compiler, since it is in the type of the state."""
    return bool(state.motions.ndim == _TURNING)


@inlined
def turns(state: State, i: int) -> bool:
    """Whether a bead belongs to a free body of several beads; only where bodies turn."""
    if state.bodies[i, FOLLOWING] == i:
        return False
    return not math.isinf(state.masses[state.bodies[i, BODY], OF_BODY])


@inlined
def motion(state: State, body: int, column: int) -> float:
    """A number of the motion of a body."""
    return state.motions.flat[COLUMNS * body + column]


@inlined
def set_motion(state: State, body: int, column: int, value: float) -> None:
    """Set a number of the motion of a body."""
    state.motions.flat[COLUMNS * body + column] = value


@inlined
def motion_vector(state: State, body: int, column: int) -> Vector:
    """Three numbers of the motion of a body."""
    first = COLUMNS * body + column
    motions = state.motions.flat
    return motions[first], motions[first + 1], motions[first + 2]


@inlined
def set_motion_vector(state: State, body: int, column: int, vector: Vector) -> None:
    """Set three numbers of the motion of a body."""
    for axis in range(3):
        state.motions.flat[COLUMNS * body + column + axis] = vector[axis]


@inlined
def body_of(state: State, i: int) -> int:
    """Number of the body of a bead."""
    return as_int64(state.bodies[i, BODY])


@inlined
def rotated(q: Quaternion, v: Vector) -> Vector:
    """A vector turned by a quaternion of any length."""
    u = q[1], q[2], q[3]
    first = cross(u, v)
    second = cross(u, first)
    twice = 2.0 / (q[0] * q[0] + u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    return sum_of(v, scaled(sum_of(scaled(first, q[0]), second), twice))


@inlined
def conjugate(q: Quaternion) -> Quaternion:
    """The quaternion that turns back."""
    return q[0], -q[1], -q[2], -q[3]


@inlined
def times_inverse_inertia(state: State, body: int, v: Vector) -> Vector:
    """Inverse tensor of inertia times a vector, both along the axes of the body."""
    return times_tensor(state, body, INVERSE, v)


@inlined
def times_tensor(state: State, body: int, column: int, v: Vector) -> Vector:
    """A symmetric tensor of a body times a vector, both along the axes of the body."""
    first = COLUMNS * body + column
    j = state.motions.flat
    xx, yy, zz = j[first], j[first + 1], j[first + 2]
    xy, xz, yz = j[first + 3], j[first + 4], j[first + 5]
    return (
        xx * v[0] + xy * v[1] + xz * v[2],
        xy * v[0] + yy * v[1] + yz * v[2],
        xz * v[0] + yz * v[1] + zz * v[2],
    )


@inlined
def turn_power(state: State, body: int, power: int) -> Quaternion:
    """A power of the series of the orientation; that of 0 is the orientation at its start."""
    first = COLUMNS * body + SERIES + 4 * power
    series = state.motions.flat
    return series[first], series[first + 1], series[first + 2], series[first + 3]


@inlined
def orientation(state: State, body: int, now: float) -> Quaternion:
    """Orientation of a body at a time of its stretch."""
    since = now - motion(state, body, FROM)
    first = COLUMNS * body + SERIES
    series = state.motions.flat
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for power in range(ORDER, -1, -1):
        k = first + 4 * power
        a = a * since + series[k]
        b = b * since + series[k + 1]
        c = c * since + series[k + 2]
        d = d * since + series[k + 3]
    return a, b, c, d


@inlined
def velocity_of_centre(state: State, body: int, now: float) -> Vector:
    """Velocity of the centre of mass of a body at a time of its stretch, [m/s]."""
    velocity = motion_vector(state, body, VELOCITY)
    if is_dragged(state):
        since = now - motion(state, body, FROM)
        return scaled(velocity, decayed(motion(state, body, RATE) * since)[1])
    return velocity


@inlined
def own_moment(state: State, body: int, q: Quaternion, now: float) -> Vector:
    """Angular momentum of a body along its own axes at a time of its stretch, [kg m^2/s].

    Parameters
    ----------
    state : State
    body : int
    q : tuple of 4 floats
        Its orientation.
    now : float, [s]
    """
    if is_dragged(state):
        since = now - motion(state, body, FROM)
        first = COLUMNS * body + MOMENTS
        series = state.motions.flat
        x, y, z = 0.0, 0.0, 0.0
        for power in range(ORDER, -1, -1):
            k = first + 3 * power
            x = x * since + series[k]
            y = y * since + series[k + 1]
            z = z * since + series[k + 2]
        return x, y, z
    return rotated(conjugate(q), motion_vector(state, body, MOMENT))


@inlined
def angular_velocity(state: State, body: int, q: Quaternion, now: float) -> Vector:
    """Angular velocity of a body at a time of its stretch, [rad/s].

    Parameters
    ----------
    state : State
    body : int
    q : tuple of 4 floats
        Its orientation.
    now : float, [s]
    """
    return rotated(q, times_inverse_inertia(state, body, own_moment(state, body, q, now)))


@inlined
def centre_at(state: State, body: int, now: float) -> Vector:
    """Centre of mass of a body at a time, [m]."""
    since = now - motion(state, body, FROM)
    if is_dragged(state):
        since = flown(motion(state, body, RATE), since)
    velocity = motion_vector(state, body, VELOCITY)
    return sum_of(motion_vector(state, body, CENTRE), scaled(velocity, since))


@inlined
def arm_length(state: State, i: int) -> float:
    """Distance of a bead from the centre of its body, [m]."""
    x, y, z = motion_vector(state, i, ARM)
    return math.sqrt(x * x + y * y + z * z)


@where_turning((_NOTHING, _NOTHING, _NOTHING))
def turned_bead(state: State, i: int, now: float) -> tuple[Vector, Vector, Vector]:
    """Place, velocity and spin of a bead of a body that turns, [m], [m/s], [rad/s].

    Parameters
    ----------
    state : State
    i : int
    now : float, [s]
        Within the stretch of the body.
    """
    body = body_of(state, i)
    q = orientation(state, body, now)
    spin = angular_velocity(state, body, q, now)
    arm = rotated(q, motion_vector(state, i, ARM))
    place = sum_of(centre_at(state, body, now), arm)
    velocity = sum_of(velocity_of_centre(state, body, now), cross(spin, arm))
    return place, velocity, spin


@inlined
def centre_of_bead(state: State, i: int, place: Vector, now: float) -> tuple[Vector, float]:
    """Centre of the sphere in which a bead moves, and its radius: 0 where it flies straight."""
    if turns(state, i):
        return centre_at(state, body_of(state, i), now), arm_length(state, i)
    return place, 0.0


@inlined
def place_of_row(state: State, i: int) -> Vector:
    """Place of a bead at the time of its row, [m]."""
    return state.rows[i, X], state.rows[i, Y], state.rows[i, Z]


@inlined
def shift_motions(state: State, quantum: float) -> None:
    """Count the times of all motions from a later epoch."""
    for body in range(state.rows.shape[0]):
        for column in range(FROM, UNTIL + 1):
            set_motion(state, body, column, motion(state, body, column) - quantum)


@inlined
def arm_now(state: State, i: int) -> Vector:
    """Place of a bead from the centre of its body, where the motion was set at its time, [m]."""
    return difference(place_of_row(state, i), motion_vector(state, body_of(state, i), CENTRE))
