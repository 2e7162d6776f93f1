"""Pairs of beads beside each other in the picture, and for how long their separation stays."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.bodies.bond_kernels import (
    HIGH,
    LAST,
    LOW,
    OFFSET,
    SHIFT,
    START,
    STAYED,
    TOLERANCE,
    WAY,
    Beads,
    PairTable,
    adopted,
    advanced,
    restart,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

# Jitter alone makes it this part of that.
_LEAST_RANGE = 0.25
# Beads of a body are apart so long before it is called broken, [s].
_BROKEN_TIME = 0.7
# No body is younger, [s].
_YOUNGEST = 0.3


class Bond(NamedTuple):
    """Two beads that are one body.

    Parameters
    ----------
    ids : tuple of 2 int
    start : float, [s]
        Since when they stay beside each other.
    offset : tuple of 2 floats, [m]
        From the first centre to the second.
    tolerance : float, [m]
    """

    ids: tuple[int, int]
    start: float
    offset: tuple[float, float]
    tolerance: float


class Pairs:
    """Follows all pairs of beads that touch in the picture.

    Parameters
    ----------
    chance : callable
        Of ways (n,) and ranges (n,), the chance that free beads do the same.
    """

    def __init__(
        self,
        chance: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]],
    ) -> None:
        self._chance = chance
        self.clear()

    def clear(self) -> None:
        """Forget all pairs."""
        self._table = PairTable.empty()

    def push(
        self, time: float, beads: Beads, largest: float
    ) -> tuple[list[Bond], list[tuple[int, int]]]:
        """Take the beads of the next picture.

        Parameters
        ----------
        time : float, [s]
        beads : Beads
        largest : float
            Pairs are a body when the chance that free beads do the same is lower.

        Returns
        -------
        bonds : list of Bond
            New ones.
        broken : list of (int, int)
            Bodies that are none any more.
        """
        self._table = advanced(self._table, time, beads)
        return self._bonds(time, largest), self._fallen(time)

    def adopt(self, time: float, beads: Beads, bonds: list[Bond]) -> None:
        """Follow pairs that are bodies for other reasons, until they come apart."""
        if bonds:
            pairs = np.array([bond.ids for bond in bonds], dtype=np.int64)
            self._table = adopted(self._table, time, beads, pairs)

    def pending(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Pairs that may yet turn out to be bodies, (n, 2), and the chance that free beads do so.

        Only those that stay long enough for it to be improbable.
        """
        free = ~self._table.bonded
        chances = self._chances(self._table.numbers[free])
        some = chances < 0.1
        keys = self._table.keys[free][some]
        return np.column_stack([keys >> SHIFT, keys & ((1 << SHIFT) - 1)]), chances[some]

    def _chances(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        ranges = 0.5 * (rows[:, HIGH : HIGH + 2] - rows[:, LOW : LOW + 2]).max(axis=1)
        return self._chance(rows[:, WAY], np.maximum(ranges, _LEAST_RANGE * rows[:, TOLERANCE]))

    def _bonds(self, time: float, largest: float) -> list[Bond]:
        keys, numbers, bonded = self._table
        # Few stay beside each other for so long.
        old = _free_for(numbers, bonded, time, _YOUNGEST)
        if not old.size:
            return []
        old = old[self._chances(numbers[old]) < largest]
        bonds = []
        for k in old.tolist():
            row = numbers[k]
            bonded[k], row[STAYED] = True, time
            row[OFFSET : OFFSET + 2] = 0.5 * (row[LOW : LOW + 2] + row[HIGH : HIGH + 2])
            offset = (float(row[OFFSET]), float(row[OFFSET + 1]))
            bonds.append(Bond(_ids(keys[k]), float(row[START]), offset, float(row[TOLERANCE])))
        return bonds

    def _fallen(self, time: float) -> list[tuple[int, int]]:
        """Bodies whose beads, both seen, are apart for too long; they are free pairs again."""
        keys, numbers, bonded = self._table
        if not bonded.any():
            return []
        fall = bonded & (numbers[:, LAST] - numbers[:, STAYED] > _BROKEN_TIME)
        for k in np.flatnonzero(fall).tolist():
            bonded[k] = False
            restart(numbers[k], time)
        return [_ids(keys[k]) for k in np.flatnonzero(fall).tolist()]


@compiled
def _free_for(
    numbers: NDArray[np.float64], bonded: NDArray[np.bool_], time: float, least: float
) -> NDArray[np.int64]:
    """Rows of pairs that are no bodies and have been followed for so long, [s]."""
    found, count = np.empty(bonded.size, dtype=np.int64), 0
    for k in range(bonded.size):
        if not bonded[k] and time - numbers[k, START] >= least:
            found[count] = k
            count += 1
    return found[:count]


def _ids(key: int) -> tuple[int, int]:
    return int(key) >> SHIFT, int(key) & ((1 << SHIFT) - 1)
