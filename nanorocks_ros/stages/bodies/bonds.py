"""Bonds: pairs of beads whose separation stays constant for longer than chance allows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.inference.sticking.chance_proximity import (
    chance_probability,
    turning_chance_probability,
)
from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.bodies.bond_kernels import (
    COLLISION_PATH,
    DEFLECTED,
    FARTHEST,
    HIGH,
    LAST,
    LAST_TOGETHER,
    LOW,
    MET,
    NEAREST,
    OFFSET,
    PATH,
    PATH_BEFORE,
    SMALLER_RADIUS,
    SMOOTHED,
    START,
    TOLERANCE,
    TURNING_PATH,
    PairTable,
    add_bonds,
    restart_pair,
    update_pairs,
)
from nanorocks_ros.stages.bodies.touching_pairs import SHIFT, SeenBeads

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

# Smallest range of a separation, in tolerances: what position noise alone makes.
_MIN_RANGE = 0.25
# Time for which bonded beads must be apart before the bond counts as broken, [s].
_BREAK_TIME = 0.7
# Smallest age of a bond, [s].
_MIN_AGE = 0.3


class Bond(NamedTuple):
    """Two beads that are one body.

    Parameters
    ----------
    ids : tuple of 2 int
    start : float, [s]
        Time since which the separation is constant.
    offset : tuple of 2 floats, [m]
        From the first centre to the second.
    tolerance : float, [m]
    met : float, [s]
        Time since which they are beside each other; infinite where it is not known to be earlier.
    met_chance : float, 0 to 1
        Probability that free beads were beside each other from `met` to `start`.
    """

    ids: tuple[int, int]
    start: float
    offset: tuple[float, float]
    tolerance: float
    met: float = math.inf
    met_chance: float = 1.0


class BondFinder:
    """Tracks all pairs of beads that touch in the image and finds bonds among them.

    Parameters
    ----------
    rate : float, [1/m]
        Encounters that part a pair, per path, from `parting_rate`.
    collision_rate : callable
        Collisions of pairs per path: a `CollisionRate`.
    parting : float
        Share of these that part a pair: `parting_share`.
    """

    def __init__(
        self,
        rate: float,
        collision_rate: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]],
        parting: float,
    ) -> None:
        self._rate = rate
        self._collision_rate = collision_rate
        self._parting = parting
        self.clear()

    def clear(self) -> None:
        """Forget all pairs."""
        self._table = PairTable.empty()
        self._last_time = 0.0

    def push(
        self, time: float, beads: SeenBeads, max_chance: float
    ) -> tuple[list[Bond], list[tuple[int, int]]]:
        """Add the beads of the next frame.

        Parameters
        ----------
        time : float, [s]
        beads : SeenBeads
        max_chance : float
            A pair is a bond if the probability that free beads do the same is lower.

        Returns
        -------
        bonds : list of Bond
            New bonds.
        broken : list of (int, int)
            Bonds that broke.
        """
        frame_step, self._last_time = time - self._last_time, time
        self._table = update_pairs(self._table, time, frame_step, beads)
        return self._new_bonds(time, max_chance), self._broken_bonds(time)

    def add_bonds(self, time: float, beads: SeenBeads, bonds: list[Bond]) -> None:
        """Add bonds that were found elsewhere; they are tracked until they break."""
        if bonds:
            pairs = np.array([bond.ids for bond in bonds], dtype=np.int64)
            self._table = add_bonds(self._table, time, beads, pairs)

    def unconfirmed(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Pairs that may become bonds, (n, 2), and the probability that free beads do the same.

        Only pairs with a probability below 0.1.
        """
        free = ~self._table.bonded
        chances = self._chances(self._table.values[free])
        is_unlikely = chances < 0.1
        keys = self._table.keys[free][is_unlikely]
        return np.column_stack([keys >> SHIFT, keys & ((1 << SHIFT) - 1)]), chances[is_unlikely]

    def _chances(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.minimum(self._fixed_chances(rows), self._turning_chances(rows))

    def _fixed_chances(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Probabilities that free beads keep their separation."""
        ranges = 0.5 * (rows[:, HIGH : HIGH + 2] - rows[:, LOW : LOW + 2]).max(axis=1)
        ranges = np.maximum(ranges, _MIN_RANGE * rows[:, TOLERANCE])
        return chance_probability(rows[:, PATH], ranges, self._rate, rows[:, COLLISION_PATH])

    def _turning_chances(
        self, rows: NDArray[np.float64], path: int = TURNING_PATH
    ) -> NDArray[np.float64]:
        """Probabilities that free beads keep their distance within the range that was seen."""
        least = 2.0 * _MIN_RANGE * rows[:, TOLERANCE]
        farthest = np.maximum(rows[:, FARTHEST], rows[:, NEAREST] + least)
        return turning_chance_probability(
            rows[:, path],
            rows[:, NEAREST],
            farthest,
            self._parting * self._collision_rate(rows[:, SMALLER_RADIUS], rows[:, DEFLECTED]),
        )

    def _new_bonds(self, time: float, max_chance: float) -> list[Bond]:
        keys, values, bonded = self._table
        # Few pairs are that old.
        rows = _unbonded_since(values, bonded, time, _MIN_AGE)
        if not rows.size:
            return []
        chances = self._fixed_chances(values[rows])
        is_fixed = (chances < max_chance) & (time - values[rows, START] >= _MIN_AGE)
        is_bond = is_fixed | (self._turning_chances(values[rows]) < max_chance)
        rows, is_fixed = rows[is_bond], is_fixed[is_bond]
        before = self._turning_chances(values[rows], PATH_BEFORE)
        bonds = []
        for k, fixed, chance in zip(
            rows.tolist(), is_fixed.tolist(), before.tolist(), strict=True
        ):
            row = values[k]
            bonded[k], row[LAST_TOGETHER] = True, time
            row[OFFSET : OFFSET + 2] = (
                0.5 * (row[LOW : LOW + 2] + row[HIGH : HIGH + 2])
                if fixed
                else row[SMOOTHED : SMOOTHED + 2]
            )
            offset = (float(row[OFFSET]), float(row[OFFSET + 1]))
            met = float(row[MET])
            start, chance = (float(row[START]), chance) if fixed else (met, 0.0)
            tolerance = float(row[TOLERANCE])
            bonds.append(Bond(_ids_of(keys[k]), start, offset, tolerance, met, chance))
        return bonds

    def _broken_bonds(self, time: float) -> list[tuple[int, int]]:
        """Bonds whose beads are seen apart for too long; they become free pairs."""
        keys, values, bonded = self._table
        if not bonded.any():
            return []
        is_broken = bonded & (values[:, LAST] - values[:, LAST_TOGETHER] > _BREAK_TIME)
        for k in np.flatnonzero(is_broken).tolist():
            bonded[k] = False
            restart_pair(values[k], time)
        return [_ids_of(keys[k]) for k in np.flatnonzero(is_broken).tolist()]


@compiled
def _unbonded_since(
    values: NDArray[np.float64], bonded: NDArray[np.bool_], time: float, min_age: float
) -> NDArray[np.int64]:
    """Rows of pairs that are no bonds and met at least `min_age` ago, [s]."""
    rows, count = np.empty(bonded.size, dtype=np.int64), 0
    for k in range(bonded.size):
        if not bonded[k] and time - values[k, MET] >= min_age:
            rows[count] = k
            count += 1
    return rows[:count]


def _ids_of(key: int) -> tuple[int, int]:
    return int(key) >> SHIFT, int(key) & ((1 << SHIFT) - 1)
