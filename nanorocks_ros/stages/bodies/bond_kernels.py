"""Compiled table of bead pairs: which beads may touch, and how their separations change."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.bodies.touching_pairs import SHIFT, SeenBeads, touching_pairs

# Half of the range of each component of the separation of bonded beads, in its errors.
_TOLERANCE_SIGMAS = 3.0
# Largest deviation of the separation of a bond before it counts as broken, in tolerances.
_BREAK_TOLERANCES = 2.0
# A track may jump to another bead of the cluster. The bond is kept if the new separation stays in
# range for this time, [s], within this distance in sums of radii.
_JUMP_TIME, _JUMP_DISTANCE = 0.3, 2.5
# Time constants, [s]: of smoothed separations, and of the offset of a bond that slowly rotates.
_SMOOTHING_TIMES = np.array([0.1, 2.0])
# A pair of which one bead is hidden is kept for this time, [s].
_MAX_HIDDEN_TIME = 1.5
# A pair may look apart for this time, [s]: a misplaced outline in two or three images.
_MAX_APART_TIME = 0.1
# A bonded pair of which one bead is hidden is kept for this time, [s].
_MAX_HIDDEN_BOND_TIME = 60.0
SMOOTHED, LOW, HIGH, OFFSET = 0, 2, 4, 6
"""First columns of `PairTable.values`: separations with two components each."""

TOLERANCE, SPEED, PATH, START, LAST, LAST_TOGETHER = range(8, 14)
"""Further columns of `PairTable.values`."""

DISTANCE, NEAREST, FARTHEST, TURNING_PATH, MET, LAST_TOUCHING = range(14, 20)
"""Columns of a pair that may turn: its smoothed distance, the range of it, the path of free beads
and the time since the beads met, and the last time at which they touched in the image."""

SMALLER_RADIUS, DEFLECTED = 20, 21
"""Columns for the collisions of a pair; see `CollisionRate`."""

COLLISION_PATH = 22
"""Column of the path since the last restart, at the speed of the gas at each time."""

PATH_BEFORE = 23
"""Column of the path of free beads from when the pair met to the last restart."""

_COLUMNS = 24


class PairTable(NamedTuple):
    """Tracked pairs of beads, sorted by key.

    Parameters
    ----------
    keys : ndarray of int64, (n,)
        Numbers of both beads; the lower number is shifted by `SHIFT` bits.
    values : ndarray (n, columns)
    bonded : ndarray of bool, (n,)
        Whether the two beads are one body.
    """

    keys: NDArray[np.int64]
    values: NDArray[np.float64]
    bonded: NDArray[np.bool_]

    @classmethod
    def empty(cls, rows: int = 0) -> PairTable:
        """Allocate a table of so many rows, set to zero."""
        return cls(
            np.empty(rows, dtype=np.int64),
            np.zeros((rows, _COLUMNS)),
            np.zeros(rows, dtype=np.bool_),
        )


def update_pairs(table: PairTable, time: float, frame_step: float, beads: SeenBeads) -> PairTable:
    """Update all pairs with the next frame, and add those that touch now.

    Parameters
    ----------
    table : PairTable
        Its values are changed.
    time : float, [s]
    frame_step : float, [s]
        Time since the last frame.
    beads : SeenBeads
    """
    since = time - table.values[:, LAST]
    weights = -np.expm1(-since[:, None] / _SMOOTHING_TIMES)
    return PairTable(*_update_pairs(table, time, frame_step, beads, weights))


@compiled
def _update_pairs(
    table: PairTable,
    time: float,
    frame_step: float,
    beads: SeenBeads,
    weights: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]]:
    """Fields of the new table."""
    keys, first, second = touching_pairs(beads)
    rows = table.keys.size
    new = PairTable(
        np.empty(rows + keys.size, dtype=np.int64),
        np.zeros((rows + keys.size, _COLUMNS)),
        np.zeros(rows + keys.size, dtype=np.bool_),
    )
    count, row, pair = 0, 0, 0
    # Merge two lists sorted by key.
    while row < rows or pair < keys.size:
        if row == rows or (pair < keys.size and keys[pair] < table.keys[row]):
            _start_pair(new, count, time, beads, (keys[pair], first[pair], second[pair]))
            pair += 1
            count += 1
            continue
        touches = pair < keys.size and keys[pair] == table.keys[row]
        both_seen = _update_pair(table, row, time, frame_step, beads, weights[row], touches)
        pair += touches
        elapsed = time - table.values[row, LAST]
        waits = elapsed < _MAX_HIDDEN_TIME if not both_seen else False
        waits |= time - table.values[row, LAST_TOUCHING] < _MAX_APART_TIME
        if touches or waits or (table.bonded[row] and elapsed < _MAX_HIDDEN_BOND_TIME):
            new.keys[count], new.bonded[count] = table.keys[row], table.bonded[row]
            new.values[count] = table.values[row]
            count += 1
        row += 1
    return new.keys[:count], new.values[:count], new.bonded[:count]


@compiled
def _row_of(ids: NDArray[np.int64], number: int) -> int:
    """Row of a bead number, or -1."""
    k = int(np.searchsorted(ids, number))
    return k if k < ids.size and ids[k] == number else -1


@compiled
def _combined_error(errors: NDArray[np.float64], i: int, j: int) -> float:
    return math.sqrt(errors[i] * errors[i] + errors[j] * errors[j])


@compiled
def _update_pair(
    table: PairTable,
    k: int,
    time: float,
    frame_step: float,
    beads: SeenBeads,
    weights: NDArray[np.float64],
    touches: bool,
) -> bool:
    """Update a pair with the next frame; whether both beads are seen in it."""
    i = _row_of(beads.ids, table.keys[k] >> SHIFT)
    j = _row_of(beads.ids, table.keys[k] & ((1 << SHIFT) - 1))
    if i < 0 or j < 0:
        return False
    row = table.values[k]
    # While one bead was hidden, they may have parted and met again.
    step = min(time - row[LAST], frame_step)
    row[TOLERANCE] = _TOLERANCE_SIGMAS * _combined_error(beads.errors, i, j)
    # A free pair keeps the speed it met with, though the gas cools as other beads stick.
    free_speed = math.sqrt(beads.variances[i] + beads.variances[j])
    row[SPEED] = max(row[SPEED], free_speed)
    row[PATH] += row[SPEED] * step
    row[COLLISION_PATH] += free_speed * step
    row[LAST] = time
    row[TURNING_PATH] += free_speed * step
    _update_distance(row, beads, i, j, weights[0])
    if touches:
        row[LAST_TOUCHING] = time
    out_of_range = False
    for c in range(2):
        separation = beads.positions[j, c] - beads.positions[i, c]
        row[SMOOTHED + c] += (separation - row[SMOOTHED + c]) * weights[0]
        row[LOW + c] = min(row[LOW + c], row[SMOOTHED + c])
        row[HIGH + c] = max(row[HIGH + c], row[SMOOTHED + c])
        out_of_range |= row[HIGH + c] - row[LOW + c] > 2.0 * row[TOLERANCE]
    if out_of_range and not table.bonded[k]:
        for c in range(2):
            row[SMOOTHED + c] = beads.positions[j, c] - beads.positions[i, c]
        restart_pair(row, time)
        row[SPEED] = free_speed
    if _keeps_separation(row, table.bonded[k], time, beads, i, j):
        row[LAST_TOGETHER] = time
        for c in range(2):
            separation = beads.positions[j, c] - beads.positions[i, c]
            row[OFFSET + c] += (separation - row[OFFSET + c]) * weights[1]
    elif touches and table.bonded[k]:
        # The body turns.
        row[LAST_TOGETHER] = row[START] = time
        for c in range(2):
            separation = beads.positions[j, c] - beads.positions[i, c]
            row[SMOOTHED + c] = row[LOW + c] = row[HIGH + c] = row[OFFSET + c] = separation
    return True


@compiled
def _update_distance(
    row: NDArray[np.float64], beads: SeenBeads, i: int, j: int, weight: float
) -> None:
    """Update the smoothed distance of a pair and its range."""
    x = beads.positions[j, 0] - beads.positions[i, 0]
    y = beads.positions[j, 1] - beads.positions[i, 1]
    row[DISTANCE] += (math.sqrt(x * x + y * y) - row[DISTANCE]) * weight
    row[NEAREST] = min(row[NEAREST], row[DISTANCE])
    row[FARTHEST] = max(row[FARTHEST], row[DISTANCE])


@compiled
def _keeps_separation(
    row: NDArray[np.float64], bonded: bool, time: float, beads: SeenBeads, i: int, j: int
) -> bool:
    """Whether a pair keeps its separation, or a steady one since a track jumped."""
    deviation, out_of_range = 0.0, False
    for c in range(2):
        deviation = max(deviation, abs(row[SMOOTHED + c] - row[OFFSET + c]))
        out_of_range |= row[HIGH + c] - row[LOW + c] > 2.0 * row[TOLERANCE]
    is_close = bool(deviation < _BREAK_TOLERANCES * row[TOLERANCE])
    if not bonded:
        return is_close
    if is_close or out_of_range:
        for c in range(2):
            if not is_close:
                row[SMOOTHED + c] = beads.positions[j, c] - beads.positions[i, c]
            row[LOW + c] = row[HIGH + c] = row[SMOOTHED + c]
        row[START] = time
        return is_close
    distance = math.hypot(row[SMOOTHED], row[SMOOTHED + 1])
    near = distance < _JUMP_DISTANCE * (beads.radii[i] + beads.radii[j])
    if near and time - row[START] >= _JUMP_TIME:
        for c in range(2):
            row[OFFSET + c] = row[SMOOTHED + c]
        return True
    return False


def add_bonds(
    table: PairTable, time: float, beads: SeenBeads, pairs: NDArray[np.int64]
) -> PairTable:
    """Add pairs of visible beads, (n, 2), as bonds."""
    keys = (pairs[:, 0] << SHIFT) | pairs[:, 1]
    is_new = ~np.isin(keys, table.keys)
    new = PairTable.empty(int(np.count_nonzero(is_new)))
    rows = np.searchsorted(beads.ids, pairs[is_new])
    for k, (key, (i, j)) in enumerate(zip(keys[is_new].tolist(), rows.tolist(), strict=True)):
        _start_pair(new, k, time, beads, (key, i, j))
    columns = [np.concatenate(column) for column in zip(table, new, strict=True)]
    order = np.argsort(columns[0], kind='stable')
    joined = PairTable(*(column[order] for column in columns))
    is_bond = np.isin(joined.keys, keys)
    joined.bonded[is_bond] = True
    joined.values[is_bond, LAST_TOGETHER] = time
    joined.values[is_bond, OFFSET : OFFSET + 2] = joined.values[is_bond, SMOOTHED : SMOOTHED + 2]
    return joined


@compiled
def restart_pair(row: NDArray[np.float64], time: float) -> None:
    """Restart the statistics of a pair at its smoothed separation."""
    for c in range(2):
        row[LOW + c] = row[HIGH + c] = row[OFFSET + c] = row[SMOOTHED + c]
    row[PATH], row[COLLISION_PATH], row[START], row[LAST_TOGETHER] = 0.0, 0.0, time, time
    row[PATH_BEFORE] = row[TURNING_PATH]


@compiled
def _start_pair(
    table: PairTable, k: int, time: float, beads: SeenBeads, pair: tuple[int, int, int]
) -> None:
    key, i, j = pair
    row = table.values[k]
    table.keys[k] = key
    for c in range(2):
        row[SMOOTHED + c] = beads.positions[j, c] - beads.positions[i, c]
    restart_pair(row, time)
    distance = math.sqrt(row[SMOOTHED] * row[SMOOTHED] + row[SMOOTHED + 1] * row[SMOOTHED + 1])
    row[DISTANCE] = row[NEAREST] = row[FARTHEST] = distance
    row[TURNING_PATH], row[PATH_BEFORE], row[MET], row[LAST_TOUCHING] = 0.0, 0.0, time, time
    row[SMALLER_RADIUS] = min(beads.radii[i], beads.radii[j])
    low = min(beads.variances[i], beads.variances[j])
    high = max(beads.variances[i], beads.variances[j])
    row[DEFLECTED] = 1.0 + (low / high if high > 0.0 else 0.0)
    row[TOLERANCE] = _TOLERANCE_SIGMAS * _combined_error(beads.errors, i, j)
    row[SPEED] = math.sqrt(beads.variances[i] + beads.variances[j])
    row[LAST] = time
