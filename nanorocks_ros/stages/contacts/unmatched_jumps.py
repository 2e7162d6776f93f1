"""Turns of beads whose partner in the collision is not known yet."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.contacts.pair_tests import FAR

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.contacts.flight_segments import Kink
    from nanorocks_ros.stages.contacts.line_fits import Meeting

# How close or far two beads are at a quick look, over the sum of their radii.
_ABOUT = 0.3
# Of each: when it turned and the error of that, by how much more or less another may have turned
# at the same time, its radius, and of its flight before: time, place and velocity.
_NUMBERS = 9


class Waiting:
    """Turns whose other bead has not turned yet, with plain numbers for a quick look."""

    def __init__(self) -> None:
        self._kinks: list[Kink] = []
        self._table = np.empty((0, _NUMBERS))
        self._earliest = math.inf

    def forget(self, horizon: float) -> None:
        """Give up those before a time, [s]."""
        if self._earliest <= horizon:
            self._keep(self._table[:, 0] > horizon)

    def _keep(self, which: NDArray[np.bool_]) -> None:
        self._kinks = [self._kinks[k] for k in np.flatnonzero(which).tolist()]
        self._table = self._table[which]
        self._earliest = float(self._table[:, 0].min(initial=math.inf))

    def add(self, kink: Kink, when: Meeting, interval: float) -> None:
        """Wait for the other bead of a turn; pictures are that far apart, [s]."""
        self._kinks.append(kink)
        row = _row(kink, when)
        row[2] += interval
        self._earliest = min(self._earliest, when.time)
        self._table = np.concatenate([self._table, row[None]])

    def remove(self, kink: Kink) -> None:
        """Its other bead was found."""
        self._keep(np.array([one is not kink for one in self._kinks], dtype=np.bool_))

    def partners(self, kink: Kink, when: Meeting, interval: float) -> list[Kink]:
        """Those that turned at the same time about a diameter away, those first that wait longest.

        Parameters
        ----------
        kink : Kink
        when : Meeting
            Of its flights.
        interval : float, [s]
            Between two pictures.
        """
        return [self._kinks[k] for k in _near(self._table, _row(kink, when), interval).tolist()]


def _row(kink: Kink, when: Meeting) -> NDArray[np.float64]:
    slack = FAR * when.error
    return np.array([when.time, when.error, slack, kink.radius, *kink.lines[0, :5].tolist()])


@compiled
def _near(
    table: NDArray[np.float64], this: NDArray[np.float64], interval: float
) -> NDArray[np.int64]:
    found, count = np.empty(table.shape[0], dtype=np.int64), 0
    time = this[0]
    for k in range(table.shape[0]):
        # Hundreds wait: a quick look at each.
        apart = abs(table[k, 0] - time)
        if not apart < this[2] + table[k, 2]:
            continue
        since, its_since = time - table[k, 4], time - this[4]
        x = this[5] + this[7] * its_since - table[k, 5] - table[k, 7] * since
        y = this[6] + this[8] * its_since - table[k, 6] - table[k, 8] * since
        distance = math.sqrt(x * x + y * y)
        reach = table[k, 3] + this[3]
        if not (1.0 - _ABOUT) * reach < distance < (1.0 + _ABOUT) * reach:
            continue
        error = math.sqrt(this[1] * this[1] + table[k, 1] * table[k, 1])
        if apart < interval + FAR * error:
            found[count] = k
            count += 1
    return found[:count]
