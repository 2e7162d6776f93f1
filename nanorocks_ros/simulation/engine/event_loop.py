"""The event loop: execute the earliest event, predict the next ones, write frames.

Tested by ``test/simulation/engine/test_reference_agreement.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import inlined, kernel
from nanorocks_ros.simulation.engine.collision.aggregates import advance
from nanorocks_ros.simulation.engine.collision.bead_collisions import collide_pair
from nanorocks_ros.simulation.engine.collision.rigid_collisions import renew_stretch
from nanorocks_ros.simulation.engine.collision.wall_collisions import bounce_off_wall
from nanorocks_ros.simulation.engine.event_prediction import predict
from nanorocks_ros.simulation.engine.event_queue import earliest
from nanorocks_ros.simulation.engine.flight.rotation_series import is_at_end
from nanorocks_ros.simulation.engine.flight.turning_motion import (
    is_turning,
    shift_motions,
    turns,
)
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
from nanorocks_ros.simulation.engine.integer_width import as_int64
from nanorocks_ros.simulation.engine.neighbours.neighbour_lists import renew
from nanorocks_ros.simulation.engine.observables import write_frame, write_observation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules

# Places in Output.done.
FRAMES, OBSERVATIONS, EVENTS, TAKEN = range(4)

# Every bead is marked.
ALL = -2
# A neighbour list or a cell is full.
FULL = -1

# Columns of Output.events.
WHEN, KIND, FIRST, SECOND, SPEED, IMPULSE = range(6)


class RunOutput(NamedTuple):
    """Arrays that a run writes: frames, observations, events.

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
        Frames, observations and events written; events of any kind taken.
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
def execute_event(state: State, rules: Rules, i: int, now: float) -> int:
    """Execute the pending event of a bead, unless it is stale.

    Returns
    -------
    int
        Number of marked beads, whose next event must be predicted; ``FULL`` when a list is.
    """
    partner = as_int64(state.links[i, PARTNER])
    state.last[0] = 0.0
    if partner == RENEW:
        if is_turning(state) and turns(state, i) and is_at_end(state, i, now):
            return renew_stretch(state, i, now)
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
def write_event(state: State, i: int, partner: int, now: float, output: RunOutput) -> None:
    """Append the executed event, if any, to the log."""
    if state.last[0] == 0.0:
        return
    row = output.done[EVENTS]
    output.done[EVENTS] = row + 1
    events = output.events
    events[row, WHEN] = state.clock[EPOCH] + now
    events[row, KIND] = state.last[0]
    first = as_int64(state.links[i, ORIGINAL])
    second = as_int64(-1 - partner)
    if partner >= 0:
        second = as_int64(state.links[partner, ORIGINAL])
        first, second = min(first, second), max(first, second)
    events[row, FIRST] = first
    events[row, SECOND] = second
    events[row, SPEED] = state.last[1]
    events[row, IMPULSE] = state.last[2]


@inlined
def advance_epoch(state: State) -> None:
    """Move the epoch forward by one quantum, so that times keep their precision.

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
    if is_turning(state):
        shift_motions(state, quantum)
    state.clock[EPOCH] += quantum


@inlined
def write_due(state: State, rules: Rules, output: RunOutput, until: float) -> None:
    """Write the frames and observations that are due before an absolute time."""
    done = output.done
    epoch = state.clock[EPOCH]
    while done[FRAMES] < output.frame_times.size and output.frame_times[done[FRAMES]] < until:
        k = done[FRAMES]
        write_frame(
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
        write_observation(state, rules, times[k] - epoch, output.observations[k])
        done[OBSERVATIONS] = k + 1


@inlined
def predict_marked(state: State, rules: Rules, marked: int) -> None:
    """Predict the next event of the marked beads, or of all."""
    for k in range(state.rows.shape[0] if marked == ALL else marked):
        i = k if marked == ALL else as_int64(state.dirty[k])
        predict(state, rules, i, state.clock[NOW])


@kernel
def run_until(state: State, rules: Rules, end: float, most_events: int, output: RunOutput) -> int:
    """Follow the gas to a time; write frames, observations and events on the way.

    An event at the time of a frame comes before the frame. Frames and the end of a run do not
    change the beads, so the trajectories do not depend on them. After any return the run can be
    continued.

    Parameters
    ----------
    state : State
        Changed.
    rules : Rules
    end : float, [s]
    most_events : int
        Largest number of events of any kind with this output.
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
        predict_marked(state, rules, marked)
        i = as_int64(earliest(times, state.levels))
        absolute = state.clock[EPOCH] + times[i]
        write_due(state, rules, output, absolute)
        if not absolute <= end:
            break
        marked = 0
        if done[TAKEN] == most_events:
            return TOO_MANY_EVENTS
        if room and done[EVENTS] == room:
            return LOG_FULL
        if times[i] >= state.clock[QUANTUM]:
            advance_epoch(state)
        done[TAKEN] += 1
        state.clock[NOW] = times[i]
        partner = as_int64(state.links[i, PARTNER])
        marked = execute_event(state, rules, i, times[i])
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
    """Write the present positions and velocities, by original number.

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
    write_frame(state, rules, state.clock[NOW], positions, velocities, spins, nothing)
