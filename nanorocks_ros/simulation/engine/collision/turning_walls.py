"""Contact times of beads of bodies that turn with walls.

By the method of `flight.turning_contacts`.

Tested by ``test/simulation/engine/collision/test_turning_walls.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import kernel
from nanorocks_ros.simulation.engine.collision.moving_walls import (
    earliest_contact_time,
    largest_excursion,
    tray_displacement,
)
from nanorocks_ros.simulation.engine.flight.turning_contacts import (
    CLOSED,
    LEAST_STEP,
    MOST_STEPS,
    ROUNDING,
    bead_at,
    end_of_stretch,
    largest_bend,
    largest_speed,
    step_at_rest,
)
from nanorocks_ros.simulation.engine.flight.turning_motion import where_turning
from nanorocks_ros.simulation.engine.flight.unequal_drag import earliest_closing
from nanorocks_ros.simulation.engine.gas_state import EPOCH, RADIUS, WALLS, State
from nanorocks_ros.simulation.engine.vectors import length

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules


@kernel
def wait_for_wall(
    state: State, rules: Rules, i: int, wall: int, now: float, limit: float
) -> float:
    """Time until a bead of a body that turns touches a wall, [s].

    Parameters
    ----------
    state : State
    rules : Rules
    i : int
    wall : int
        Two for each axis, the far one odd.
    now : float, [s]
    limit : float, [s]
        Later contacts are not wanted.

    Returns
    -------
    float
        See `wait_with_turning`.
    """
    axis, outward = wall // 2, 1.0 if wall % 2 else -1.0
    last = min(limit, end_of_stretch(state, i) - now)
    radius = state.rows[i, RADIUS]
    moving = rules.moving and rules.amplitude[axis] != 0.0
    epoch = state.clock[EPOCH]
    bend = largest_bend(state, i, now)
    closed = CLOSED * radius
    surface = (rules.sides[axis] if wall % 2 else 0.0) - outward * radius
    room = outward * (surface - bead_at(state, i, now)[0][axis])
    if moving:
        room -= largest_excursion(rules, axis, epoch + now)
    if room > largest_speed(state, i, now) * last:
        return np.inf
    wait = 0.0
    for _ in range(MOST_STEPS):
        place, velocity = bead_at(state, i, now + wait)
        gap, opening = outward * (surface - place[axis]), -outward * velocity[axis]
        if moving:
            moved, speed = tray_displacement(rules, axis, epoch + now + wait)
            gap, opening = gap + outward * moved, opening + outward * speed
        step = LEAST_STEP * (now + wait)
        if gap <= closed:
            if opening < -ROUNDING * length(velocity):
                return wait
            step = max(step, step_at_rest(closed, bend))
        opening = opening if gap > closed else max(opening, 0.0)
        gap = gap if gap > closed else 0.0
        if moving:
            time = epoch + now + wait
            next_time = earliest_contact_time(rules, axis, time, (gap, opening, bend))
            step = max(step, next_time - time)
        else:
            step = max(step, earliest_closing(gap, opening, bend))
        wait += step
        if not (wait <= last and wait < np.inf):
            return np.inf
    return wait


@where_turning((0.0, 0))
def next_wall_of_turning(
    state: State, rules: Rules, i: int, now: float, near: int
) -> tuple[float, int]:
    """Time and partner of the first wall event of a bead of a body that turns.

    Parameters
    ----------
    state : State
    rules : Rules
    i : int
    now : float, [s]
    near : int
        Bits of the walls to check, two for each axis.
    """
    best, partner = np.inf, -1
    for wall in range(WALLS):
        if (near >> (2 * (wall // 2))) & 3 == 0:
            continue
        when = now + wait_for_wall(state, rules, i, wall, now, best - now)
        if when < best:
            best, partner = when, -1 - wall
    return best, partner
