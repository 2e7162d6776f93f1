"""When the next event of a bead happens, and with what: every other bead and wall is asked."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.compiled import compiled
from nanorocks_ros.simulation.engine.state import (
    NOTHING,
    RADIUS,
    TIME,
    VX,
    VY,
    VZ,
    Rules,
    State,
    X,
    Y,
    Z,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Squares of the approach, relative to the speeds, that is rounding; and of the gap, relative to
# the distance, of beads that touch.
_ROUNDING = 1e-26
_TOUCHING = 1e-9


@compiled
def speed_square(rows: NDArray[np.float64], i: int) -> float:
    """Square of the speed of a bead, [m^2/s^2]."""
    vx, vy, vz = rows[i, VX], rows[i, VY], rows[i, VZ]
    return float(vx * vx + vy * vy + vz * vz)


@compiled
def time_to_plane(
    position: float, velocity: float, radius: float, side: float
) -> tuple[float, int]:
    """Time until a bead meets one of the two walls of an axis, and which one (1: the far one).

    A bead on or behind a wall that it moves towards meets it now; infinite when at rest.
    """
    if velocity > 0.0:
        return max((side - radius - position) / velocity, 0.0), 1
    if velocity < 0.0:
        return max((radius - position) / velocity, 0.0), 0
    return np.inf, 0


@compiled
def next_wall(state: State, rules: Rules, i: int, now: float) -> tuple[float, int]:
    """Time and partner of the first wall event of a bead."""
    rows = state.rows
    since = now - rows[i, TIME]
    best = np.inf
    partner = NOTHING
    for axis in range(3):
        side = rules.side_x if axis == 0 else (rules.side_y if axis == 1 else rules.side_z)
        velocity = rows[i, VX + axis]
        position = rows[i, X + axis] + velocity * since
        wait, far = time_to_plane(position, velocity, rows[i, RADIUS], side)
        if now + wait < best:
            best = now + wait
            partner = -1 - (2 * axis + far)
    return best, partner


@compiled
def time_to_contact(approach: float, speed_square: float, gap_square: float) -> float:
    """Time until two beads touch, infinite when they never do.

    Parameters
    ----------
    approach : float, [m^2/s]
        Relative position times relative velocity; negative when they approach.
    speed_square : float, [m^2/s^2]
        Of the relative velocity.
    gap_square : float, [m^2]
        Square of the distance less square of the sum of the radii. Overlapping and
        approaching beads touch now.
    """
    if approach >= 0.0:
        return np.inf
    if gap_square <= 0.0:
        return 0.0
    discriminant = approach * approach - speed_square * gap_square
    if discriminant < 0.0:
        return np.inf
    # The other form of the root, (-b - sqrt)/a, loses all digits when they nearly touch.
    return gap_square / (math.sqrt(discriminant) - approach)


@compiled
def is_rounding(
    approach: float, distance_square: float, speed_square_1: float, speed_square_2: float
) -> bool:
    """Whether two beads approach so slowly that only rounding makes it differ from rest.

    After a contact of restitution 0 the normal velocity is rounding alone; taken at its word,
    such pairs collide again and again at one instant. What is ignored here adds up to an
    overlap of 1e-13 of the path.

    Parameters
    ----------
    approach : float, [m^2/s]
        Relative position times relative velocity.
    distance_square : float, [m^2]
    speed_square_1, speed_square_2 : float, [m^2/s^2]
        Of the two beads.
    """
    scale = _ROUNDING * distance_square * (speed_square_1 + speed_square_2)
    return approach * approach <= scale


@compiled
def predict(state: State, rules: Rules, i: int, now: float) -> None:
    """Find the earliest event of a bead from now on and make it pending.

    Walls come before beads and beads by index when times are equal.
    """
    rows = state.rows
    best, partner = next_wall(state, rules, i, now)
    since = now - rows[i, TIME]
    x = rows[i, X] + rows[i, VX] * since
    y = rows[i, Y] + rows[i, VY] * since
    z = rows[i, Z] + rows[i, VZ] * since
    for j in range(rows.shape[0]):
        if j == i:
            continue
        since = now - rows[j, TIME]
        ux = rows[j, VX] - rows[i, VX]
        uy = rows[j, VY] - rows[i, VY]
        uz = rows[j, VZ] - rows[i, VZ]
        dx = rows[j, X] + rows[j, VX] * since - x
        dy = rows[j, Y] + rows[j, VY] * since - y
        dz = rows[j, Z] + rows[j, VZ] * since - z
        approach = dx * ux + dy * uy + dz * uz
        if approach < 0.0:
            reach = rows[i, RADIUS] + rows[j, RADIUS]
            square = dx * dx + dy * dy + dz * dz
            gap_square = square - reach * reach
            if gap_square <= _TOUCHING * square:
                own = speed_square(rows, i)
                if is_rounding(approach, square, own, speed_square(rows, j)):
                    continue
            relative = ux * ux + uy * uy + uz * uz
            when = now + time_to_contact(approach, relative, gap_square)
            if when < best:
                best = when
                partner = j
    state.event_time[i] = best
    state.event_partner[i] = partner
    if partner >= 0:
        state.event_counter[i] = state.counter[partner]


@compiled
def predict_all(state: State, rules: Rules, now: float) -> None:
    """Find the earliest event of every bead from now on."""
    for i in range(state.rows.shape[0]):
        predict(state, rules, i, now)
