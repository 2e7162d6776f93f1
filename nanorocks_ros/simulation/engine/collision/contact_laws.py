"""What the rules say of a contact: its restitution, whether it sticks, whether it is repeated.

Tested by ``test/simulation/engine/collision/test_rigid_collisions.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.numerics.compiled import inlined
from nanorocks_ros.simulation.engine.gas_state import (
    COUNTER,
    ELASTIC_WALL,
    FLAGS,
    ORIGINAL,
    SPECIES,
    State,
)
from nanorocks_ros.simulation.engine.integer_width import as_int64
from nanorocks_ros.simulation.engine.recent_contacts import is_repeated
from nanorocks_ros.simulation.engine.rules.restitution_laws import (
    CONSTANT,
    UNIFORM,
    random_restitution,
    restitution_at,
)

if TYPE_CHECKING:
    import numpy as np

    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules


@inlined
def pair_restitution(state: State, rules: Rules, i: int, j: int, speed: float) -> float:
    """Restitution of two beads that approach with a normal speed."""
    if rules.kind == CONSTANT:
        a, b = state.links[i, FLAGS] >> SPECIES, state.links[j, FLAGS] >> SPECIES
        return float(rules.restitution[a, b])
    if rules.kind == UNIFORM:
        return drawn_for_contact(state, i, j, (rules.first, rules.second), rules.seed_key)
    return float(restitution_at(rules.kind, rules.first, rules.second, rules.exponent, speed))


@inlined
def drawn_for_contact(
    state: State, i: int, j: int, spread: tuple[float, float], key: np.uint64
) -> float:
    """Random number of this contact of two beads, uniform in a mean ± half a width."""
    a, b = i, j
    if state.links[a, ORIGINAL] > state.links[b, ORIGINAL]:
        a, b = b, a
    beads = as_int64(state.links[a, ORIGINAL]), as_int64(state.links[b, ORIGINAL])
    counts = as_int64(state.links[a, COUNTER]), as_int64(state.links[b, COUNTER])
    return random_restitution(spread[0], spread[1], key, beads, counts)


@inlined
def sticking_threshold(state: State, rules: Rules, i: int, j: int) -> float:
    """Speed below which this contact of two beads sticks, [m/s]."""
    if rules.sticking_width > 0.0:
        spread = rules.sticking_speed, rules.sticking_width
        return drawn_for_contact(state, i, j, spread, rules.sticking_key)
    return rules.sticking_speed


@inlined
def is_same_contact(state: State, rules: Rules, i: int, j: int, now: float) -> bool:
    """Whether this pair touched less than the contact duration ago."""
    a = as_int64(state.links[i, ORIGINAL])
    b = as_int64(state.links[j, ORIGINAL])
    return is_repeated(state.contacts, min(a, b), max(a, b), now, rules.contact_duration)


@inlined
def wall_restitution(state: State, rules: Rules, wall: int, speed: float, elastic: bool) -> float:
    """Restitution of a contact with a wall at a normal speed."""
    restitution = rules.wall_restitution[wall]
    if elastic:
        state.counts[ELASTIC_WALL] += 1
        return 1.0
    if rules.wall_kind != CONSTANT:
        return restitution_at(
            rules.wall_kind, restitution, rules.wall_per_speed, rules.wall_exponent, speed
        )
    return restitution
