"""Compiled piecewise linear segmentation of tracks: straight flights and velocity jumps.

Tested by ``test/stages/contacts/test_contact_finder.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.contacts.line_fits import (
    LINE_SIZE,
    best_break,
    rescale_errors,
    write_line,
)
from nanorocks_ros.stages.contacts.residual_variance import ResidualVariance, add_flight
from nanorocks_ros.stages.contacts.track_buffer import (
    MAX_FLIGHT_POINTS,
    MAX_FREE_POINTS,
    TrackBuffer,
    append_position,
    reset_slot,
)
from nanorocks_ros.stages.flights.bend_fits import undragged_times, write_bend
from nanorocks_ros.stages.tracking.linking.track_store import ALIKE_RADII

if TYPE_CHECKING:
    from numpy.typing import NDArray

MIN_FLIGHT_POINTS = 4
"""Smallest number of positions of a flight on each side of a velocity jump."""

JUMP_SIZE = 2 * LINE_SIZE + 3
"""Length of the array that holds a velocity jump: two lines, `last`, `first`, `shared_error`."""

# Positions on each side of a break point: two lines through fewer would fit anything.
_MIN_SIDE_POINTS = 2
# Decrease of chi square that makes a break: noise reaches 30 once in about 10,000 flights. It is
# counted in stated errors, even where residuals are smaller: errors that a bead keeps over some
# pixels bend its trajectory without a contact.
_MIN_GAIN = 30.0
# The same for the end of a free flight. Place errors that change over some pixels make many of the
# weaker breaks: flights that end at them are those that are bent least, by drag or by chance.
_MIN_FREE_GAIN = 150.0
# Smallest residual variance that it is counted in, relative to the stated one.
_MIN_FREE_VARIANCE = 0.25
# Positions by which the best break may shift once the whole flight after it is known.
_MAX_SHIFT = 2


class FrameBeads(NamedTuple):
    """Arrays of the beads in one frame, as in `nanorocks_ros.records.Tracks`."""

    species: NDArray[np.int32]
    positions: NDArray[np.float64]
    displacement: NDArray[np.float64]
    errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    seen: NDArray[np.bool_]


@compiled
def append_positions(
    buffer: TrackBuffer,
    residuals: ResidualVariance,
    time: float,
    max_gap: float,
    slots: NDArray[np.int64],
    beads: FrameBeads,
    known_radii: NDArray[np.float64],
    sizes: NDArray[np.float64],
    seen_radii: NDArray[np.float64],
    jumps: NDArray[np.float64],
    bends: NDArray[np.float64],
) -> NDArray[np.int64]:
    """Append the positions of the visible beads of a frame to their tracks.

    Parameters
    ----------
    buffer, residuals
        Changed.
    time : float, [s]
    max_gap : float, [s]
        A track without a position for longer is cut: the bead may have collided unseen.
    slots : ndarray of int64, (n,)
        Slot of each track; -1 for a track that is left out.
    beads : FrameBeads
    known_radii : ndarray (species,), [m]
        NaN for a species whose beads differ in size.
    sizes : ndarray (slots, 2), [m]
        Written: radii and their measurement errors.
    seen_radii : ndarray (species, 2), [1/m^2], [1/m]
        Sums over all visible beads, written: weights, and measured radii times weights.
    jumps : ndarray (n, JUMP_SIZE)
        Written for each velocity jump whose flights before and after are complete now.
    bends : ndarray (n, BEND_SIZE)
        Written for each free flight that ended: rows without one have no positions.

    Returns
    -------
    ndarray of int64, (jumps,)
        Rows of `jumps` that were written.
    """
    rows, count = np.empty(slots.size, dtype=np.int64), 0
    flight, position = np.empty(LINE_SIZE), np.empty(2)
    for k in range(slots.size):
        slot = slots[k]
        bends[k, 2] = 0.0
        if slot < 0 or not beads.seen[k]:
            continue
        kind, error = beads.species[k], beads.radius_errors[k]
        if error > 0.0:
            seen_radii[kind, 0] += 1.0 / (error * error)
            seen_radii[kind, 1] += beads.radii[k] / (error * error)
        radius = known_radii[kind]
        if radius != radius:
            radius = beads.radii[k]
        sizes[slot, 0], sizes[slot, 1] = radius, error
        for c in range(2):
            position[c] = beads.positions[k, c] + beads.displacement[c]
        variance = residuals.variances[beads.species[k]]
        results = jumps[k], bends[k]
        jumped = _end_after_gap(buffer, slot, time, max_gap, variance, radius, results)
        append_position(buffer, slot, time, position, beads.errors[k])
        if not jumped:
            jumped, ended = _split_flight(buffer, slot, variance, radius, results, flight)
            if ended:
                add_flight(residuals, beads.species[k], flight)
        if jumped:
            rows[count] = k
            count += 1
    return rows[:count]


@compiled
def _end_after_gap(
    buffer: TrackBuffer,
    slot: int,
    time: float,
    max_gap: float,
    variance: float,
    radius: float,
    results: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> bool:
    """End a track that was not seen for `max_gap`; whether its last jump was written."""
    end = buffer.ends[slot]
    if end == 0 or not time - buffer.times[slot, end - 1] > max_gap:
        return False
    jumped = finish_flight(buffer, slot, variance, radius, results)
    reset_slot(buffer, slot)
    return jumped


@compiled
def finish_flight(
    buffer: TrackBuffer,
    slot: int,
    variance: float,
    radius: float,
    results: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> bool:
    """Write jump and bend of the last flight of a track, which ends; whether there is a jump.

    `results` are arrays for the jump before the flight and for the bend of it.
    """
    _end_free_flight(buffer, slot, buffer.ends[slot], results[1])
    return _write_jump(buffer, slot, buffer.ends[slot], variance, radius, results[0])


@compiled
def _end_free_flight(buffer: TrackBuffer, slot: int, end: int, bend: NDArray[np.float64]) -> None:
    """Write the bend of the free flight up to a position, where the next one begins."""
    first = buffer.free_starts[slot]
    write_bend(
        buffer.times[slot, first:end],
        buffer.positions[slot, first:end],
        buffer.errors[slot, first:end],
        bend,
    )
    buffer.free_starts[slot] = end


@compiled
def _split_flight(
    buffer: TrackBuffer,
    slot: int,
    variance: float,
    radius: float,
    results: tuple[NDArray[np.float64], NDArray[np.float64]],
    flight: NDArray[np.float64],
) -> tuple[bool, bool]:
    """Cut the current flight at its best break; whether a jump was written and a flight ended."""
    start, end = buffer.flight_starts[slot], buffer.ends[slot]
    offset, gain = _break_point(buffer, slot, start, end)
    # With one position after the jump, the fit would move the last one before it across.
    is_settled = start + offset + _MIN_SIDE_POINTS < end
    if is_settled and gain > _MIN_GAIN * max(variance, 1.0):
        break_row = start + offset
        _write_line(buffer, slot, start, break_row, buffer.times[slot, start], flight)
        jumped = _write_jump(buffer, slot, break_row, variance, radius, results[0])
        if gain > _MIN_FREE_GAIN * max(variance, _MIN_FREE_VARIANCE) or _is_long(
            buffer, slot, break_row
        ):
            _end_free_flight(buffer, slot, break_row, results[1])
        buffer.previous_starts[slot], buffer.flight_starts[slot] = start, break_row
        return jumped, True
    if end - start <= MAX_FLIGHT_POINTS:
        return False, False
    jumped = _write_jump(buffer, slot, end, variance, radius, results[0])
    buffer.previous_starts[slot] = -1
    buffer.flight_starts[slot] += 1
    if _is_long(buffer, slot, start + 1):
        _end_free_flight(buffer, slot, start + 1, results[1])
    if jumped:
        _write_line(buffer, slot, start + 1, end, buffer.times[slot, start], flight)
    return jumped, jumped


@compiled
def _is_long(buffer: TrackBuffer, slot: int, end: int) -> bool:
    """Whether the free flight has to end at a position, so that it stays in the buffer."""
    return bool(end - buffer.free_starts[slot] >= MAX_FREE_POINTS)


@compiled
def _break_point(buffer: TrackBuffer, slot: int, first: int, end: int) -> tuple[int, float]:
    times = buffer.times[slot, first:end]
    return best_break(
        undragged_times(times, times[0], buffer.drags[slot]),
        _fallen_back(buffer, slot, first, end, times[0]),
        buffer.errors[slot, first:end],
        _MIN_SIDE_POINTS,
    )


@compiled
def _fallen_back(
    buffer: TrackBuffer, slot: int, first: int, end: int, origin: float
) -> NDArray[np.float64]:
    """Positions for an observer that falls with the beads, and is at rest at `origin`, [s]."""
    positions = buffer.positions[slot, first:end].copy()
    if buffer.acceleration[0] == 0.0 and buffer.acceleration[1] == 0.0:
        return positions
    for k in range(end - first):
        since = buffer.times[slot, first + k] - origin
        for c in range(2):
            positions[k, c] -= 0.5 * buffer.acceleration[c] * since * since
    return positions


@compiled
def _write_line(
    buffer: TrackBuffer,
    slot: int,
    first: int,
    end: int,
    origin: float,
    row: NDArray[np.float64],
) -> None:
    """Fit a line to positions, without drag and acceleration: its slope is at `origin`."""
    write_line(
        undragged_times(buffer.times[slot, first:end], origin, buffer.drags[slot]),
        _fallen_back(buffer, slot, first, end, origin),
        buffer.errors[slot, first:end],
        row,
    )


@compiled
def _write_jump(
    buffer: TrackBuffer,
    slot: int,
    end: int,
    variance: float,
    radius: float,
    jump: NDArray[np.float64],
) -> bool:
    """Write the jump at the start of the flight that ends at `end`; whether there is one."""
    previous, start = buffer.previous_starts[slot], buffer.flight_starts[slot]
    if previous < 0:
        return False
    buffer.previous_starts[slot] = -1
    window_start = max(previous, start - MAX_FLIGHT_POINTS)
    first = window_start + _break_point(buffer, slot, window_start, end)[0]
    shortest = min(first - window_start, end - first)
    if shortest < MIN_FLIGHT_POINTS or abs(first - start) > _MAX_SHIFT:
        return False
    # The error that neighbouring positions share differs between the ends of a flight.
    shared_error = (
        math.sqrt(max(1.0 - variance, 0.0)) * buffer.errors[slot, window_start:end].mean()
    )
    contact = 0.5 * (buffer.times[slot, first - 1] + buffer.times[slot, first])
    _write_line(buffer, slot, window_start, first, contact, jump[:LINE_SIZE])
    _write_line(buffer, slot, first, end, contact, jump[LINE_SIZE : 2 * LINE_SIZE])
    for line in (jump[:LINE_SIZE], jump[LINE_SIZE : 2 * LINE_SIZE]):
        rescale_errors(line, variance, shared_error, ALIKE_RADII * radius)
    jump[2 * LINE_SIZE] = buffer.times[slot, first - 1]
    jump[2 * LINE_SIZE + 1] = buffer.times[slot, first]
    jump[2 * LINE_SIZE + 2] = shared_error
    return True
