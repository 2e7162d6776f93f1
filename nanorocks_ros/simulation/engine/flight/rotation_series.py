"""The rotation of a free rigid body as a power series in time.

Along the axes of the body the angular momentum M obeys dM/dt = M × w, with the angular velocity
w = J M and the constant inverse tensor of inertia J; the orientation q, a quaternion, obeys
dq/dt = q w / 2. Each power of the series follows from those before. It holds for a *stretch* of
time in which the highest powers are below the rounding errors, about one radian; then the body
gets a new one. This holds for bodies of any shape, needs only + - * /, and its errors do not
grow: angular momentum is a constant of the motion, and energy follows from it and the
orientation.

A gas at rest slows the rotation by a torque -D w, with a tensor D that is constant along the axes
of the body: dM/dt = M × w - D w.

Tested by ``test/simulation/engine/flight/test_turning_motion.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import inlined, kernel
from nanorocks_ros.simulation.engine.flight.drag_rates import is_dragged
from nanorocks_ros.simulation.engine.flight.turning_motion import (
    CENTRE,
    COLUMNS,
    FROM,
    MAX_BEND,
    MAX_SPIN,
    MOMENT,
    MOMENTS,
    ORDER,
    SERIES,
    TORQUE,
    UNTIL,
    VELOCITY,
    body_of,
    centre_at,
    conjugate,
    motion,
    motion_vector,
    orientation,
    own_moment,
    rotated,
    set_motion,
    set_motion_vector,
    times_inverse_inertia,
    times_tensor,
    turn_power,
    velocity_of_centre,
)
from nanorocks_ros.simulation.engine.vectors import cross, length

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.flight.turning_motion import Quaternion
    from nanorocks_ros.simulation.engine.gas_state import State
    from nanorocks_ros.simulation.engine.vectors import Vector

# Size of the highest powers of an orientation, of length 1, at the end of its stretch.
_NEGLIGIBLE = 1e-16
# The bounds are sums of a finite series.
_MARGIN = 1.0 + 1e-6
_HALVINGS = 60
# Angular velocity below which a body that the gas slows has come to rest, [rad/s].
_AT_REST = 1e-30


@inlined
def _moment_of(state: State, power: int) -> Vector:
    first = COLUMNS * state.rows.shape[0] + 6 * power
    scratch = state.motions.flat
    return scratch[first], scratch[first + 1], scratch[first + 2]


@inlined
def _spin_of(state: State, power: int) -> Vector:
    first = COLUMNS * state.rows.shape[0] + 6 * power + 3
    scratch = state.motions.flat
    return scratch[first], scratch[first + 1], scratch[first + 2]


@inlined
def _store(state: State, body: int, power: int, moment: Vector) -> None:
    """Store a power of the angular momentum and velocity along the axes of the body."""
    first = COLUMNS * state.rows.shape[0] + 6 * power
    spin = times_inverse_inertia(state, body, moment)
    for axis in range(3):
        state.motions.flat[first + axis] = moment[axis]
        state.motions.flat[first + 3 + axis] = spin[axis]
    if is_dragged(state):
        set_motion_vector(state, body, MOMENTS + 3 * power, moment)


@inlined
def _next_power(state: State, body: int, power: int) -> None:
    """Compute a power of angular momentum, angular velocity and orientation."""
    x, y, z = 0.0, 0.0, 0.0
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for k in range(power):
        spin = _spin_of(state, power - 1 - k)
        turned = cross(_moment_of(state, k), spin)
        x, y, z = x + turned[0], y + turned[1], z + turned[2]
        q = turn_power(state, body, k)
        side = cross((q[1], q[2], q[3]), spin)
        a -= q[1] * spin[0] + q[2] * spin[1] + q[3] * spin[2]
        b += q[0] * spin[0] + side[0]
        c += q[0] * spin[1] + side[1]
        d += q[0] * spin[2] + side[2]
    if is_dragged(state):
        torque = times_tensor(state, body, TORQUE, _spin_of(state, power - 1))
        x, y, z = x - torque[0], y - torque[1], z - torque[2]
    per = 1.0 / power
    _store(state, body, power, (x * per, y * per, z * per))
    first = COLUMNS * body + SERIES + 4 * power
    series = state.motions.flat
    series[first] = 0.5 * per * a
    series[first + 1] = 0.5 * per * b
    series[first + 2] = 0.5 * per * c
    series[first + 3] = 0.5 * per * d


@inlined
def _size(q: Quaternion) -> float:
    return abs(q[0]) + abs(q[1]) + abs(q[2]) + abs(q[3])


@inlined
def _stretch(state: State, body: int, spin: float) -> float:
    """Time for which the series is exact to rounding, at most one radian, [s]."""
    last, before = _size(turn_power(state, body, ORDER)), _size(turn_power(state, body, ORDER - 1))
    duration = 1.0 / spin
    if is_dragged(state):
        # A body that hardly turns any more loses its angular momentum as fast as before.
        whole = length(_moment_of(state, 0))
        last = max(last, length(_moment_of(state, ORDER)) / whole)
        before = max(before, length(_moment_of(state, ORDER - 1)) / whole)
        duration = 1.0 / max(spin, length(_moment_of(state, 1)) / whole)
    for _ in range(_HALVINGS):
        square = duration * duration
        fourth = square * square
        eighth = fourth * fourth
        power = eighth * eighth
        if last * power + before * (power / duration) <= _NEGLIGIBLE:
            break
        duration *= 0.75
    return duration


@kernel
def expand(state: State, body: int) -> None:
    """Compute the series of a body from its orientation, angular momentum and inertia.

    Parameters
    ----------
    state : State
        The orientation is the power 0 of the series, at the time ``FROM``; changed.
    body : int
    """
    turn = turn_power(state, body, 0)
    moment = rotated(conjugate(turn), motion_vector(state, body, MOMENT))
    _store(state, body, 0, moment)
    if is_dragged(state) and length(_spin_of(state, 0)) < _AT_REST:
        set_motion_vector(state, body, MOMENT, (0.0, 0.0, 0.0))
        _store(state, body, 0, (0.0, 0.0, 0.0))
    spin = length(_spin_of(state, 0))
    for power in range(1, ORDER + 1):
        _next_power(state, body, power)
    if spin == 0.0:
        set_motion(state, body, UNTIL, np.inf)
        set_motion(state, body, MAX_SPIN, 0.0)
        set_motion(state, body, MAX_BEND, 0.0)
        return
    duration = _stretch(state, body, spin)
    greatest, change, factor = spin, 0.0, 1.0
    for power in range(1, ORDER + 1):
        size = length(_spin_of(state, power))
        change += power * size * factor
        factor *= duration
        greatest += size * factor
    set_motion(state, body, UNTIL, motion(state, body, FROM) + duration)
    set_motion(state, body, MAX_SPIN, greatest * _MARGIN)
    set_motion(state, body, MAX_BEND, (change + greatest * greatest) * _MARGIN)


@inlined
def rebase(state: State, body: int, now: float) -> None:
    """Count the motion of a body from now on; `expand` must follow.

    Parameters
    ----------
    state : State
    body : int
    now : float, [s]
        Within its stretch.
    """
    q = orientation(state, body, now)
    a, b, c, d = q
    per = 1.0 / np.sqrt(a * a + b * b + c * c + d * d)
    set_motion_vector(state, body, CENTRE, centre_at(state, body, now))
    if is_dragged(state):
        set_motion_vector(state, body, VELOCITY, velocity_of_centre(state, body, now))
        moment = rotated(q, own_moment(state, body, q, now))
        set_motion_vector(state, body, MOMENT, moment)
    first = COLUMNS * body + SERIES
    series = state.motions.flat
    series[first] = a * per
    series[first + 1] = b * per
    series[first + 2] = c * per
    series[first + 3] = d * per
    set_motion(state, body, FROM, now)


@inlined
def is_at_end(state: State, i: int, now: float) -> bool:
    """Whether the stretch of the body of a bead that turns has ended."""
    return bool(now >= motion(state, body_of(state, i), UNTIL))
