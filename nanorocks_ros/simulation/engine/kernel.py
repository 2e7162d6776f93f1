"""The loop over events, for gases small enough to ask everybody: a linear scan is the queue."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.physics.compiled import compiled
from nanorocks_ros.simulation.engine.collisions import bounce_off_wall, collide_pair
from nanorocks_ros.simulation.engine.prediction import predict
from nanorocks_ros.simulation.engine.state import (
    DONE,
    MISSED,
    STALE,
    TOO_MANY_EVENTS,
    Rules,
    State,
    snapshot,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@compiled
def earliest(times: NDArray[np.float64]) -> int:
    """Index of the smallest time, the first of equals."""
    best = 0
    for i in range(1, times.size):
        if times[i] < times[best]:
            best = i
    return best


@compiled
def handle(state: State, rules: Rules, i: int) -> None:
    """Take the pending event of a bead: execute it if it still holds, and look ahead again."""
    now = state.event_time[i]
    partner = state.event_partner[i]
    if partner < 0:
        bounce_off_wall(state, rules, i, -1 - partner, now)
    elif state.counter[partner] != state.event_counter[i]:
        state.counts[STALE] += 1
    elif collide_pair(state, rules, i, partner, now):
        predict(state, rules, partner, now)
    else:
        state.counts[MISSED] += 1
    predict(state, rules, i, now)


@compiled
def run_until(
    state: State,
    rules: Rules,
    end: float,
    most_events: int,
    frame_times: NDArray[np.float64],
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64],
) -> int:
    """Follow the gas to a time, and write down frames on the way.

    Events at the very time of a frame belong to it. Neither frames nor the end touch the
    beads, so the course of the gas does not depend on them.

    Parameters
    ----------
    state : State
        Changed.
    rules : Rules
    end : float, [s]
    most_events : int
        Events to take, of whatever kind, before giving up.
    frame_times : ndarray (n_frames,), [s]
        Rising, none after `end`.
    positions, velocities : ndarray (n_frames, n, 3), [m], [m/s]
        Written.

    Returns
    -------
    int
        ``DONE`` or ``TOO_MANY_EVENTS``.
    """
    frame = 0
    taken = 0
    while True:
        i = earliest(state.event_time)
        when = state.event_time[i]
        while frame < frame_times.size and frame_times[frame] < when:
            snapshot(state, frame_times[frame], positions[frame], velocities[frame])
            frame += 1
        if not when <= end:
            break
        if taken == most_events:
            return TOO_MANY_EVENTS
        taken += 1
        state.clock[0] = when
        handle(state, rules, i)
    state.clock[0] = end
    return DONE
