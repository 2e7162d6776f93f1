"""What happens to two beads, or a bead and a wall, when they touch."""

from __future__ import annotations

import math

from nanorocks_ros.physics.compiled import compiled
from nanorocks_ros.simulation.engine.prediction import is_rounding, speed_square
from nanorocks_ros.simulation.engine.state import (
    ELASTIC_PAIR,
    ELASTIC_WALL,
    PAIR,
    RADIUS,
    TIME,
    VX,
    VY,
    VZ,
    WALL,
    Rules,
    State,
    X,
    Y,
    Z,
)


@compiled
def advance(state: State, i: int, now: float) -> None:
    """Move a bead along its straight line to a time."""
    rows = state.rows
    since = now - rows[i, TIME]
    rows[i, X] += rows[i, VX] * since
    rows[i, Y] += rows[i, VY] * since
    rows[i, Z] += rows[i, VZ] * since
    rows[i, TIME] = now


@compiled
def pair_restitution(state: State, rules: Rules, i: int, j: int, now: float) -> float:
    """Restitution of a contact: 1 when the last of this pair is less than its duration ago."""
    last = state.pair_contact[i, j]
    state.pair_contact[i, j] = now
    state.pair_contact[j, i] = now
    if now - last < rules.contact_duration:
        state.counts[ELASTIC_PAIR] += 1
        return 1.0
    return rules.restitution


@compiled
def collide_pair(state: State, rules: Rules, i: int, j: int, now: float) -> bool:
    """Let two beads collide; False, and no change of velocity, when they do not approach."""
    advance(state, i, now)
    advance(state, j, now)
    rows = state.rows
    dx = rows[j, X] - rows[i, X]
    dy = rows[j, Y] - rows[i, Y]
    dz = rows[j, Z] - rows[i, Z]
    ux = rows[j, VX] - rows[i, VX]
    uy = rows[j, VY] - rows[i, VY]
    uz = rows[j, VZ] - rows[i, VZ]
    approach = dx * ux + dy * uy + dz * uz
    square = dx * dx + dy * dy + dz * dz
    speeds = speed_square(rows, i), speed_square(rows, j)
    if approach >= 0.0 or is_rounding(approach, square, speeds[0], speeds[1]):
        return False
    change = (1.0 + pair_restitution(state, rules, i, j, now)) * (approach / math.sqrt(square))
    per_length = change / math.sqrt(square)
    total = state.masses[i] + state.masses[j]
    to_i = per_length * (state.masses[j] / total)
    to_j = per_length * (state.masses[i] / total)
    rows[i, VX] += to_i * dx
    rows[i, VY] += to_i * dy
    rows[i, VZ] += to_i * dz
    rows[j, VX] -= to_j * dx
    rows[j, VY] -= to_j * dy
    rows[j, VZ] -= to_j * dz
    state.counter[i] += 1
    state.counter[j] += 1
    state.counts[PAIR] += 1
    return True


@compiled
def bounce_off_wall(state: State, rules: Rules, i: int, wall: int, now: float) -> None:
    """Put a bead exactly on a wall and turn its normal velocity round."""
    advance(state, i, now)
    axis = wall // 2
    side = rules.side_x if axis == 0 else (rules.side_y if axis == 1 else rules.side_z)
    rows = state.rows
    rows[i, X + axis] = side - rows[i, RADIUS] if wall % 2 else rows[i, RADIUS]
    restitution = rules.wall_restitution
    if now - state.wall_contact[i, wall] < rules.contact_duration:
        state.counts[ELASTIC_WALL] += 1
        restitution = 1.0
    state.wall_contact[i, wall] = now
    rows[i, VX + axis] *= -restitution
    state.counter[i] += 1
    state.counts[WALL] += 1
