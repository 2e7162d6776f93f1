"""What single contacts say of the restitution at their impact speeds, one row for each.

The impact speed is the normal one. Of a rebound it is the incoming speed. Of a collision the
camera sees approach and parting along the projected line of centres; their sum is the impact
speed times 1 + restitution times the horizontal part of the line of centres, whatever the
vertical velocities. So the impact speed follows from both with the restitution.

Tested by ``test/inference/contacts/test_restitution_exponent.py`` and
``test/inference/contacts/test_rubbed_rebounds.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.contacts.contact_likelihood import (
    MIDDLE_EXCESS,
    OUTLIERS,
    PAIR_ERRORS,
    VERTICAL_RATIOS,
)
from nanorocks_ros.inference.contacts.projected_collisions import (
    ProjectedCollisions,
    horizontal_parts,
    projected_log_densities,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import PairCollision, Rebound

LOSS_COLUMNS = 3
DRAG_TIME, FRICTION_LENGTH, DRAG = range(LOSS_COLUMNS)
"""First columns of each row: drag time, [s], friction length, [m], and drag taken out, [1/s]."""
REBOUND_COLUMNS = LOSS_COLUMNS + 11
"""Columns of a rebound, beside those."""
INCOMING, OUTGOING, INCOMING_ERROR, OUTGOING_ERROR, WALL_ERROR = range(
    LOSS_COLUMNS, LOSS_COLUMNS + 5
)
"""Of a rebound: normal speeds, their errors and that of the wall velocity, [m/s]."""
(VERTICAL_BEFORE, VERTICAL_AFTER, HITS_BEFORE, HITS_AFTER, DRAG_TIME_BEFORE, DRAG_TIME_AFTER) = (
    range(WALL_ERROR + 1, REBOUND_COLUMNS)
)
"""Of the flight before and after a rebound: root mean square vertical speed over the speed of the
bead, hits of floor or lid at that vertical speed, drag time, [s]."""
NODES = 51
"""Restitutions from 0 to 1 at which a collision has its log likelihood."""
COLLISION_COLUMNS = LOSS_COLUMNS + 1 + 2 * NODES
"""Columns of a collision: besides, impact speed times 1 + restitution, [m/s], log likelihood at
each node, and its derivative by the slope of the restitution against the logarithm of speed."""

# Slope for that derivative, which is nearly constant.
_SLOPE = 0.1
# One vertical ratio, as one excess of the radii, in the middle of those that are likely: a test
# for a change with speed depends on neither.
_RATIO = VERTICAL_RATIOS[len(VERTICAL_RATIOS) // 2]


def rebound_impacts(rebounds: Sequence[Rebound]) -> NDArray[np.float64]:
    """A row for each rebound, (n, REBOUND_COLUMNS)."""
    rows = [_of_rebound(rebound) for rebound in rebounds]
    return np.array(rows, dtype=np.float64).reshape(-1, REBOUND_COLUMNS)


def _of_rebound(rebound: Rebound) -> tuple[float, ...]:
    before = math.hypot(rebound.incoming.value, rebound.tangential_incoming)
    after = math.hypot(rebound.outgoing.value, rebound.tangential_outgoing)
    # No temperature where no speed was known.
    vertical = math.sqrt(rebound.temperature) if rebound.temperature > 0.0 else 0.0
    drag_time = rebound.incoming_drag_time + rebound.outgoing_drag_time
    hits = 0.0
    if vertical * rebound.free_height * drag_time > 0.0:
        time = rebound.friction_length * 0.5 * (before + after) / rebound.temperature
        # In both flights, each twice as long as from its middle to the contact.
        hits = 2.0 * time * vertical / rebound.free_height
        hits /= drag_time
    return (
        drag_time,
        rebound.friction_length,
        rebound.drag,
        rebound.incoming.value,
        rebound.outgoing.value,
        rebound.incoming.error,
        rebound.outgoing.error,
        rebound.wall_velocity.error,
        vertical / before,
        vertical / after if after > 0.0 else 0.0,
        hits * rebound.incoming_drag_time,
        hits * rebound.outgoing_drag_time,
        rebound.incoming_drag_time,
        rebound.outgoing_drag_time,
    )


def collision_impacts(
    collisions: Sequence[PairCollision], sticking_speed: float = 0.0
) -> NDArray[np.float32]:
    """A row for each collision that has an impact speed, (n, COLLISION_COLUMNS).

    Parameters
    ----------
    collisions : sequence of PairCollision
    sticking_speed : float, [m/s]
        Slower collisions are missing, since their beads merge.
    """
    if not collisions:
        return np.zeros((0, COLLISION_COLUMNS), dtype=np.float32)
    seen = ProjectedCollisions.of(collisions).with_errors(PAIR_ERRORS)
    grid, ratios = np.linspace(0.0, 1.0, NODES), np.array([_RATIO])
    limits = sticking_speed, OUTLIERS
    level, tilted = (
        projected_log_densities(seen, grid, ratios, [MIDDLE_EXCESS], limits, slope)[0, 0]
        for slope in (0.0, _SLOPE)
    )
    losses = [
        (
            float(np.mean(collision.before_drag_times + collision.after_drag_times)),
            collision.friction_length,
            collision.drag,
        )
        for collision in collisions
    ]
    speed = (seen.approach + seen.parting) / horizontal_parts(seen, MIDDLE_EXCESS)[0]
    rows = np.column_stack([losses, speed, level, (tilted - level) / _SLOPE])
    return rows[speed > 0.0].astype(np.float32)


def impact_speeds(
    collisions: Sequence[PairCollision], restitution: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Normal impact speeds of collisions and their errors, both (n,), [m/s].

    Parameters
    ----------
    collisions : sequence of PairCollision
        One or more.
    restitution : float, 0 to 1
        About that of the collisions.
    """
    seen = ProjectedCollisions.of(collisions).with_errors(PAIR_ERRORS)
    part, spread = horizontal_parts(seen, MIDDLE_EXCESS)
    both = seen.approach + seen.parting
    variance = seen.approach_variance + seen.parting_variance + 2.0 * seen.covariance
    speed = both / (part * (1.0 + restitution))
    error = np.hypot(np.sqrt(variance) / (part * (1.0 + restitution)), speed * spread / part)
    return speed, error
