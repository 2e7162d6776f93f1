"""When a bead meets a wall, at rest or moving with the tray, and what happens then."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined
from nanorocks_ros.simulation.engine.collision.aggregates import (
    advance,
    fix,
    mass_of,
    shift,
    spread,
)
from nanorocks_ros.simulation.engine.collision.conservation_ledger import (
    add,
    book_lever,
    cross,
    energy_of,
    length,
    orbit_and_spin,
)
from nanorocks_ros.simulation.engine.collision.friction import rub_wall
from nanorocks_ros.simulation.engine.gas_state import (
    ELASTIC_WALL,
    EPOCH,
    FIX,
    IMPULSE,
    MOMENTUM,
    ORIGINAL,
    RADIUS,
    SPIN,
    TIME,
    VX,
    VY,
    VZ,
    WALL,
    WALL_IMPULSE,
    WALL_LOSS,
    State,
    X,
    Y,
    Z,
    remember,
)
from nanorocks_ros.simulation.engine.integer_width import whole
from nanorocks_ros.simulation.engine.pair_times import speed_square
from nanorocks_ros.simulation.engine.recent_contacts import is_repeated

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.collision_rules import Rules

# A gap this small, of the radius, is a contact; and so many steps are enough to find any.
_CLOSED = 1e-13
_MOST_STEPS = 10_000
# Some digits of time that cannot be divided further.
_LEAST_STEP = 2e-15
# Further from a moving wall than this, of the radius, a bead does not touch it.
_APART = 1e-6


@inlined
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
def displacement(rules: Rules, axis: int, time: float) -> tuple[float, float]:
    """Displacement and velocity of the tray along an axis at a time, [m], [m/s]."""
    if not (rules.moving and rules.start <= time < rules.end):
        return 0.0, 0.0
    since = time - rules.start
    size = rules.amplitude[axis] * math.exp(-rules.damping * since)
    phase = rules.angular_frequency * since
    wave = math.sin(phase)
    slope = rules.angular_frequency * math.cos(phase) - rules.damping * wave
    return size * wave, size * slope


@compiled
def largest_acceleration(rules: Rules, axis: int, time: float) -> float:
    """Bound on the acceleration of the tray along an axis from a time on, [m/s^2]."""
    if time >= rules.end:
        return 0.0
    rate = rules.angular_frequency + rules.damping
    since = max(time - rules.start, 0.0)
    size = abs(rules.amplitude[axis]) * math.exp(-rules.damping * since)
    return float(size * rate * rate)


@compiled
def swing(rules: Rules, axis: int, time: float) -> float:
    """How far the tray can be from its place along an axis from a time on, [m]."""
    if time >= rules.end:
        return 0.0
    return abs(rules.amplitude[axis]) * math.exp(-rules.damping * max(time - rules.start, 0.0))


@compiled
def time_to_moving_plane(
    rules: Rules, axis: int, place: tuple[float, float, float], far: int, now: float
) -> float:
    """Time at which a bead meets a wall that moves with the tray.

    The gap is never smaller than a parabola that bends as much as the wall can accelerate;
    each step goes to where that parabola closes, so that no contact is stepped over.

    Parameters
    ----------
    rules : Rules
    axis : int
    place : tuple of 3 floats, [m], [m/s], [m]
        Coordinate, velocity and radius of the bead.
    far : int
        0 for the low wall, 1 for the high one.
    now : float, [s]
        Absolute.

    Returns
    -------
    float, [s]
        Infinite when it never does.
    """
    position, velocity, radius = place
    outward = 1.0 if far else -1.0
    # Distance from the wall at rest, and how fast it shrinks.
    distance = rules.sides[axis] - radius - position if far else position - radius
    closing = outward * velocity
    time = now
    for _ in range(_MOST_STEPS):
        left = distance - closing * (time - now)
        beyond = left - swing(rules, axis, time)
        if beyond > _CLOSED * radius:
            # Out of reach of the wall wherever it is.
            if closing <= 0.0:
                return np.inf
            time += max(beyond / closing, _LEAST_STEP * abs(time))
            continue
        moved, speed = displacement(rules, axis, time)
        gap = left + outward * moved
        opening = outward * speed - closing
        if gap <= _CLOSED * radius and opening < 0.0:
            return time
        time = next_look(rules, axis, time, max(gap, 0.0), opening)
        if math.isinf(time):
            break
    return time


@compiled
def next_look(rules: Rules, axis: int, time: float, gap: float, opening: float) -> float:
    """The earliest time at which a gap to a moving wall can be closed.

    Parameters
    ----------
    rules : Rules
    axis : int
    time : float, [s]
    gap, opening : float, [m], [m/s]
        At that time.
    """
    bend = 0.0
    until = np.inf
    if time < rules.start:
        until = rules.start
    elif time < rules.end:
        bend = largest_acceleration(rules, axis, time)
        until = rules.end
    root = math.sqrt(opening * opening + 2.0 * bend * gap)
    if opening < 0.0:
        step = 2.0 * gap / (root - opening)
    elif bend > 0.0:
        step = (opening + root) / bend
    else:
        step = np.inf
    # Where the bead rides on the wall, time must still go on; the contact comes then.
    step = max(step, _LEAST_STEP * abs(time), 1e-9 * rules.contact_duration)
    return min(time + step, until)


@inlined
def next_wall(state: State, rules: Rules, i: int, now: float, near: int) -> tuple[float, int]:
    """Time and partner of the first wall event of a bead.

    Parameters
    ----------
    state : State
    rules : Rules
    i : int
    now : float, [s]
    near : int
        Bits of the walls that are asked, two for each axis.
    """
    rows = state.rows
    since = now - rows[i, TIME]
    best = np.inf
    partner = -1
    for axis in range(3):
        if rules.periodic[axis] or (near >> (2 * axis)) & 3 == 0:
            continue
        velocity = rows[i, VX + axis]
        position = rows[i, X + axis] + velocity * since
        if rules.moving and rules.amplitude[axis] != 0.0:
            epoch = state.clock[EPOCH]
            for far in range(2):
                place = (position, velocity, rows[i, RADIUS])
                when = time_to_moving_plane(rules, axis, place, far, epoch + now) - epoch
                if when < best:
                    best = max(when, now)
                    partner = -1 - (2 * axis + far)
        else:
            wait, far = time_to_plane(position, velocity, rows[i, RADIUS], rules.sides[axis])
            if now + wait < best:
                best = now + wait
                partner = -1 - (2 * axis + far)
    return best, partner


@inlined
def sticks_to_wall(state: State, rules: Rules, i: int, axis: int) -> bool:
    """Whether a bead meets a wall, which is at rest, slowly enough to stay there."""
    if not (rules.sticky and rules.wall_sticking_speed > 0.0):
        return False
    measure = abs(state.rows[i, VX + axis])
    if rules.total_measure:
        measure = math.sqrt(speed_square(state.rows, i))
    return bool(measure < rules.wall_sticking_speed)


@inlined
def stick_to_wall(state: State, rules: Rules, i: int, wall: int, now: float) -> int:
    """Stop a body at a wall for good; the beads marked."""
    rows = state.rows
    mass = mass_of(state, rules, i)
    outward = 1.0 if wall % 2 else -1.0
    state.books[WALL_IMPULSE + wall] += outward * mass * rows[i, VX + wall // 2]
    state.books[WALL_LOSS] += energy_of(state, rules, i)
    add(state, MOMENTUM, (mass * rows[i, VX], mass * rows[i, VY], mass * rows[i, VZ]))
    add(state, SPIN, orbit_and_spin(state, rules, i, now))
    state.counts[FIX] += 1
    speed = math.sqrt(speed_square(rows, i))
    remember(state, FIX, abs(rows[i, VX + wall // 2]), mass * speed)
    fix(state, rules, i)
    for axis in range(3):
        rows[i, VX + axis] = 0.0
    return spread(state, rules, i, now, 0)


@inlined
def bounce_off_wall(state: State, rules: Rules, i: int, wall: int, now: float) -> int:
    """Put a bead exactly on a wall and turn its body round, or let it stick.

    Returns
    -------
    int
        Beads marked; 0 when the bead is not there yet.
    """
    rows = state.rows
    advance(state, i, now)
    axis = wall // 2
    radius = rows[i, RADIUS]
    moved, wall_speed = 0.0, 0.0
    if rules.moving:
        moved, wall_speed = displacement(rules, axis, state.clock[EPOCH] + now)
    surface = moved + (rules.sides[axis] - radius if wall % 2 else radius)
    if rules.moving and abs(rows[i, X + axis] - surface) > _APART * radius:
        return 0
    shift(state, rules, i, axis, surface - rows[i, X + axis])
    rows[i, X + axis] = surface
    number = whole(state.links[i, ORIGINAL])
    key = rows.shape[0] + wall
    elastic = is_repeated(state.contacts, number, key, now, rules.contact_duration)
    if sticks_to_wall(state, rules, i, axis):
        return stick_to_wall(state, rules, i, wall, now)
    state.counts[WALL] += 1
    restitution = rules.wall_restitution[wall]
    if elastic:
        state.counts[ELASTIC_WALL] += 1
        restitution = 1.0
    before = rows[i, VX + axis] - wall_speed
    after = -restitution * before
    if rules.moving:
        after = pressed_on(state, rules, wall, now, after)
    rows[i, VX + axis] = wall_speed + after
    mass = mass_of(state, rules, i)
    push = mass * (before - after)
    state.books[WALL_LOSS] += 0.5 * mass * (before * before - after * after) + push * wall_speed
    state.books[WALL_IMPULSE + wall] += push if wall % 2 else -push
    state.books[MOMENTUM + axis] += push
    remember(state, WALL, abs(before), abs(push))
    if rules.rough or rules.sticky:
        rub_and_book(state, rules, i, wall, now, push, elastic)
    return spread(state, rules, i, now, 0)


@inlined
def pressed_on(state: State, rules: Rules, wall: int, now: float, after: float) -> float:
    """Speed relative to a moving wall after a bounce, at least what half a contact gives.

    A bead that an accelerating wall presses on would meet it again and again at one instant.
    """
    time = state.clock[EPOCH] + now
    if not rules.start <= time < rules.end:
        return after
    least = 0.5 * largest_acceleration(rules, wall // 2, time) * rules.contact_duration
    if abs(after) >= least:
        return after
    return -least if wall % 2 else least


@inlined
def rub_and_book(
    state: State, rules: Rules, i: int, wall: int, now: float, push: float, elastic: bool
) -> None:
    """The tangential part of a wall collision, and the angular momentum of all of it."""
    axis = wall // 2
    outward = 1.0 if wall % 2 else -1.0
    normal = outward * (axis == 0), outward * (axis == 1), outward * (axis == 2)
    impulse = push * (axis == 0), push * (axis == 1), push * (axis == 2)
    rows = state.rows
    if rules.rough:
        time = state.clock[EPOCH] + now
        velocity = (
            displacement(rules, 0, time)[1],
            displacement(rules, 1, time)[1],
            displacement(rules, 2, time)[1],
        )
        restitution = -1.0 if elastic else rules.wall_tangential
        rub, heat = rub_wall(state, rules, i, normal, velocity, restitution, push)
        work = rub[0] * velocity[0] + rub[1] * velocity[1] + rub[2] * velocity[2]
        state.books[WALL_LOSS] += heat + work
        add(state, MOMENTUM, rub)
        impulse = impulse[0] + rub[0], impulse[1] + rub[1], impulse[2] + rub[2]
        state.last[IMPULSE] = length(impulse)
    arm = rows[i, RADIUS]
    contact = (
        rows[i, X] + arm * normal[0],
        rows[i, Y] + arm * normal[1],
        rows[i, Z] + arm * normal[2],
    )
    add(state, SPIN, cross(contact, impulse))
    book_lever(state, rules, i, contact, (-impulse[0], -impulse[1], -impulse[2]), now)
