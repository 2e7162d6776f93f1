"""Compiled part of following pairs: which beads may touch, and how their separations change."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.numerics.compiled import compiled

# Sums of radii within which two beads may touch, and errors of both places and radii besides.
_REACH, _REACH_ERRORS = 1.03, 2.0
# What an uneven outline and the light add to the error of a radius, over it.
_OUTLINE = 0.02
# Half of the range in which each component of the separation of a body stays, in errors of it.
_TOLERANCE = 3.0
# Of a body that is known, before it is called broken.
_BROKEN = 2.0
# A track that jumps to a neighbour in its cluster moves on with it: so long, [s], without leaving
# the range of a body, no further than so many sums of radii.
_STEADY, _STEADY_REACH = 0.3, 2.5
# Over which places are smoothed, and the separation of a body follows a slow turn, [s].
_TIMES = np.array([0.1, 2.0])
# Two of which one is not seen are remembered so long, [s].
_HIDDEN = 1.5
# And those of a body, so long, [s].
_FORGOTTEN = 60.0
SHIFT = 32
"""Bits of the number of the second bead in a key."""

SMOOTH, LOW, HIGH, OFFSET, TOLERANCE, SPEED, WAY, START, LAST, STAYED = 0, 2, 4, 6, *range(8, 14)
"""Columns of `PairTable.numbers`; the first four have two each."""

_COLUMNS = 14


class Beads(NamedTuple):
    """Beads seen in one picture.

    Parameters
    ----------
    ids : ndarray of int64, (n,)
        Rising.
    places : ndarray (n, 2), [m]
        Any origin that all share.
    errors, radii, radius_errors : ndarray (n,), [m]
    variances : ndarray (n,), [m^2/s^2]
        Mean square of a component of the velocity of beads of that kind.
    height : float, [m]
        Of the tray.
    """

    ids: NDArray[np.int64]
    places: NDArray[np.float64]
    errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    variances: NDArray[np.float64]
    height: float


class PairTable(NamedTuple):
    """Pairs that are followed, in the order of their keys.

    Parameters
    ----------
    keys : ndarray of int64, (n,)
        Numbers of both beads, the lower one `SHIFT` bits higher.
    numbers : ndarray (n, columns)
    bonded : ndarray of bool, (n,)
        Which are bodies.
    """

    keys: NDArray[np.int64]
    numbers: NDArray[np.float64]
    bonded: NDArray[np.bool_]

    @classmethod
    def empty(cls, rows: int = 0) -> PairTable:
        """Without pairs, or with room for some."""
        return cls(
            np.empty(rows, dtype=np.int64),
            np.zeros((rows, _COLUMNS)),
            np.zeros(rows, dtype=np.bool_),
        )


def advanced(table: PairTable, time: float, beads: Beads) -> PairTable:
    """The pairs after another picture: those that stay, and those that touch now.

    Parameters
    ----------
    table : PairTable
        Its numbers are changed.
    time : float, [s]
    beads : Beads
    """
    since = time - table.numbers[:, LAST]
    shares = -np.expm1(-since[:, None] / _TIMES)
    return _advanced(table, time, beads, shares)


@compiled
def _advanced(
    table: PairTable, time: float, beads: Beads, shares: NDArray[np.float64]
) -> PairTable:
    keys, first, second = touching(beads)
    rows = table.keys.size
    new = PairTable(
        np.empty(rows + keys.size, dtype=np.int64),
        np.zeros((rows + keys.size, _COLUMNS)),
        np.zeros(rows + keys.size, dtype=np.bool_),
    )
    count, k, j = 0, 0, 0
    # Both in the order of their keys.
    while k < rows or j < keys.size:
        if k == rows or (j < keys.size and keys[j] < table.keys[k]):
            _begin(new, count, time, beads, (keys[j], first[j], second[j]))
            j += 1
            count += 1
            continue
        both = _follow(table, k, time, beads, shares[k])
        touches = j < keys.size and keys[j] == table.keys[k]
        j += touches
        ago = time - table.numbers[k, LAST]
        hidden = not both and ago < _HIDDEN
        if touches or hidden or (table.bonded[k] and ago < _FORGOTTEN):
            new.keys[count], new.bonded[count] = table.keys[k], table.bonded[k]
            new.numbers[count] = table.numbers[k]
            count += 1
        k += 1
    return PairTable(new.keys[:count], new.numbers[:count], new.bonded[:count])


@compiled
def _row_of(ids: NDArray[np.int64], number: int) -> int:
    """Where a number is, or -1."""
    k = int(np.searchsorted(ids, number))
    return k if k < ids.size and ids[k] == number else -1


@compiled
def _both(errors: NDArray[np.float64], i: int, j: int) -> float:
    return math.sqrt(errors[i] * errors[i] + errors[j] * errors[j])


@compiled
def _follow(
    table: PairTable, k: int, time: float, beads: Beads, shares: NDArray[np.float64]
) -> bool:
    """The separation of a pair in the next picture; whether both are seen in it."""
    i = _row_of(beads.ids, table.keys[k] >> SHIFT)
    j = _row_of(beads.ids, table.keys[k] & ((1 << SHIFT) - 1))
    if i < 0 or j < 0:
        return False
    now = table.numbers[k]
    step = time - now[LAST]
    now[TOLERANCE] = _TOLERANCE * _both(beads.errors, i, j)
    # Whoever is free flies on as fast as when they met, though all others may stick meanwhile.
    usual = math.sqrt(beads.variances[i] + beads.variances[j])
    now[SPEED] = max(now[SPEED], usual)
    now[WAY] += now[SPEED] * step
    now[LAST] = time
    moved = False
    for c in range(2):
        apart = beads.places[j, c] - beads.places[i, c]
        now[SMOOTH + c] += (apart - now[SMOOTH + c]) * shares[0]
        now[LOW + c] = min(now[LOW + c], now[SMOOTH + c])
        now[HIGH + c] = max(now[HIGH + c], now[SMOOTH + c])
        moved |= now[HIGH + c] - now[LOW + c] > 2.0 * now[TOLERANCE]
    if moved and not table.bonded[k]:
        for c in range(2):
            now[SMOOTH + c] = beads.places[j, c] - beads.places[i, c]
        restart(now, time)
        now[SPEED] = usual
    if _stays(now, table.bonded[k], time, beads, i, j):
        now[STAYED] = time
        for c in range(2):
            apart = beads.places[j, c] - beads.places[i, c]
            now[OFFSET + c] += (apart - now[OFFSET + c]) * shares[1]
    return True


@compiled
def _stays(
    now: NDArray[np.float64], bonded: bool, time: float, beads: Beads, i: int, j: int
) -> bool:
    """Whether a pair is apart as it was, or as it has been since a track jumped."""
    away, moved = 0.0, False
    for c in range(2):
        away = max(away, abs(now[SMOOTH + c] - now[OFFSET + c]))
        moved |= now[HIGH + c] - now[LOW + c] > 2.0 * now[TOLERANCE]
    stays = bool(away < _BROKEN * now[TOLERANCE])
    if not bonded:
        return stays
    if stays or moved:
        for c in range(2):
            if not stays:
                now[SMOOTH + c] = beads.places[j, c] - beads.places[i, c]
            now[LOW + c] = now[HIGH + c] = now[SMOOTH + c]
        now[START] = time
        return stays
    distance = math.hypot(now[SMOOTH], now[SMOOTH + 1])
    near = distance < _STEADY_REACH * (beads.radii[i] + beads.radii[j])
    if near and time - now[START] >= _STEADY:
        for c in range(2):
            now[OFFSET + c] = now[SMOOTH + c]
        return True
    return False


def adopted(table: PairTable, time: float, beads: Beads, pairs: NDArray[np.int64]) -> PairTable:
    """With pairs of beads that are seen, (n, 2), among the bodies."""
    keys = (pairs[:, 0] << SHIFT) | pairs[:, 1]
    fresh = ~np.isin(keys, table.keys)
    new = PairTable.empty(int(np.count_nonzero(fresh)))
    rows = np.searchsorted(beads.ids, pairs[fresh])
    for k, (key, (i, j)) in enumerate(zip(keys[fresh].tolist(), rows.tolist(), strict=True)):
        _begin(new, k, time, beads, (key, i, j))
    both = [np.concatenate(part) for part in zip(table, new, strict=True)]
    order = np.argsort(both[0], kind='stable')
    found = PairTable(*(part[order] for part in both))
    own = np.isin(found.keys, keys)
    found.bonded[own] = True
    found.numbers[own, STAYED] = time
    found.numbers[own, OFFSET : OFFSET + 2] = found.numbers[own, SMOOTH : SMOOTH + 2]
    return found


@compiled
def restart(row: NDArray[np.float64], time: float) -> None:
    """Follow a pair anew from where its beads are now, which its smooth separation says."""
    for c in range(2):
        row[LOW + c] = row[HIGH + c] = row[OFFSET + c] = row[SMOOTH + c]
    row[WAY], row[START], row[STAYED] = 0.0, time, time


@compiled
def _begin(
    table: PairTable, k: int, time: float, beads: Beads, pair: tuple[int, int, int]
) -> None:
    key, i, j = pair
    row = table.numbers[k]
    table.keys[k] = key
    for c in range(2):
        row[SMOOTH + c] = beads.places[j, c] - beads.places[i, c]
    restart(row, time)
    row[TOLERANCE] = _TOLERANCE * _both(beads.errors, i, j)
    row[SPEED] = math.sqrt(beads.variances[i] + beads.variances[j])
    row[LAST] = time


@compiled
def touching(
    beads: Beads,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Keys of the pairs that may touch, and the rows of their beads, each (n,).

    Centres are no further apart in the picture than the radii let them be, and no nearer than
    the height of the tray lets beads be that lie over each other.
    """
    n = beads.ids.size
    variances = np.empty(n)
    widest = 0.0
    for i in range(n):
        error = beads.radius_errors[i]
        outline = _OUTLINE * beads.radii[i] if error > 0.0 else 0.0
        variances[i] = error * error + outline * outline + beads.errors[i] * beads.errors[i]
        widest = max(widest, _REACH * beads.radii[i] + _REACH_ERRORS * math.sqrt(variances[i]))
    # From left to right, so that only those beside a bead are looked at.
    order = np.argsort(beads.places[:, 0].copy())
    keys, first, second = np.empty((3, 4 * n), dtype=np.int64)
    count = 0
    for place in range(n):
        for other in range(place + 1, n):
            i, j = min(order[place], order[other]), max(order[place], order[other])
            x = beads.places[order[other], 0] - beads.places[order[place], 0]
            if x >= 2.0 * widest:
                break
            if not _may_touch(beads, variances, x, i, j):
                continue
            if count == keys.size:
                keys, first, second = _longer(keys), _longer(first), _longer(second)
            keys[count] = (beads.ids[i] << SHIFT) | beads.ids[j]
            first[count], second[count] = i, j
            count += 1
    by_key = np.argsort(keys[:count])
    return keys[by_key], first[by_key], second[by_key]


@compiled
def _longer(values: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate((values, np.empty_like(values)))


@compiled
def _may_touch(
    beads: Beads, variances: NDArray[np.float64], across: float, i: int, j: int
) -> bool:
    """Whether two beads may touch that are so far apart across the picture."""
    down = beads.places[j, 1] - beads.places[i, 1]
    distance = math.sqrt(across * across + down * down)
    radii = beads.radii[i] + beads.radii[j]
    slack = _REACH_ERRORS * math.sqrt(variances[i] + variances[j])
    if distance >= _REACH * radii + slack:
        return False
    above = max(beads.height - radii, 0.0)
    return distance > math.sqrt(max(radii * radii - above * above, 0.0)) / _REACH - slack
