"""Free flight in a gas that slows the beads: dv/dt = -rate v.

A bead of velocity v moves by v (1 - exp(-rate t)) / rate in the time t: as far as without the
gas in its *flown time* (1 - exp(-rate t)) / rate, which ends at 1 / rate. Without drag both times
are the same number, and the compiler leaves the rest of this module out.

Tested by ``test/simulation/engine/flight/test_gas_drag.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.numerics.compiled import inlined, kernel_where
from nanorocks_ros.numerics.exponentials import decay_time, decayed
from nanorocks_ros.physics.stokes_drag import TURNING_PER_MOVING
from nanorocks_ros.simulation.engine.flight.drag_rates import (
    drag_rate,
    flown,
    is_dragged,
    turns_in_gas,
)
from nanorocks_ros.simulation.engine.flight.turning_motion import is_turning, turned_bead, turns
from nanorocks_ros.simulation.engine.gas_state import TIME, VX, VY, VZ, X, Y, Z
from nanorocks_ros.simulation.engine.vectors import scaled, sum_of

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.gas_state import State
    from nanorocks_ros.simulation.engine.vectors import Vector

_NOTHING = 0.0, 0.0, 0.0


@inlined
def flown_time(state: State, i: int, since: float) -> float:
    """Time in which a bead flies as far without drag, [s]."""
    if is_dragged(state):
        return flown(drag_rate(state, i), since)
    return since


@inlined
def flight_time(state: State, i: int, undragged: float) -> float:
    """Time from now until a bead has flown as far as in a time without drag, [s].

    Infinite when the bead comes to rest before.
    """
    if is_dragged(state):
        rate = drag_rate(state, i)
        if rate > 0.0:
            return decay_time(rate * undragged) / rate
    return undragged


@inlined
def speed_left(state: State, i: int, since: float) -> float:
    """Part of the velocity of a bead that is left after a time."""
    if is_dragged(state):
        return decayed(drag_rate(state, i) * since)[1]
    return 1.0


@inlined
def spin_left(state: State, i: int, since: float) -> float:
    """Part of the spin of a bead that is left after a time."""
    if is_dragged(state):
        return decayed(TURNING_PER_MOVING * drag_rate(state, i) * since)[1]
    return 1.0


# What all other code calls, so that it is not compiled into each place: that would take twice as
# long as without drag.
@kernel_where(turns_in_gas, (_NOTHING, _NOTHING))
def flight_in_gas(state: State, i: int, now: float) -> tuple[Vector, Vector]:
    """Place and velocity of any bead where bodies turn and a gas slows them, [m], [m/s]."""
    if turns(state, i):
        place, velocity, _ = turned_bead(state, i, now)
        return place, velocity
    rows = state.rows
    rate, since = drag_rate(state, i), now - rows[i, TIME]
    velocity = rows[i, VX], rows[i, VY], rows[i, VZ]
    place = sum_of((rows[i, X], rows[i, Y], rows[i, Z]), scaled(velocity, flown(rate, since)))
    return place, scaled(velocity, decayed(rate * since)[1])


@inlined
def position_at(state: State, i: int, now: float) -> Vector:
    """Position of a bead at a time, [m]."""
    if is_turning(state) and is_dragged(state):
        return flight_in_gas(state, i, now)[0]
    if is_turning(state) and turns(state, i):
        return turned_bead(state, i, now)[0]
    rows = state.rows
    since = flown_time(state, i, now - rows[i, TIME])
    return (
        rows[i, X] + rows[i, VX] * since,
        rows[i, Y] + rows[i, VY] * since,
        rows[i, Z] + rows[i, VZ] * since,
    )


@inlined
def velocity_at(state: State, i: int, now: float) -> Vector:
    """Velocity of a bead at a time, [m/s]."""
    if is_turning(state) and is_dragged(state):
        return flight_in_gas(state, i, now)[1]
    if is_turning(state) and turns(state, i):
        return turned_bead(state, i, now)[1]
    rows = state.rows
    if is_dragged(state):
        left = speed_left(state, i, now - rows[i, TIME])
        return rows[i, VX] * left, rows[i, VY] * left, rows[i, VZ] * left
    return rows[i, VX], rows[i, VY], rows[i, VZ]


@inlined
def joined_drag_rate(state: State, i: int, j: int, mass_i: float, mass_j: float) -> float:
    """Decay rate of two bodies that become one, [1/s]; only with drag.

    The forces on both add up, as if they were far apart: the flow around one bead does not screen
    the next.

    Parameters
    ----------
    state : State
    i, j : int
    mass_i, mass_j : float, [kg]
        Of the bodies; infinite for one that is stuck to a wall.
    """
    a, b = drag_rate(state, i), drag_rate(state, j)
    total = mass_i + mass_j
    # Equal rates stay the same number.
    if a == b or math.isinf(total):
        return a
    return (mass_i * a + mass_j * b) / total
