"""Contacts of bodies that turn: merging, and impulses with the effective mass of the contact.

Tested by ``test/simulation/engine/collision/test_rigid_collisions.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.numerics.compiled import inlined
from nanorocks_ros.simulation.engine.collision.aggregates import (
    advance_marked,
    join_bodies,
    mark_body,
    mark_changed_body,
)
from nanorocks_ros.simulation.engine.collision.break_up import add_bond, release_bead
from nanorocks_ros.simulation.engine.collision.conservation_ledger import (
    book_lost_torque,
    energy_of,
)
from nanorocks_ros.simulation.engine.collision.rigid_bodies import (
    centre_of_body,
    count_from,
    inverse_mass_along,
    moment_of_body,
    push,
    set_rigid_body,
    start_impact,
    velocity_of_body,
)
from nanorocks_ros.simulation.engine.flight.rotation_series import expand, rebase
from nanorocks_ros.simulation.engine.flight.turning_contacts import largest_bend
from nanorocks_ros.simulation.engine.flight.turning_motion import body_of, turns, where_turning
from nanorocks_ros.simulation.engine.gas_state import (
    MERGE,
    MERGE_LOSS,
    OF_BODY,
    PAIR,
    PAIR_LOSS,
    RADIUS,
    State,
    X,
    record_collision,
)
from nanorocks_ros.simulation.engine.vectors import cross, difference, length, scaled, sum_of

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules


@where_turning(0)
def renew_stretch(state: State, i: int, now: float) -> int:
    """Give the body of a bead a new stretch of its motion; returns the number of marked beads.

    The motion does not change, so the events that others have predicted stay valid.
    """
    body = body_of(state, i)
    rebase(state, body, now)
    expand(state, body)
    return mark_body(state, i, 0)


@where_turning(0)
def merge_rigid_bodies(
    state: State, rules: Rules, i: int, j: int, now: float, speed: float
) -> int:
    """Merge two free bodies into one that turns; returns the number of marked beads.

    Mass, momentum and angular momentum are those of both.

    Parameters
    ----------
    state : State
    rules : Rules
    i, j : int
        The beads that touch.
    now : float, [s]
    speed : float, [m/s]
        At which they approach along the normal.
    """
    marked = mark_changed_body(state, j, mark_changed_body(state, i, 0))
    advance_marked(state, marked, now)
    count_from(state, i, now)
    count_from(state, j, now)
    before = energy_of(state, rules, i) + energy_of(state, rules, j)
    a, b = state.masses[body_of(state, i), OF_BODY], state.masses[body_of(state, j), OF_BODY]
    share, reduced = b / (a + b), a * b / (a + b)
    start = centre_of_body(state, i, now)
    apart = difference(centre_of_body(state, j, now), start)
    velocity = velocity_of_body(state, i)
    change = difference(velocity_of_body(state, j), velocity)
    moment = sum_of(moment_of_body(state, i), moment_of_body(state, j))
    moment = sum_of(moment, scaled(cross(apart, change), reduced))
    record_collision(state, MERGE, speed, reduced * length(change))
    join_bodies(state, rules, i, j)
    add_bond(state, i, j)
    centre = sum_of(start, scaled(apart, share))
    set_rigid_body(state, i, now, centre, sum_of(velocity, scaled(change, share)), moment)
    advance_marked(state, marked, now)
    state.ledger[MERGE_LOSS] += before - energy_of(state, rules, i)
    state.counts[MERGE] += 1
    return marked


@inlined
def mark_and_release(
    state: State, rules: Rules, i: int, now: float, speed: float, marked: int
) -> int:
    """Mark the body of a bead, and release the bead where it is hit fast enough.

    Parameters
    ----------
    state : State
    rules : Rules
    i : int
    now : float, [s]
    speed : float, [m/s]
        Of the impact, along the normal.
    marked : int
        Beads marked before.

    Returns
    -------
    int
        Beads marked now.
    """
    last = mark_changed_body(state, i, marked)
    if rules.break_up_speed > 0.0 and speed > rules.break_up_speed and turns(state, i):
        release_bead(state, rules, i, now, marked, last)
    return last


@inlined
def least_separation(state: State, rules: Rules, i: int, now: float) -> float:
    """Speed at which a bead must leave a contact not to be back within a contact duration, [m/s].

    The rotation of its body can press it against what it has just left; without this, it would
    hit it without end at one instant. A contact that is slower than this is elastic.
    """
    return 0.5 * largest_bend(state, i, now) * rules.contact_duration


@where_turning(0)
def collide_rigid_bodies(
    state: State, rules: Rules, i: int, j: int, now: float, closing: float, restitution: float
) -> int:
    """Collide two bodies at beads that touch; returns the number of marked beads.

    Parameters
    ----------
    state : State
        The rows of both beads are of now.
    rules : Rules
    i, j : int
    now : float, [s]
    closing : float, [m/s]
        Normal speed, negative: they approach.
    restitution : float
    """
    marked = mark_and_release(state, rules, i, now, -closing, 0)
    marked = mark_and_release(state, rules, j, now, -closing, marked)
    rows = state.rows
    apart = (
        rows[j, X] - rows[i, X],
        rows[j, X + 1] - rows[i, X + 1],
        rows[j, X + 2] - rows[i, X + 2],
    )
    normal = scaled(apart, 1.0 / length(apart))
    least = least_separation(state, rules, i, now) + least_separation(state, rules, j, now)
    after = max(-restitution * closing, min(least, -closing))
    start_impact(state, i, now)
    start_impact(state, j, now)
    per = inverse_mass_along(state, i, normal) + inverse_mass_along(state, j, normal)
    size = (after - closing) / per
    impulse = scaled(normal, size)
    push(state, i, scaled(normal, -size))
    push(state, j, impulse)
    advance_marked(state, marked, now)
    record_collision(state, PAIR, -closing, size)
    state.counts[PAIR] += 1
    state.ledger[PAIR_LOSS] += 0.5 * (closing * closing - after * after) / per
    contact = sum_of((rows[i, X], rows[i, X + 1], rows[i, X + 2]), scaled(normal, rows[i, RADIUS]))
    book_lost_torque(state, rules, i, contact, scaled(normal, -size), now)
    book_lost_torque(state, rules, j, contact, impulse, now)
    return marked


@where_turning((0, 0.0, 0.0))
def push_off_wall(
    state: State, rules: Rules, i: int, axis: int, now: float, speeds: tuple[float, float]
) -> tuple[int, float, float]:
    """Reflect a body that turns at a wall that one of its beads touches.

    Parameters
    ----------
    state : State
        The row of the bead is of now.
    rules : Rules
    i : int
    axis : int
        That the wall is normal to.
    now : float, [s]
    speeds : tuple of 2 floats, [m/s]
        Of the bead along the axis, relative to the wall: before and, at least, after.

    Returns
    -------
    marked : int
        Beads marked.
    mass : float, [kg]
        Effective mass of the contact.
    after : float, [m/s]
    """
    before, after = speeds
    marked = mark_and_release(state, rules, i, now, abs(before), 0)
    least = min(least_separation(state, rules, i, now), abs(before))
    if abs(after) < least:
        after = -least if before > 0.0 else least
    normal = 1.0 * (axis == 0), 1.0 * (axis == 1), 1.0 * (axis == 2)
    start_impact(state, i, now)
    mass = 1.0 / inverse_mass_along(state, i, normal)
    push(state, i, scaled(normal, mass * (after - before)))
    advance_marked(state, marked, now)
    return marked, mass, after
