"""Contact times of two beads that the gas slows at different rates.

Their relative path is bent, so that beads that move apart can meet later, and the time of a
contact has no closed form. It is approached by steps that cannot pass it: the gap closes no
faster than a parabola with the present gap and closing speed that bends as much as the drag of
both beads can bend it.

Tested by ``test/simulation/engine/flight/test_unequal_drag.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined
from nanorocks_ros.numerics.exponentials import decayed
from nanorocks_ros.simulation.engine.flight.drag_rates import drag_rate
from nanorocks_ros.simulation.engine.flight.pair_times import is_rounding, minimum_image
from nanorocks_ros.simulation.engine.gas_state import BODY, RADIUS
from nanorocks_ros.simulation.engine.vectors import difference, product, scaled

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.flight.pair_times import Flights
    from nanorocks_ros.simulation.engine.gas_state import State
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules
    from nanorocks_ros.simulation.engine.vectors import Vector

# A gap of this fraction of the reach is a contact.
_CLOSED = 1e-13
_APART = 1e-9
# A search that takes more steps goes on in an event of its own; nearly all take below ten.
_MOST_STEPS = 200
# Smallest step of time relative to the time: some units in the last place.
_LEAST_STEP = 2e-15


@inlined
def wait_with_unequal_drag(
    state: State,
    rules: Rules,
    i: int,
    flights: Flights,
    j: int,
    now: float,
    folded: bool,
    limit: float,
) -> float:
    """Time until two beads touch, or a bound below it; infinite when not before a limit, [s].

    Parameters
    ----------
    state : State
    rules : Rules
    i : int
    flights : tuple of 4 vectors, [m], [m/s], [m], [m/s]
        Place and velocity now of bead i, then of bead j.
    j : int
    now : float, [s]
    folded : bool
        Whether the nearest image of j is to be found.
    limit : float, [s]
        Later contacts are not wanted.
    """
    if rules.sticky and state.bodies[i, BODY] == state.bodies[j, BODY]:
        return np.inf
    start = difference(flights[2], flights[0])
    if folded:
        start = (
            minimum_image(rules, 0, start[0]),
            minimum_image(rules, 1, start[1]),
            minimum_image(rules, 2, start[2]),
        )
    return wait_of_flights(
        start,
        (flights[1], flights[3]),
        (drag_rate(state, i), drag_rate(state, j)),
        (state.rows[i, RADIUS] + state.rows[j, RADIUS], rules.contact_duration),
        (now, limit),
    )


@compiled
def wait_of_flights(
    start: Vector,
    velocities: tuple[Vector, Vector],
    rates: tuple[float, float],
    contact: tuple[float, float],
    times: tuple[float, float],
) -> float:
    """Time until two beads of bent paths touch, as `wait_with_unequal_drag`, [s].

    Parameters
    ----------
    start : tuple of 3 floats, [m]
        From the first bead to the second.
    velocities : tuple of 2 vectors, [m/s]
    rates : tuple of 2 floats, [1/s]
    contact : tuple of 2 floats, [m], [s]
        Distance at the contact, and contact duration.
    times : tuple of 2 floats, [s]
        Now, and the limit.
    """
    reach, duration = contact
    now, limit = times
    time = 0.0
    for _ in range(_MOST_STEPS):
        gone, left = decayed(rates[0] * time)
        u = scaled(velocities[0], left)
        first = scaled(velocities[0], gone / rates[0] if rates[0] > 0.0 else time)
        gone, left = decayed(rates[1] * time)
        v = scaled(velocities[1], left)
        second = scaled(velocities[1], gone / rates[1] if rates[1] > 0.0 else time)
        path = difference(second, first)
        apart = start[0] + path[0], start[1] + path[1], start[2] + path[2]
        square = product(apart, apart)
        approach = product(apart, difference(v, u))
        distance = math.sqrt(square)
        opening = approach / distance
        gap = distance - reach
        squares = product(u, u), product(v, v)
        step = _LEAST_STEP * (now + time)
        if gap <= _CLOSED * reach and opening < 0.0:
            if not is_rounding(approach, square, squares[0], squares[1]):
                return time - max(gap, 0.0) / opening
            # Beads that rest against each other: drag needs time to move them.
            step = max(step, duration)
        else:
            speeds = math.sqrt(squares[0]), math.sqrt(squares[1])
            if gap * rates[0] * rates[1] > rates[1] * speeds[0] + rates[0] * speeds[1]:
                # Both come to rest before.
                return np.inf
            bend = rates[0] * speeds[0] + rates[1] * speeds[1]
            step = max(step, earliest_closing(max(gap, 0.0), opening, bend))
        time += step
        if not time < limit:
            return np.inf
    return time


@inlined
def earliest_closing(gap: float, opening: float, bend: float) -> float:
    """Time at which a gap closes that opens at a speed and bends back, [s].

    Parameters
    ----------
    gap : float, [m], >= 0
    opening : float, [m/s]
    bend : float, [m/s^2], >= 0
    """
    root = math.sqrt(opening * opening + 2.0 * bend * gap)
    if opening < 0.0:
        return 2.0 * gap / (root - opening)
    if bend > 0.0:
        return (opening + root) / bend
    return np.inf


@inlined
def is_apart(reach: float, square: float) -> bool:
    """Whether beads of a distance [m^2] do not touch yet: their search ended before."""
    least = reach * (1.0 + _APART)
    return square > least * least


@inlined
def with_least_separation(
    state: State, rules: Rules, i: int, j: int, speeds: tuple[float, float], restitution: float
) -> float:
    """Restitution of a contact, raised where drag presses the beads together at once.

    They part at least so fast that the next contact is a contact duration later; without this
    a bead that pushes another would hit it without end at one instant.

    Parameters
    ----------
    state : State
    rules : Rules
    i, j : int
    speeds : tuple of 2 floats, [m/s]
        Of both beads along the line of centres, before the contact.
    restitution : float
    """
    unlike = abs(drag_rate(state, i) - drag_rate(state, j))
    pressing = unlike * max(abs(speeds[0]), abs(speeds[1]))
    least = 0.5 * pressing * rules.contact_duration
    return max(restitution, least / abs(speeds[1] - speeds[0]))
