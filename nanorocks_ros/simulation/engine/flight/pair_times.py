"""Contact times of two beads.

Tested by ``test/simulation/engine/test_input_checks.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import inlined
from nanorocks_ros.simulation.engine.gas_state import BODY, RADIUS, VX, VY, VZ
from nanorocks_ros.simulation.engine.vectors import Vector

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.simulation.engine.gas_state import State
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules

Flights = tuple[Vector, Vector, Vector, Vector]

# Squares of the approach, relative to the speeds, that is rounding; and of the gap, relative to
# the distance, of beads that touch.
_ROUNDING = 1e-26
_TOUCHING = 1e-9


@inlined
def minimum_image(rules: Rules, axis: int, difference: float) -> float:
    """Difference of coordinates to the nearest periodic image, [m]."""
    if rules.periodic[axis]:
        return difference - rules.sides[axis] * np.rint(difference * rules.per_side[axis])
    return difference


@inlined
def speed_square(rows: NDArray[np.float64], i: int) -> float:
    """Square of the speed of a bead, [m^2/s^2]."""
    vx, vy, vz = rows[i, VX], rows[i, VY], rows[i, VZ]
    return float(vx * vx + vy * vy + vz * vz)


@inlined
def square_of(velocity: Vector) -> float:
    """Square of a velocity, [m^2/s^2]."""
    return velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2]


@inlined
def is_rounding(
    approach: float, distance_square: float, speed_square_1: float, speed_square_2: float
) -> bool:
    """Whether the approach of two beads is no larger than rounding errors.

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


@inlined
def wait_for_contact(
    state: State, rules: Rules, i: int, flights: Flights, j: int, folded: bool
) -> float:
    """Time until two beads touch that fly straight, infinite when they never do, [s].

    Overlapping and approaching beads touch now.

    Parameters
    ----------
    state : State
    rules : Rules
    i : int
    flights : tuple of 4 vectors, [m], [m/s], [m], [m/s]
        Place and velocity now of bead i, then of bead j.
    j : int
    folded : bool
        Whether the nearest image of j is to be found.
    """
    rows = state.rows
    place, velocity, other_place, other_velocity = flights
    ux = other_velocity[0] - velocity[0]
    uy = other_velocity[1] - velocity[1]
    uz = other_velocity[2] - velocity[2]
    dx = other_place[0] - place[0]
    dy = other_place[1] - place[1]
    dz = other_place[2] - place[2]
    if folded:
        dx = minimum_image(rules, 0, dx)
        dy = minimum_image(rules, 1, dy)
        dz = minimum_image(rules, 2, dz)
    approach = dx * ux + dy * uy + dz * uz
    if approach >= 0.0 or (rules.sticky and state.bodies[i, BODY] == state.bodies[j, BODY]):
        return np.inf
    reach = rows[i, RADIUS] + rows[j, RADIUS]
    square = dx * dx + dy * dy + dz * dz
    gap_square = square - reach * reach
    if gap_square <= _TOUCHING * square and is_rounding(
        approach, square, square_of(velocity), square_of(other_velocity)
    ):
        return np.inf
    if gap_square <= 0.0:
        return 0.0
    discriminant = approach * approach - (ux * ux + uy * uy + uz * uz) * gap_square
    if discriminant < 0.0:
        return np.inf
    # The other form of the root, (-b - sqrt)/a, loses all digits when they nearly touch.
    return gap_square / (math.sqrt(discriminant) - approach)
