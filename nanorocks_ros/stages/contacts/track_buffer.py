"""The last positions of the tracks of a tray, in slots.

Tested by ``test/stages/contacts/test_contact_finder.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

MAX_FLIGHT_POINTS = 48
"""Largest number of positions that a line is fitted to."""

MAX_FREE_POINTS = 3 * MAX_FLIGHT_POINTS
"""Settled positions at which a free flight is cut, so that it stays in the buffer."""

_CAPACITY = 6 * MAX_FLIGHT_POINTS


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
    free_starts : ndarray of int64, (slots,)
        Index of the first position since the bead last changed its velocity: at most
        `flight_starts`, which keeps up with the last positions.
    drags : ndarray (slots,), >= 0, [1/s]
        Of the beads: their flights are straight in the clock of a gas without drag.
    acceleration : ndarray (2,), [m/s^2]
        Of all beads between contacts: their flights are straight for an observer that falls.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    errors: NDArray[np.float64]
    ends: NDArray[np.int64]
    flight_starts: NDArray[np.int64]
    previous_starts: NDArray[np.int64]
    free_starts: NDArray[np.int64]
    drags: NDArray[np.float64]
    acceleration: NDArray[np.float64]

    @classmethod
    def empty(cls, slots: int) -> TrackBuffer:
        """Allocate an empty buffer, without drag."""
        return cls(
            np.empty((slots, _CAPACITY)),
            np.empty((slots, _CAPACITY, 2)),
            np.empty((slots, _CAPACITY)),
            ends=np.zeros(slots, dtype=np.int64),
            flight_starts=np.zeros(slots, dtype=np.int64),
            previous_starts=np.zeros(slots, dtype=np.int64),
            free_starts=np.zeros(slots, dtype=np.int64),
            drags=np.zeros(slots),
            acceleration=np.zeros(2),
        )

    def doubled(self) -> TrackBuffer:
        """Return a copy with twice as many slots."""
        columns = [np.concatenate([column, np.zeros_like(column)]) for column in self]
        return TrackBuffer(*columns)._replace(acceleration=self.acceleration)


@compiled
def reset_slot(buffer: TrackBuffer, slot: int) -> None:
    """Empty a slot."""
    buffer.ends[slot] = buffer.flight_starts[slot] = buffer.free_starts[slot] = 0
    buffer.previous_starts[slot] = -1


@compiled
def append_position(
    buffer: TrackBuffer, slot: int, time: float, position: NDArray[np.float64], error: float
) -> None:
    """Append a position to the track in a slot."""
    if buffer.ends[slot] == _CAPACITY:
        _discard_oldest(buffer, slot)
    end = buffer.ends[slot]
    buffer.times[slot, end], buffer.errors[slot, end] = time, error
    buffer.positions[slot, end] = position
    buffer.ends[slot] += 1


@compiled
def _discard_oldest(buffer: TrackBuffer, slot: int) -> None:
    start, end = buffer.flight_starts[slot], buffer.ends[slot]
    previous, free = buffer.previous_starts[slot], buffer.free_starts[slot]
    first_kept = max(previous if previous >= 0 else start, start - MAX_FLIGHT_POINTS)
    first_kept = min(first_kept, free)
    kept = end - first_kept
    for k in range(kept):
        buffer.times[slot, k] = buffer.times[slot, first_kept + k]
        buffer.errors[slot, k] = buffer.errors[slot, first_kept + k]
        buffer.positions[slot, k] = buffer.positions[slot, first_kept + k]
    buffer.flight_starts[slot], buffer.ends[slot] = start - first_kept, kept
    buffer.free_starts[slot] = free - first_kept
    buffer.previous_starts[slot] = max(previous - first_kept, 0) if previous >= 0 else -1
