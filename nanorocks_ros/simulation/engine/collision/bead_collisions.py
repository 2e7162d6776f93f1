"""What happens to two beads when they touch."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.numerics.compiled import inlined
from nanorocks_ros.simulation.engine.collision.aggregates import (
    advance,
    join,
    mass_of,
    share,
    spread,
)
from nanorocks_ros.simulation.engine.collision.conservation_ledger import (
    Vector,
    add,
    book_lever,
    energy_of,
    length,
    orbit_and_spin,
)
from nanorocks_ros.simulation.engine.collision.friction import rub_pair
from nanorocks_ros.simulation.engine.gas_state import (
    AGGREGATE_SPIN,
    COUNTER,
    ELASTIC_PAIR,
    FLAGS,
    MERGE,
    MERGE_LOSS,
    MOMENTUM,
    ORIGINAL,
    PAIR,
    PAIR_LOSS,
    RADIUS,
    SPECIES,
    SPIN,
    VX,
    VY,
    VZ,
    State,
    X,
    Y,
    Z,
    remember,
)
from nanorocks_ros.simulation.engine.integer_width import whole
from nanorocks_ros.simulation.engine.pair_times import is_rounding, nearest, speed_square
from nanorocks_ros.simulation.engine.recent_contacts import is_repeated
from nanorocks_ros.simulation.engine.restitution_laws import CONSTANT, UNIFORM, drawn, viscoelastic

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.collision_rules import Rules

_SMOOTH = -1.0


@inlined
def pair_restitution(state: State, rules: Rules, i: int, j: int, speed: float) -> float:
    """Restitution of a contact of two beads that approach each other with a normal speed."""
    if rules.kind == CONSTANT:
        a, b = state.links[i, FLAGS] >> SPECIES, state.links[j, FLAGS] >> SPECIES
        return float(rules.restitution[a, b])
    if rules.kind == UNIFORM:
        a, b = i, j
        if state.links[a, ORIGINAL] > state.links[b, ORIGINAL]:
            a, b = b, a
        beads = whole(state.links[a, ORIGINAL]), whole(state.links[b, ORIGINAL])
        counts = whole(state.links[a, COUNTER]), whole(state.links[b, COUNTER])
        return drawn(rules.first, rules.second, rules.seed_key, beads, counts)
    return float(viscoelastic(rules.first * (speed * rules.second) ** 0.1))


@inlined
def remembered(state: State, rules: Rules, i: int, j: int, now: float) -> bool:
    """Whether this pair touched so shortly before that the contact is still the same."""
    a = whole(state.links[i, ORIGINAL])
    b = whole(state.links[j, ORIGINAL])
    return is_repeated(state.contacts, min(a, b), max(a, b), now, rules.contact_duration)


@inlined
def reduced_mass(state: State, rules: Rules, i: int, j: int) -> float:
    """Reduced mass of two bodies, of which one may be stuck to a wall, [kg]."""
    mass_i = mass_of(state, rules, i)
    mass_j = mass_of(state, rules, j)
    if math.isinf(mass_i):
        return mass_j
    return mass_i * share(mass_i, mass_j)


@inlined
def book_before_merge(state: State, rules: Rules, i: int, stuck: bool, now: float) -> None:
    """Book the momentum and angular momentum of a body that is about to end."""
    turning = orbit_and_spin(state, rules, i, now)
    if not stuck:
        add(state, AGGREGATE_SPIN, turning)
        return
    rows = state.rows
    mass = mass_of(state, rules, i)
    add(state, SPIN, turning)
    add(state, MOMENTUM, (mass * rows[i, VX], mass * rows[i, VY], mass * rows[i, VZ]))


@inlined
def merge(state: State, rules: Rules, i: int, j: int, now: float) -> int:
    """Make one body of two that touch, with their momentum; the beads marked."""
    rows = state.rows
    free_i = not math.isinf(mass_of(state, rules, i))
    free_j = not math.isinf(mass_of(state, rules, j))
    before = energy_of(state, rules, i) + energy_of(state, rules, j)
    stuck = not (free_i and free_j)
    if free_i:
        book_before_merge(state, rules, i, stuck, now)
    if free_j:
        book_before_merge(state, rules, j, stuck, now)
    to_i = share(mass_of(state, rules, i), mass_of(state, rules, j))
    for axis in range(3):
        u = rows[j, VX + axis] - rows[i, VX + axis]
        common = rows[j, VX + axis] if to_i == 1.0 else rows[i, VX + axis] + to_i * u
        rows[i, VX + axis] = common
        rows[j, VX + axis] = common
    marked = spread(state, rules, j, now, spread(state, rules, i, now, 0))
    join(state, rules, i, j)
    if not stuck:
        x, y, z = orbit_and_spin(state, rules, i, now)
        add(state, AGGREGATE_SPIN, (-x, -y, -z))
    state.books[MERGE_LOSS] += before - energy_of(state, rules, i)
    state.counts[MERGE] += 1
    return marked


@inlined
def collide_pair(state: State, rules: Rules, i: int, j: int, now: float) -> int:
    """Let two beads collide, or stick.

    Returns
    -------
    int
        Beads marked; 0, and no change of velocity, when they do not approach.
    """
    advance(state, i, now)
    advance(state, j, now)
    rows = state.rows
    dx = nearest(rules, 0, rows[j, X] - rows[i, X])
    dy = nearest(rules, 1, rows[j, Y] - rows[i, Y])
    dz = nearest(rules, 2, rows[j, Z] - rows[i, Z])
    ux = rows[j, VX] - rows[i, VX]
    uy = rows[j, VY] - rows[i, VY]
    uz = rows[j, VZ] - rows[i, VZ]
    approach = dx * ux + dy * uy + dz * uz
    square = dx * dx + dy * dy + dz * dz
    speeds = speed_square(rows, i), speed_square(rows, j)
    if approach >= 0.0 or is_rounding(approach, square, speeds[0], speeds[1]):
        return 0
    distance = math.sqrt(square)
    closing = approach / distance
    elastic = remembered(state, rules, i, j, now)
    if rules.sticky and rules.sticking_speed > 0.0:
        measure = math.sqrt(ux * ux + uy * uy + uz * uz) if rules.total_measure else -closing
        if measure < rules.sticking_speed:
            speed = math.sqrt(ux * ux + uy * uy + uz * uz)
            remember(state, MERGE, -closing, reduced_mass(state, rules, i, j) * speed)
            return merge(state, rules, i, j, now)
    restitution = 1.0
    if elastic:
        state.counts[ELASTIC_PAIR] += 1
    else:
        restitution = pair_restitution(state, rules, i, j, -closing)
    state.counts[PAIR] += 1
    change = (1.0 + restitution) * closing
    per_length = (1.0 + restitution) * approach / square
    mass_i = mass_of(state, rules, i)
    mass_j = mass_of(state, rules, j)
    to_i = per_length * share(mass_i, mass_j)
    to_j = per_length * share(mass_j, mass_i)
    rows[i, VX] += to_i * dx
    rows[i, VY] += to_i * dy
    rows[i, VZ] += to_i * dz
    rows[j, VX] -= to_j * dx
    rows[j, VY] -= to_j * dy
    rows[j, VZ] -= to_j * dz
    reduced = reduced_mass(state, rules, i, j)
    remember(state, PAIR, -closing, -reduced * change)
    loss = 0.5 * reduced * (1.0 - restitution * restitution) * closing * closing
    if rules.rough or rules.sticky:
        normal = dx / distance, dy / distance, dz / distance
        along = -reduced * change
        impulse = along * normal[0], along * normal[1], along * normal[2]
        if rules.rough:
            tangential = _SMOOTH if elastic else rules.tangential
            rub, heat = rub_pair(state, rules, i, j, normal, tangential, along)
            loss += heat
            impulse = impulse[0] + rub[0], impulse[1] + rub[1], impulse[2] + rub[2]
            remember(state, PAIR, -closing, length(impulse))
        book_both(state, rules, i, j, normal, impulse, now)
    state.books[PAIR_LOSS] += loss
    return spread(state, rules, j, now, spread(state, rules, i, now, 0))


@inlined
def book_both(
    state: State,
    rules: Rules,
    i: int,
    j: int,
    normal: Vector,
    impulse: Vector,
    now: float,
) -> None:
    """Book what the impulse on j, and its opposite on i, should have turned but cannot."""
    arm = state.rows[i, RADIUS]
    contact = (
        state.rows[i, X] + arm * normal[0],
        state.rows[i, Y] + arm * normal[1],
        state.rows[i, Z] + arm * normal[2],
    )
    opposite = -impulse[0], -impulse[1], -impulse[2]
    book_lever(state, rules, i, contact, opposite, now)
    book_lever(state, rules, j, contact, impulse, now)
