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

if TYPE_CHECKING:
    from numpy.typing import NDArray

MAX_FLIGHT_POINTS = 48
"""Largest number of positions that a line is fitted to."""

MIN_FLIGHT_POINTS = 4
"""Smallest number of positions of a flight on each side of a velocity jump."""

JUMP_SIZE = 2 * LINE_SIZE + 3
"""Length of the array that holds a velocity jump: two lines, `last`, `first`, `shared_error`."""

_CAPACITY = 4 * MAX_FLIGHT_POINTS
# Positions on each side of a break point: two lines through fewer would fit anything.
_MIN_SIDE_POINTS = 2
# Decrease of chi square that makes a break: noise reaches 30 once in about 10,000 flights.
_MIN_GAIN = 30.0
# Smallest residual variance, relative to the stated one. Errors that a bead keeps over some pixels
# bend its trajectory slightly; without this limit they would cut it into pieces.
_MIN_VARIANCE = 0.25
# Length over which light, shadow and outline displace a bead by the same amount, in radii.
_SHARED_LENGTH = 0.5
# Positions by which the best break may shift once the whole flight after it is known.
_MAX_SHIFT = 2


class TrackBuffer(NamedTuple):
    """The last positions of several tracks; each track has a slot.

    Parameters
    ----------
    times, errors : ndarray (slots, capacity), [s], [m]
    positions : ndarray (slots, capacity, 2), [m]
        In the camera frame.
    ends : ndarray of int64, (slots,)
        Number of positions.
    flight_starts, previous_starts : ndarray of int64, (slots,)
        Index of the first position of the current flight and of the previous one; -1 when there
        is no previous one.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    errors: NDArray[np.float64]
    ends: NDArray[np.int64]
    flight_starts: NDArray[np.int64]
    previous_starts: NDArray[np.int64]

    @classmethod
    def empty(cls, slots: int) -> TrackBuffer:
        """Allocate an empty buffer."""
        return cls(
            np.empty((slots, _CAPACITY)),
            np.empty((slots, _CAPACITY, 2)),
            np.empty((slots, _CAPACITY)),
            *(np.zeros(slots, dtype=np.int64) for _ in range(3)),
        )

    def doubled(self) -> TrackBuffer:
        """Return a copy with twice as many slots."""
        return TrackBuffer(*(np.concatenate([column, np.zeros_like(column)]) for column in self))


@compiled
def reset_slot(buffer: TrackBuffer, slot: int) -> None:
    """Empty a slot."""
    buffer.ends[slot] = buffer.flight_starts[slot] = 0
    buffer.previous_starts[slot] = -1


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
    jumps: NDArray[np.float64],
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
    jumps : ndarray (n, JUMP_SIZE)
        Written for each velocity jump whose flights before and after are complete now.

    Returns
    -------
    ndarray of int64, (jumps,)
        Rows of `jumps` that were written.
    """
    rows, count = np.empty(slots.size, dtype=np.int64), 0
    flight, position = np.empty(LINE_SIZE), np.empty(2)
    for k in range(slots.size):
        slot = slots[k]
        if slot < 0 or not beads.seen[k]:
            continue
        radius = known_radii[beads.species[k]]
        if radius != radius:
            radius = beads.radii[k]
        sizes[slot, 0], sizes[slot, 1] = radius, beads.radius_errors[k]
        for c in range(2):
            position[c] = beads.positions[k, c] + beads.displacement[c]
        variance = residuals.variances[beads.species[k]]
        jumped = _end_after_gap(buffer, slot, time, max_gap, variance, radius, jumps[k])
        _append(buffer, slot, time, position, beads.errors[k])
        if not jumped:
            jumped, ended = _split_flight(buffer, slot, variance, radius, jumps[k], flight)
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
    jump: NDArray[np.float64],
) -> bool:
    """End a track that was not seen for `max_gap`; whether its last jump was written."""
    end = buffer.ends[slot]
    if end == 0 or not time - buffer.times[slot, end - 1] > max_gap:
        return False
    jumped = finish_flight(buffer, slot, variance, radius, jump)
    reset_slot(buffer, slot)
    return jumped


@compiled
def _append(
    buffer: TrackBuffer, slot: int, time: float, position: NDArray[np.float64], error: float
) -> None:
    if buffer.ends[slot] == _CAPACITY:
        _discard_oldest(buffer, slot)
    end = buffer.ends[slot]
    buffer.times[slot, end], buffer.errors[slot, end] = time, error
    buffer.positions[slot, end] = position
    buffer.ends[slot] += 1


@compiled
def finish_flight(
    buffer: TrackBuffer, slot: int, variance: float, radius: float, jump: NDArray[np.float64]
) -> bool:
    """Write the jump before the last flight of a track, which ends here; whether there is one."""
    return _write_jump(buffer, slot, buffer.ends[slot], variance, radius, jump)


@compiled
def _split_flight(
    buffer: TrackBuffer,
    slot: int,
    variance: float,
    radius: float,
    jump: NDArray[np.float64],
    flight: NDArray[np.float64],
) -> tuple[bool, bool]:
    """Cut the current flight at its best break; whether a jump was written and a flight ended."""
    start, end = buffer.flight_starts[slot], buffer.ends[slot]
    offset, gain = _break_point(buffer, slot, start, end)
    # With one position after the jump, the fit would move the last one before it across.
    is_settled = start + offset + _MIN_SIDE_POINTS < end
    if is_settled and gain > _MIN_GAIN * max(variance, _MIN_VARIANCE):
        break_row = start + offset
        _write_line(buffer, slot, start, break_row, flight)
        jumped = _write_jump(buffer, slot, break_row, variance, radius, jump)
        buffer.previous_starts[slot], buffer.flight_starts[slot] = start, break_row
        return jumped, True
    if end - start <= MAX_FLIGHT_POINTS:
        return False, False
    jumped = _write_jump(buffer, slot, end, variance, radius, jump)
    buffer.previous_starts[slot] = -1
    buffer.flight_starts[slot] += 1
    if jumped:
        _write_line(buffer, slot, start + 1, end, flight)
    return jumped, jumped


@compiled
def _break_point(buffer: TrackBuffer, slot: int, first: int, end: int) -> tuple[int, float]:
    return best_break(
        buffer.times[slot, first:end],
        buffer.positions[slot, first:end],
        buffer.errors[slot, first:end],
        _MIN_SIDE_POINTS,
    )


@compiled
def _write_line(
    buffer: TrackBuffer, slot: int, first: int, end: int, row: NDArray[np.float64]
) -> None:
    write_line(
        buffer.times[slot, first:end],
        buffer.positions[slot, first:end],
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
    _write_line(buffer, slot, window_start, first, jump[:LINE_SIZE])
    _write_line(buffer, slot, first, end, jump[LINE_SIZE : 2 * LINE_SIZE])
    for line in (jump[:LINE_SIZE], jump[LINE_SIZE : 2 * LINE_SIZE]):
        rescale_errors(line, variance, shared_error, _SHARED_LENGTH * radius)
    jump[2 * LINE_SIZE] = buffer.times[slot, first - 1]
    jump[2 * LINE_SIZE + 1] = buffer.times[slot, first]
    jump[2 * LINE_SIZE + 2] = shared_error
    return True


@compiled
def _discard_oldest(buffer: TrackBuffer, slot: int) -> None:
    start, end = buffer.flight_starts[slot], buffer.ends[slot]
    previous = buffer.previous_starts[slot]
    first_kept = max(previous if previous >= 0 else start, start - MAX_FLIGHT_POINTS)
    kept = end - first_kept
    for k in range(kept):
        buffer.times[slot, k] = buffer.times[slot, first_kept + k]
        buffer.errors[slot, k] = buffer.errors[slot, first_kept + k]
        buffer.positions[slot, k] = buffer.positions[slot, first_kept + k]
    buffer.flight_starts[slot], buffer.ends[slot] = start - first_kept, kept
    buffer.previous_starts[slot] = 0 if previous >= 0 else -1
