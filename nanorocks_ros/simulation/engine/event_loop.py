"""The loop over events."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import inlined, kernel
from nanorocks_ros.simulation.engine.collision.aggregates import advance
from nanorocks_ros.simulation.engine.collision.bead_collisions import collide_pair
from nanorocks_ros.simulation.engine.collision.wall_collisions import bounce_off_wall
from nanorocks_ros.simulation.engine.event_prediction import predict
from nanorocks_ros.simulation.engine.event_queue import earliest
from nanorocks_ros.simulation.engine.gas_state import (
    COUNTER,
    DONE,
    EPOCH,
    LISTS_FULL,
    LOG_FULL,
    MISSED,
    NOW,
    ORIGINAL,
    PARTNER,
    PARTNER_COUNTER,
    PREDICTED,
    QUANTUM,
    RENEW,
    STALE,
    TIME,
    TOO_MANY_EVENTS,
    State,
)
from nanorocks_ros.simulation.engine.integer_width import whole
from nanorocks_ros.simulation.engine.neighbours.neighbour_lists import renew
from nanorocks_ros.simulation.engine.observables import observe, take_frame

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.simulation.engine.collision_rules import Rules

# Places in Output.done.
FRAMES, OBSERVATIONS, EVENTS, TAKEN = range(4)

# Every bead is marked.
ALL = -2
# A list of neighbours or a cell has no room left.
FULL = -1

# Columns of Output.events.
WHEN, KIND, FIRST, SECOND, SPEED, IMPULSE = range(6)


class Output(NamedTuple):
    """What is written down while a gas is followed.

    Parameters
    ----------
    frame_times : ndarray (n_frames,), [s]
    positions, velocities : ndarray (n_frames, n, 3), [m], [m/s]
    spins : ndarray (n_frames, n, 3) or (n_frames, 0, 3), [rad/s]
    bodies : ndarray of int32, (n_frames, n) or (n_frames, 0)
    observation_times : ndarray (n_observations,), [s]
    observations : ndarray (n_observations, n_columns)
        See `observables`.
    events : ndarray (room, 6)
        Time [s], kind, bead, bead or wall, normal relative speed [m/s], impulse [kg m/s]; no
        room: not wanted.
    done : ndarray of int64, (4,)
        Frames, observations and events written; events taken, of whatever kind.
    """

    frame_times: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    spins: NDArray[np.float64]
    bodies: NDArray[np.int32]
    observation_times: NDArray[np.float64]
    observations: NDArray[np.float64]
    events: NDArray[np.float64]
    done: NDArray[np.int64]


@inlined
def handle(state: State, rules: Rules, i: int, now: float) -> int:
    """Take the pending event of a bead and execute it if it still holds.

    Returns
    -------
    int
        Beads marked, whose next event must be found; ``FULL`` when a list is.
    """
    partner = whole(state.links[i, PARTNER])
    state.last[0] = 0.0
    if partner == RENEW:
        if state.references.shape[0] and not renew(state, rules, i, now):
            return FULL
    elif partner >= 0 and state.links[partner, COUNTER] != state.links[i, PARTNER_COUNTER]:
        state.counts[STALE] += 1
    else:
        if partner < 0:
            marked = bounce_off_wall(state, rules, i, -1 - partner, now)
        else:
            marked = collide_pair(state, rules, i, partner, now)
        if marked:
            return marked
        state.counts[MISSED] += 1
    state.dirty[0] = i
    return 1


@inlined
def write_event(state: State, i: int, partner: int, now: float, output: Output) -> None:
    """Enter the event just executed, if there was one, in the log."""
    if state.last[0] == 0.0:
        return
    row = output.done[EVENTS]
    output.done[EVENTS] = row + 1
    events = output.events
    events[row, WHEN] = state.clock[EPOCH] + now
    events[row, KIND] = state.last[0]
    first = whole(state.links[i, ORIGINAL])
    second = whole(-1 - partner)
    if partner >= 0:
        second = whole(state.links[partner, ORIGINAL])
        first, second = min(first, second), max(first, second)
    events[row, FIRST] = first
    events[row, SECOND] = second
    events[row, SPEED] = state.last[1]
    events[row, IMPULSE] = state.last[2]


@inlined
def count_time_anew(state: State) -> None:
    """Bring all beads to one instant and count time from there: no digits are lost.

    The quantum is a power of two and every pending time a later one, so the subtraction is
    exact.
    """
    quantum = state.clock[QUANTUM]
    for i in range(state.rows.shape[0]):
        advance(state, i, quantum)
        state.rows[i, TIME] = 0.0
    for k in range(state.times.size):
        state.times[k] -= quantum
    for k in range(state.contacts.shape[0]):
        state.contacts[k, 2] -= quantum
    state.clock[EPOCH] += quantum


@inlined
def write_down(state: State, rules: Rules, output: Output, until: float) -> None:
    """Take the frames and observations that are due before a time (absolute)."""
    done = output.done
    epoch = state.clock[EPOCH]
    while done[FRAMES] < output.frame_times.size and output.frame_times[done[FRAMES]] < until:
        k = done[FRAMES]
        take_frame(
            state,
            rules,
            output.frame_times[k] - epoch,
            output.positions[k],
            output.velocities[k],
            output.spins[k],
            output.bodies[k],
        )
        done[FRAMES] = k + 1
    times = output.observation_times
    while done[OBSERVATIONS] < times.size and times[done[OBSERVATIONS]] < until:
        k = done[OBSERVATIONS]
        observe(state, rules, output.observations[k])
        done[OBSERVATIONS] = k + 1


@inlined
def look_ahead(state: State, rules: Rules, marked: int) -> None:
    """Find the next event of the beads that are marked, or of all."""
    for k in range(state.rows.shape[0] if marked == ALL else marked):
        i = k if marked == ALL else whole(state.dirty[k])
        predict(state, rules, i, state.clock[NOW])


@kernel
def run_until(state: State, rules: Rules, end: float, most_events: int, output: Output) -> int:
    """Follow the gas to a time, and write down what is wanted on the way.

    Events at the very time of a frame belong to it. Neither frames nor the end touch the
    beads, so the course of the gas does not depend on them. After any return the gas can be
    followed further.

    Parameters
    ----------
    state : State
        Changed.
    rules : Rules
    end : float, [s]
    most_events : int
        Events to have taken, of whatever kind, with this output before giving up.
    output : Output
        Times rising, none after `end`; changed.

    Returns
    -------
    int
        ``DONE``, ``TOO_MANY_EVENTS``, ``LISTS_FULL`` (build them again, with more room) or
        ``LOG_FULL``.
    """
    times = state.times
    room = output.events.shape[0]
    done = output.done
    marked = 0 if state.clock[PREDICTED] else ALL
    state.clock[PREDICTED] = 1.0
    while True:
        look_ahead(state, rules, marked)
        i = whole(earliest(times, state.levels))
        absolute = state.clock[EPOCH] + times[i]
        write_down(state, rules, output, absolute)
        if not absolute <= end:
            break
        marked = 0
        if done[TAKEN] == most_events:
            return TOO_MANY_EVENTS
        if room and done[EVENTS] == room:
            return LOG_FULL
        if times[i] >= state.clock[QUANTUM]:
            count_time_anew(state)
        done[TAKEN] += 1
        state.clock[NOW] = times[i]
        partner = whole(state.links[i, PARTNER])
        marked = handle(state, rules, i, times[i])
        if marked == FULL:
            return LISTS_FULL
        if room:
            write_event(state, i, partner, times[i], output)
    state.clock[NOW] = end - state.clock[EPOCH]
    return DONE


@kernel
def snapshot(
    state: State,
    rules: Rules,
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64],
    spins: NDArray[np.float64],
) -> None:
    """Write down the beads as they are now, by original number.

    Parameters
    ----------
    state : State
    rules : Rules
    positions, velocities : ndarray (n, 3), [m], [m/s]
        Written.
    spins : ndarray (n, 3) or (0, 3), [rad/s]
        Written.
    """
    nothing = state.links[:0, 0]
    take_frame(state, rules, state.clock[NOW], positions, velocities, spins, nothing)
