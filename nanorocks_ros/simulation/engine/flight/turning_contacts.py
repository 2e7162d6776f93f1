"""Contact times of beads of bodies that turn, with other beads and with walls.

Their paths are bent, and contacts have no closed form. As with drag (`unequal_drag`), steps
approach a contact that cannot pass it: the gap closes no faster than a parabola with the present
gap and opening speed that bends as much as the bodies, and the gas, can accelerate the beads. Each
search ends with the stretch of the motion of the bodies; what comes later is predicted when a body
gets a new stretch.

Tested by ``test/simulation/engine/flight/test_turning_contacts.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import inlined
from nanorocks_ros.simulation.engine.flight.drag_rates import drag_rate, is_dragged
from nanorocks_ros.simulation.engine.flight.gas_drag import flight_in_gas, flight_time
from nanorocks_ros.simulation.engine.flight.pair_times import is_rounding
from nanorocks_ros.simulation.engine.flight.turning_motion import (
    MAX_BEND,
    MAX_SPIN,
    UNTIL,
    arm_length,
    body_of,
    centre_of_bead,
    motion,
    turned_bead,
    turns,
    velocity_of_centre,
    where_turning,
)
from nanorocks_ros.simulation.engine.flight.unequal_drag import earliest_closing
from nanorocks_ros.simulation.engine.gas_state import (
    BODY,
    HALF_SKIN,
    RADIUS,
    TIME,
    VX,
    VY,
    VZ,
    X,
    Y,
    Z,
)
from nanorocks_ros.simulation.engine.vectors import difference, length, product, scaled, sum_of

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.gas_state import State
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules
    from nanorocks_ros.simulation.engine.vectors import Vector

# A gap of this fraction of the reach is a contact.
CLOSED = 1e-12
# Normal speeds below this fraction of the speeds are rounding.
ROUNDING = 1e-13
# A search that takes more steps goes on in an event of its own.
MOST_STEPS = 200
# The spheres around the paths of beads are wider by this fraction.
_SLACK = 1e-9
# The exit from a shell is approached to this part of its radius, within so many steps.
_NEAR_EXIT, _EXIT_STEPS = 0.05, 30
# Smallest step of time relative to the time: some units in the last place.
LEAST_STEP = 2e-15


@inlined
def bead_at(state: State, i: int, now: float) -> tuple[Vector, Vector]:
    """Place and velocity of any bead, [m], [m/s]."""
    if is_dragged(state):
        return flight_in_gas(state, i, now)
    if turns(state, i):
        place, velocity, _ = turned_bead(state, i, now)
        return place, velocity
    rows = state.rows
    velocity = rows[i, VX], rows[i, VY], rows[i, VZ]
    since = now - rows[i, TIME]
    return sum_of((rows[i, X], rows[i, Y], rows[i, Z]), scaled(velocity, since)), velocity


@inlined
def straight_velocity(state: State, i: int, now: float) -> Vector:
    """Velocity of a bead, or of the centre of a body that turns, [m/s]."""
    if turns(state, i):
        return velocity_of_centre(state, body_of(state, i), now)
    if is_dragged(state):
        return flight_in_gas(state, i, now)[1]
    return state.rows[i, VX], state.rows[i, VY], state.rows[i, VZ]


@inlined
def end_of_stretch(state: State, i: int) -> float:
    """Time until which the path of a bead is known, [s]."""
    if turns(state, i):
        return motion(state, body_of(state, i), UNTIL)
    return np.inf


@inlined
def largest_bend(state: State, i: int, now: float) -> float:
    """Bound on the acceleration of a bead from a time on, in its stretch, [m/s^2]."""
    bend = 0.0
    if turns(state, i):
        bend = motion(state, body_of(state, i), MAX_BEND) * arm_length(state, i)
    if is_dragged(state):
        bend += drag_rate(state, i) * length(straight_velocity(state, i, now))
    return bend


@inlined
def largest_speed(state: State, i: int, now: float) -> float:
    """Bound on the speed of a bead of a body that turns from a time on, in its stretch, [m/s]."""
    body = body_of(state, i)
    speed = length(velocity_of_centre(state, body, now))
    return speed + motion(state, body, MAX_SPIN) * arm_length(state, i)


@inlined
def encounter(state: State, i: int, j: int, now: float) -> tuple[float, float]:
    """Times from now between which the spheres around the paths of two beads overlap, [s].

    A bead of a body that turns stays on a sphere around the centre of the body, which flies
    straight. Infinite when they never do. Where the gas slows both at different rates the first is
    a bound below, and the second infinite.
    """
    place, arm = centre_of_bead(state, i, bead_at(state, i, now)[0], now)
    other, other_arm = centre_of_bead(state, j, bead_at(state, j, now)[0], now)
    d = difference(other, place)
    velocity, other_velocity = straight_velocity(state, i, now), straight_velocity(state, j, now)
    u = difference(other_velocity, velocity)
    reach = arm + other_arm + state.rows[i, RADIUS] + state.rows[j, RADIUS]
    reach *= 1.0 + _SLACK
    if is_dragged(state) and drag_rate(state, i) != drag_rate(state, j):
        gap, speed = length(d) - reach, length(velocity) + length(other_velocity)
        if gap <= 0.0:
            return 0.0, np.inf
        return gap / speed if speed > 0.0 else np.inf, np.inf
    square = product(u, u)
    approach = product(d, u)
    gap_square = product(d, d) - reach * reach
    if square == 0.0:
        return (0.0, np.inf) if gap_square <= 0.0 else (np.inf, np.inf)
    if gap_square > 0.0 and approach >= 0.0:
        return np.inf, np.inf
    discriminant = approach * approach - square * gap_square
    if discriminant < 0.0:
        return np.inf, np.inf
    root = math.sqrt(discriminant)
    first = 0.0 if gap_square <= 0.0 else gap_square / (root - approach)
    return flight_time(state, i, first), flight_time(state, i, (root - approach) / square)


@inlined
def step_at_rest(gap: float, bend: float) -> float:
    """Time in which beads that rest against each other can overlap by a gap at most, [s]."""
    return math.sqrt(2.0 * gap / bend) if bend > 0.0 else np.inf


@where_turning(0.0)
def wait_with_turning(
    state: State, rules: Rules, i: int, j: int, now: float, limit: float
) -> float:
    """Time until two beads touch, at least one of which belongs to a body that turns, [s].

    Parameters
    ----------
    state : State
    rules : Rules
    i, j : int
    now : float, [s]
    limit : float, [s]
        Later contacts are not wanted.

    Returns
    -------
    float
        Or a bound below it, after many steps; infinite when it is not before the limit, nor
        before the end of the stretch of either body.
    """
    if state.bodies[i, BODY] == state.bodies[j, BODY]:
        return np.inf
    first, last = encounter(state, i, j, now)
    ends = min(end_of_stretch(state, i), end_of_stretch(state, j)) - now
    last = min(last, limit, ends)
    if not first <= last:
        return np.inf
    reach = state.rows[i, RADIUS] + state.rows[j, RADIUS]
    bend = largest_bend(state, i, now) + largest_bend(state, j, now)
    wait = first
    for _ in range(MOST_STEPS):
        place, velocity = bead_at(state, i, now + wait)
        other, other_velocity = bead_at(state, j, now + wait)
        apart = difference(other, place)
        square = product(apart, apart)
        approach = product(apart, difference(other_velocity, velocity))
        distance = math.sqrt(square)
        gap, opening = distance - reach, approach / distance
        closed = CLOSED * reach
        step = LEAST_STEP * (now + wait)
        if gap > closed:
            step = max(step, earliest_closing(gap, opening, bend))
        else:
            speeds = product(velocity, velocity), product(other_velocity, other_velocity)
            if opening < 0.0 and not is_rounding(approach, square, speeds[0], speeds[1]):
                return wait
            step = max(step, earliest_closing(0.0, max(opening, 0.0), bend))
            step = max(step, step_at_rest(closed, bend))
        wait += step
        if not (wait <= last and wait < np.inf):
            return np.inf
    return wait


@where_turning(0.0)
def shell_exit_of_turning(state: State, i: int, now: float) -> float:
    """Time before which a bead of a body that turns stays in the shell of its list, [s].

    Near its exit, but not after it.
    """
    half = state.reach[HALF_SKIN]
    x, y, z = state.references[i, 0], state.references[i, 1], state.references[i, 2]
    speed = largest_speed(state, i, now)
    time, end = now, end_of_stretch(state, i)
    if speed == 0.0:
        return end
    for _ in range(_EXIT_STEPS):
        left = half - length(difference(bead_at(state, i, time)[0], (x, y, z)))
        if left <= _NEAR_EXIT * half:
            break
        time += left / speed
        if time >= end:
            return end
    return time
