"""Velocity jumps that wait for the jump of the collision partner.

Tested by ``test/stages/contacts/test_contact_finder.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.contacts.pair_tests import MAX_SIGMAS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.contacts.flight_segments import VelocityJump
    from nanorocks_ros.stages.contacts.line_fits import Intersection

# Tolerance of the distance of two beads in a first test, over the sum of their radii.
_DISTANCE_TOLERANCE = 0.3
# Columns: time of the jump, its error, tolerance of the time of a partner, radius, and of the
# flight before: time, position and velocity.
_COLUMNS = 9


class UnmatchedJumps:
    """Jumps without a partner, with a table of numbers for a first test."""

    def __init__(self) -> None:
        self._jumps: list[VelocityJump] = []
        self._table = np.empty((0, _COLUMNS))
        self._earliest = math.inf

    def drop_before(self, horizon: float) -> None:
        """Remove jumps at or before a time, [s]."""
        if self._earliest <= horizon:
            self._select(self._table[:, 0] > horizon)

    def _select(self, kept: NDArray[np.bool_]) -> None:
        self._jumps = [self._jumps[k] for k in np.flatnonzero(kept).tolist()]
        self._table = self._table[kept]
        self._earliest = float(self._table[:, 0].min(initial=math.inf))

    def add(self, jump: VelocityJump, crossing: Intersection, interval: float) -> None:
        """Add a jump; `interval` is the time between two frames, [s]."""
        self._jumps.append(jump)
        row = _row(jump, crossing)
        row[2] += interval
        self._earliest = min(self._earliest, crossing.time)
        self._table = np.concatenate([self._table, row[None]])

    def remove(self, jump: VelocityJump) -> None:
        """Remove a jump whose partner was found."""
        self._select(np.array([other is not jump for other in self._jumps], dtype=np.bool_))

    def candidates(
        self, jump: VelocityJump, crossing: Intersection, interval: float
    ) -> list[VelocityJump]:
        """Jumps at the same time, about one sum of radii away; the oldest first.

        Parameters
        ----------
        jump : VelocityJump
        crossing : Intersection
            Of the flights of `jump`.
        interval : float, [s]
            Time between two frames.
        """
        return [
            self._jumps[k]
            for k in _candidate_rows(self._table, _row(jump, crossing), interval).tolist()
        ]


def _row(jump: VelocityJump, crossing: Intersection) -> NDArray[np.float64]:
    slack = MAX_SIGMAS * crossing.error
    return np.array(
        [crossing.time, crossing.error, slack, jump.radius, *jump.lines[0, :5].tolist()]
    )


@compiled
def _candidate_rows(
    table: NDArray[np.float64], new: NDArray[np.float64], interval: float
) -> NDArray[np.int64]:
    rows, count = np.empty(table.shape[0], dtype=np.int64), 0
    time = new[0]
    for k in range(table.shape[0]):
        # Hundreds wait: the cheapest test comes first.
        interval_apart = abs(table[k, 0] - time)
        if not interval_apart < new[2] + table[k, 2]:
            continue
        dt_row, dt_new = time - table[k, 4], time - new[4]
        x = new[5] + new[7] * dt_new - table[k, 5] - table[k, 7] * dt_row
        y = new[6] + new[8] * dt_new - table[k, 6] - table[k, 8] * dt_row
        distance = math.sqrt(x * x + y * y)
        reach = table[k, 3] + new[3]
        if (
            not (1.0 - _DISTANCE_TOLERANCE) * reach
            < distance
            < (1.0 + _DISTANCE_TOLERANCE) * reach
        ):
            continue
        error = math.sqrt(new[1] * new[1] + table[k, 1] * table[k, 1])
        if interval_apart < interval + MAX_SIGMAS * error:
            rows[count] = k
            count += 1
    return rows[:count]
