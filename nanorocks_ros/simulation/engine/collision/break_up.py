"""Break-up of bodies that turn: a bead that is hit fast leaves its body.

A body is held together by its bonds, one for each merge: a tree. The bonds of the bead break, and
the beads that still hang together go on as bodies of their own. All keep their velocities.

Tested by ``test/simulation/engine/collision/test_break_up.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.numerics.compiled import inlined, kernel
from nanorocks_ros.simulation.engine.collision.aggregates import advance_body, join_bodies
from nanorocks_ros.simulation.engine.collision.conservation_ledger import (
    add_vector,
    energy_of,
)
from nanorocks_ros.simulation.engine.collision.rigid_bodies import count_from, set_fragment
from nanorocks_ros.simulation.engine.flight.drag_rates import (
    is_dragged,
    own_rate,
    set_body_drag,
)
from nanorocks_ros.simulation.engine.flight.turning_motion import (
    angular_velocity,
    body_of,
    orientation,
    turns,
)
from nanorocks_ros.simulation.engine.gas_state import (
    AGGREGATE_SPIN,
    BODY,
    BOND,
    BONDED,
    BREAK_UP,
    FOLLOWING,
    INERTIA,
    MERGE_LOSS,
    OF_BODY,
    ORIGINAL,
    OWN,
    RADIUS,
    State,
)
from nanorocks_ros.simulation.engine.integer_width import as_int64
from nanorocks_ros.simulation.engine.vectors import scaled

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules
    from nanorocks_ros.simulation.engine.vectors import Vector

_NONE = -1


@inlined
def add_bond(state: State, i: int, j: int) -> None:
    """Remember that two beads hold their bodies together; there is always a free row."""
    k = 0
    while state.bodies[k, BOND] != _NONE:
        k += 1
    state.bodies[k, BOND] = i
    state.bodies[k, BONDED] = j


@inlined
def _remove_bonds(state: State, i: int) -> None:
    for k in range(state.bodies.shape[0]):
        if state.bodies[k, BOND] == i or state.bodies[k, BONDED] == i:
            state.bodies[k, BOND] = _NONE
            state.bodies[k, BONDED] = _NONE


@inlined
def _separate(state: State, first: int, last: int) -> None:
    """Make the marked beads of a body single."""
    for k in range(first, last):
        i = as_int64(state.dirty[k])
        number = as_int64(state.links[i, ORIGINAL])
        state.bodies[i, BODY] = number
        state.bodies[i, FOLLOWING] = i
        state.masses[number, OF_BODY] = state.masses[i, OWN]
        if is_dragged(state):
            set_body_drag(state, i, own_rate(state, i))


@inlined
def _join_bonded(state: State, rules: Rules) -> None:
    """Join the beads that bonds hold together again; bodies that are whole stay as they are."""
    for k in range(state.bodies.shape[0]):
        i, j = as_int64(state.bodies[k, BOND]), as_int64(state.bodies[k, BONDED])
        if i != _NONE and body_of(state, i) != body_of(state, j):
            join_bodies(state, rules, i, j)


@inlined
def _book_lost_spin(state: State, i: int, spin: Vector) -> None:
    """Book the angular momentum of a smooth bead that is single now: it has no spin."""
    radius = state.rows[i, RADIUS]
    add_vector(
        state, AGGREGATE_SPIN, scaled(spin, INERTIA * state.masses[i, OWN] * radius * radius)
    )


@kernel
def release_bead(state: State, rules: Rules, i: int, now: float, first: int, last: int) -> None:
    """Release a bead from its body, which turns.

    The energy and angular momentum of the spin of beads that are single afterwards are booked as
    those of a merge: smooth beads have none.

    Parameters
    ----------
    state : State
        Changed.
    rules : Rules
    i : int
    now : float, [s]
    first, last : int
        Where in ``state.dirty`` the beads of the body are marked.
    """
    advance_body(state, i, now)
    body = body_of(state, i)
    spin = angular_velocity(state, body, orientation(state, body, now), now)
    count_from(state, i, now)
    before = energy_of(state, rules, i)
    _remove_bonds(state, i)
    _separate(state, first, last)
    _join_bonded(state, rules)
    after = 0.0
    for k in range(first, last):
        bead = as_int64(state.dirty[k])
        if not turns(state, bead):
            _book_lost_spin(state, bead, spin)
            after += energy_of(state, rules, bead)
        elif state.bodies[bead, BODY] == state.links[bead, ORIGINAL]:
            set_fragment(state, bead, now, spin)
            after += energy_of(state, rules, bead)
    state.ledger[MERGE_LOSS] += before - after
    state.counts[BREAK_UP] += 1
