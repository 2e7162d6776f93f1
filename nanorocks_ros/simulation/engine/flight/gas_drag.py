"""Free flight in a gas that slows the beads: dv/dt = -rate v.

A bead of velocity v moves by v (1 - exp(-rate t)) / rate in the time t: as far as without the
gas in its *flown time* (1 - exp(-rate t)) / rate, which ends at 1 / rate. Without drag both times
are the same number, and the compiler leaves the rest of this module out.

Tested by ``test/simulation/engine/flight/test_gas_drag.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.numerics.compiled import inlined
from nanorocks_ros.numerics.exponentials import decay_time, decayed
from nanorocks_ros.physics.stokes_drag import TURNING_PER_MOVING
from nanorocks_ros.simulation.engine.flight.turning_motion import is_turning, turned_bead, turns
from nanorocks_ros.simulation.engine.gas_state import TIME, VX, VY, VZ, X, Y, Z

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.gas_state import State

_COLUMNS = 2
OWN_RATE, _OF_BODY = range(_COLUMNS)


@inlined
def is_dragged(state: State) -> bool:
    """Whether there is drag; a constant for the compiler, since it is in the type of the state."""
    return bool(state.drag.ndim == _COLUMNS)


@inlined
def drag_rate(state: State, i: int) -> float:
    """Decay rate of the velocity of the body of a bead, [1/s]; only with drag."""
    return state.drag.flat[_COLUMNS * i + _OF_BODY]


@inlined
def set_body_drag(state: State, i: int, rate: float) -> None:
    """Set the decay rate of the body of a bead; only with drag."""
    state.drag.flat[_COLUMNS * i + _OF_BODY] = rate


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
def flown(rate: float, since: float) -> float:
    """Flown time of a decay rate, [s]."""
    if rate > 0.0:
        return decayed(rate * since)[0] / rate
    return since


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


@inlined
def position_at(state: State, i: int, now: float) -> tuple[float, float, float]:
    """Position of a bead at a time, [m]."""
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
def velocity_at(state: State, i: int, now: float) -> tuple[float, float, float]:
    """Velocity of a bead at a time, [m/s]."""
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
