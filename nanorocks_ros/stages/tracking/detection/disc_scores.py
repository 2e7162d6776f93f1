"""What a disc would explain of a picture, for every place and size it may have."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined, kernel
from nanorocks_ros.stages.tracking.detection.pixel_classes import FLOOR, Picture

if TYPE_CHECKING:
    from numpy.typing import NDArray


# Places whose discs are looked at together, along a row.
_BLOCK = 8


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
    widths : ndarray of int32, (sizes, most + 1)
        Half widths of the rows of a disc of each size, from its middle on.
    reaches : ndarray of int32, (sizes,)
        Rows of it above the middle, and below.
    least : ndarray of int32, (sizes,)
        A bead must show more pixels than this.
    places : ndarray of int32, (n, 4)
        Size, row, column of a disc and what it explains, where that is enough; in this order.
    """

    balance: NDArray[np.int32]
    sums: NDArray[np.int32]
    widths: NDArray[np.int32]
    reaches: NDArray[np.int32]
    least: NDArray[np.int32]
    places: NDArray[np.int32]


@compiled
def balance_of(picture: Picture, search: Search) -> NDArray[np.int32]:
    """Pixels of the species, not yet explained, less those of the floor, in squares."""
    height, width = picture.shown.shape
    step = search.step
    rows, columns = (height + step - 1) // step, (width + step - 1) // step
    found = np.empty((rows, columns), dtype=np.int32)
    _balance(picture, search, np.zeros(columns * step, dtype=np.int16), found)
    return found


@kernel
def _balance(
    picture: Picture, search: Search, sums: NDArray[np.int16], found: NDArray[np.int32]
) -> None:
    """See `balance_of`; `sums` is room for a row of pixels, padded to whole squares."""
    height, width = picture.shown.shape
    step = search.step
    kind, own = np.uint8(search.kind), np.uint8(1 << search.kind)
    weight, floor = np.int16(search.floor_weight), np.uint8(FLOOR)
    for row in range(found.shape[0]):
        # The rows of a square are summed first: that goes many columns at once.
        sums[:] = 0
        for i in range(row * step, min((row + 1) * step, height)):
            shown, covered = picture.shown[i], picture.covered[i]
            for j in range(width):
                bead = np.int16((shown[j] == kind) & (covered[j] & own == 0))
                sums[j] += bead - weight * np.int16(shown[j] == floor)
        squares = found[row]
        if step == 2:
            # Of the smallest squares there are many: a known number is summed faster.
            for column in range(squares.size):
                squares[column] = np.int32(sums[2 * column]) + np.int32(sums[2 * column + 1])
            continue
        for column in range(squares.size):
            total = np.int32(0)
            for j in range(column * step, (column + 1) * step):
                total += sums[j]
            squares[column] = total


@inlined
def _sum_row(balance: NDArray[np.int32], sums: NDArray[np.int32], i: int) -> None:
    total = np.int32(0)
    for j in range(balance.shape[1]):
        total += balance[i, j]
        sums[i, j + 1] = total


@inlined
def _gain(gains: Gains, size: int, i: int, j: int) -> int:
    """Balance of a disc that is centred on a square."""
    reach, last = gains.reaches[size], gains.sums.shape[1] - 2
    total = 0
    for row in range(max(i - reach, 0), min(i + reach, gains.sums.shape[0] - 1) + 1):
        width = gains.widths[size, abs(row - i)]
        total += gains.sums[row, min(j + width, last) + 1] - gains.sums[row, max(j - width, 0)]
    return total


@kernel
def _add_surplus(balance: NDArray[np.int32], table: NDArray[np.int32]) -> None:
    """Sums of what is left to explain over all rectangles from the corner."""
    for i in range(balance.shape[0]):
        total = np.int32(0)
        for j in range(balance.shape[1]):
            total += max(balance[i, j], 0)
            table[i + 1, j + 1] = table[i, j + 1] + total


@compiled
def first_gains(balance: NDArray[np.int32], search: Search) -> Gains:
    """Gains of all discs that could show enough."""
    rows, columns = balance.shape
    sizes = search.radii.size
    reaches = np.empty(sizes, dtype=np.int32)
    least = np.empty(sizes, dtype=np.int32)
    widths = np.zeros((sizes, int(search.radii[-1] / search.step) + 1), dtype=np.int32)
    for size in range(sizes):
        radius = search.radii[size] / search.step
        reaches[size] = int(radius)
        for k in range(reaches[size] + 1):
            widths[size, k] = int(math.sqrt(max(radius * radius - k * k, 0.0)))
        least[size] = int(search.least_share * np.pi * search.radii[size] * search.radii[size])
    table = np.zeros((rows + 1, columns + 1), dtype=np.int32)
    _add_surplus(balance, table)
    places = np.empty((sizes * rows * columns, 4), dtype=np.int32)
    count = _promising(balance, search.step, table, reaches, least, places)
    sums = np.zeros((rows, columns + 1), dtype=np.int32)
    gains = Gains(balance, sums, widths, reaches, least, places[:count])
    if not count:
        return gains
    count = renew_gains(gains, count, (0, rows), (0, columns))
    return Gains(balance, sums, widths, reaches, least, places[:count])


@kernel
def _promising(
    balance: NDArray[np.int32],
    step: int,
    table: NDArray[np.int32],
    reaches: NDArray[np.int32],
    least: NDArray[np.int32],
    places: NDArray[np.int32],
) -> int:
    """Write the places around which there is enough left to explain; how many there are."""
    rows, columns = balance.shape
    count = 0
    for size in range(reaches.size):
        reach, enough = reaches[size], least[size]
        for i in range(rows):
            above, below = table[max(i - reach, 0)], table[min(i + reach + 1, rows)]
            if below[columns] - above[columns] <= enough:
                continue
            for block in range(0, columns, _BLOCK):
                # No more than around all places of the block together.
                left, right = max(block - reach, 0), min(block + _BLOCK + reach, columns)
                if below[right] - above[right] - below[left] + above[left] <= enough:
                    continue
                for j in range(block, min(block + _BLOCK, columns)):
                    left, right = max(j - reach, 0), min(j + reach + 1, columns)
                    limit = below[right] - above[right] - below[left] + above[left]
                    middle_is_floor = 2 * balance[i, j] <= -step * step
                    if limit > enough and not middle_is_floor:
                        places[count, 0], places[count, 1], places[count, 2] = size, i, j
                        count += 1
    return count


@kernel
def best_disc(gains: Gains, count: int) -> int:
    """Which of the first so many places explains most, at least one."""
    best = 0
    for k in range(1, count):
        if gains.places[k, 3] > gains.places[best, 3]:
            best = k
    return best


@kernel
def renew_gains(gains: Gains, count: int, rows: tuple[int, int], columns: tuple[int, int]) -> int:
    """Compute gains again in a rectangle of squares, after its balance has fallen.

    Of the first `count` places those are kept, in their order, that are still worth while: gains
    only fall. How many these are is returned.
    """
    top, bottom = max(rows[0], 0), min(rows[1], gains.balance.shape[0] - 1)
    left, right = max(columns[0], 0), min(columns[1], gains.balance.shape[1] - 1)
    for i in range(top, bottom + 1):
        _sum_row(gains.balance, gains.sums, i)
    kept = 0
    for k in range(count):
        size, i, j = gains.places[k, 0], gains.places[k, 1], gains.places[k, 2]
        value = gains.places[k, 3]
        if top <= i <= bottom and left <= j <= right:
            value = _gain(gains, size, i, j)
        if value > gains.least[size]:
            gains.places[kept, 0], gains.places[kept, 1] = size, i
            gains.places[kept, 2], gains.places[kept, 3] = j, value
            kept += 1
    return kept
