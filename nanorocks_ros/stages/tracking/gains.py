"""What a disc would explain of a picture, for every place and size it may have."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.physics.compiled import compiled
from nanorocks_ros.stages.tracking.pixels import FLOOR, Picture

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Search(NamedTuple):
    """How one species is looked for.

    Parameters
    ----------
    kind : int
        RED, BLUE or GRAY.
    hue_sign : float
        1, -1 or 0 for these.
    radii : ndarray (k,), [px]
        Sizes to try, rising.
    expected : ndarray (2,), [px]
        Radius and its spread.
    step : int, [px]
        Side of the squares in which places are tried.
    most : int
        Beads to look for.
    floor_weight : int
        Of a pixel of floor under a disc, against one of the species.
    least_share : float
        Of its disc that a bead must show.
    """

    kind: int
    hue_sign: float
    radii: NDArray[np.float64]
    expected: NDArray[np.float64]
    step: int
    most: int
    floor_weight: int
    least_share: float


class Gains(NamedTuple):
    """What discs would explain; squares of `Search.step` pixels a side.

    Parameters
    ----------
    balance : ndarray of int32, (rows, columns)
        Pixels of the species, not yet explained, less the weighted ones of the floor.
    sums : ndarray of int32, (rows, columns + 1)
        Of the balance along the rows, up to each column.
    values : ndarray of int32, (sizes, rows, columns)
        For a disc of a size centred on a square; 0 where it is not worth while.
    tops, places : ndarrays of int32, (sizes, rows)
        The largest value of each row, and its column.
    """

    balance: NDArray[np.int32]
    sums: NDArray[np.int32]
    values: NDArray[np.int32]
    tops: NDArray[np.int32]
    places: NDArray[np.int32]


@compiled
def balance_of(picture: Picture, search: Search) -> NDArray[np.int32]:
    """Pixels of the species, not yet explained, less those of the floor, in squares."""
    height, width = picture.shown.shape
    step = search.step
    rows, columns = (height + step - 1) // step, (width + step - 1) // step
    found = np.zeros((rows, columns), dtype=np.int32)
    # The rows of a square are summed first: that goes many columns at once.
    sums = np.zeros(columns * step, dtype=np.int16)
    kind, own = np.uint8(search.kind), np.uint8(1 << search.kind)
    weight, floor = np.int16(search.floor_weight), np.uint8(FLOOR)
    for row in range(rows):
        sums[:] = 0
        for i in range(row * step, min((row + 1) * step, height)):
            shown, covered = picture.shown[i], picture.covered[i]
            for j in range(width):
                bead = np.int16((shown[j] == kind) & (covered[j] & own == 0))
                sums[j] += bead - weight * np.int16(shown[j] == floor)
        for column in range(columns):
            total = np.int32(0)
            for j in range(column * step, (column + 1) * step):
                total += sums[j]
            found[row, column] = total
    return found


@compiled
def least_gain(search: Search, size: int) -> float:
    """Pixels that a bead of a size must show."""
    return float(search.least_share * np.pi * search.radii[size] * search.radii[size])


@compiled
def _widths(radius: float) -> NDArray[np.int64]:
    """Half widths of the rows of a disc, in squares."""
    reach = int(radius)
    found = np.empty(2 * reach + 1, dtype=np.int64)
    for k in range(-reach, reach + 1):
        found[k + reach] = int(math.sqrt(max(radius * radius - k * k, 0.0)))
    return found


@compiled
def _sum_row(balance: NDArray[np.int32], sums: NDArray[np.int32], i: int) -> None:
    for j in range(balance.shape[1]):
        sums[i, j + 1] = sums[i, j] + balance[i, j]


@compiled
def _gain(sums: NDArray[np.int32], i: int, j: int, widths: NDArray[np.int64]) -> int:
    """Balance of a disc that is centred on a square."""
    reach = (widths.size - 1) // 2
    last = sums.shape[1] - 2
    total = 0
    for k in range(max(-reach, -i), min(reach, sums.shape[0] - 1 - i) + 1):
        width = widths[k + reach]
        total += sums[i + k, min(j + width, last) + 1] - sums[i + k, max(j - width, 0)]
    return total


@compiled
def _surplus_table(balance: NDArray[np.int32]) -> NDArray[np.int32]:
    """Sums of what is left to explain over all rectangles from the corner."""
    table = np.zeros((balance.shape[0] + 1, balance.shape[1] + 1), dtype=np.int32)
    for i in range(balance.shape[0]):
        total = 0
        for j in range(balance.shape[1]):
            total += max(balance[i, j], 0)
            table[i + 1, j + 1] = table[i, j + 1] + total
    return table


@compiled
def first_gains(balance: NDArray[np.int32], search: Search) -> Gains:
    """Gains of all discs that could show enough."""
    rows, columns = balance.shape
    sizes = search.radii.size
    sums = np.zeros((rows, columns + 1), dtype=np.int32)
    values = np.zeros((sizes, rows, columns), dtype=np.int32)
    tops = np.zeros((sizes, rows), dtype=np.int32)
    places = np.zeros((sizes, rows), dtype=np.int32)
    for i in range(rows):
        _sum_row(balance, sums, i)
    table = _surplus_table(balance)
    for size in range(sizes):
        widths = _widths(search.radii[size] / search.step)
        reach = (widths.size - 1) // 2
        for i in range(rows):
            above, below = max(i - reach, 0), min(i + reach + 1, rows)
            for j in range(columns):
                left, right = max(j - reach, 0), min(j + reach + 1, columns)
                # No more than this, so that most places need no closer look.
                limit = table[below, right] - table[above, right]
                limit -= table[below, left] - table[above, left]
                middle_is_floor = 2 * balance[i, j] <= -search.step * search.step
                if limit > least_gain(search, size) and not middle_is_floor:
                    values[size, i, j] = _gain(sums, i, j, widths)
            _find_top(values[size, i], tops[size], places[size], i)
    return Gains(balance, sums, values, tops, places)


@compiled
def _find_top(
    values: NDArray[np.int32], tops: NDArray[np.int32], places: NDArray[np.int32], i: int
) -> None:
    tops[i] = 0
    for j in range(values.size):
        if values[j] > tops[i]:
            tops[i], places[i] = values[j], j


@compiled
def best_disc(gains: Gains, search: Search) -> tuple[int, int, int]:
    """Size, row and column of the disc that explains most; size -1 when none does enough."""
    best, best_size, best_row = 0, -1, 0
    for size in range(search.radii.size):
        least = least_gain(search, size)
        for i in range(gains.tops.shape[1]):
            if gains.tops[size, i] > best and gains.tops[size, i] > least:
                best, best_size, best_row = gains.tops[size, i], size, i
    return best_size, best_row, gains.places[max(best_size, 0), best_row]


@compiled
def renew_gains(
    gains: Gains, search: Search, rows: tuple[int, int], columns: tuple[int, int]
) -> None:
    """Compute gains again in a rectangle of squares, after its balance has fallen."""
    top, bottom = max(rows[0], 0), min(rows[1], gains.balance.shape[0] - 1)
    left, right = max(columns[0], 0), min(columns[1], gains.balance.shape[1] - 1)
    for i in range(top, bottom + 1):
        _sum_row(gains.balance, gains.sums, i)
    for size in range(search.radii.size):
        widths = _widths(search.radii[size] / search.step)
        for i in range(top, bottom + 1):
            for j in range(left, right + 1):
                if gains.values[size, i, j] > 0:
                    gains.values[size, i, j] = _gain(gains.sums, i, j, widths)
            # Gains only fall: a best outside the changed part stays the best.
            if left <= gains.places[size, i] <= right:
                _find_top(gains.values[size, i], gains.tops[size], gains.places[size], i)
