"""Which discs explain the pixels of a species: the most explaining first, hidden ones last."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.compiled import compiled
from nanorocks_ros.stages.tracking.outline import fit_circle
from nanorocks_ros.stages.tracking.pixels import FLOOR, GRAY

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Beyond the fitted outline a pixel may still be dark, [px].
_RIM_PX = 1.0
# Of the area for which a place was chosen, what the fitted disc must still explain.
_FIT_KEEPS = 0.7
# The outline of a coloured bead has lost its colour to the compression in a ring so wide, [px].
_GRAY_RING_PX = 2.5
# Of its radius, how far from where it should be a bead is taken for the expected one.
_HINT_REACH = 0.6


@compiled
def _balance(
    shown: NDArray[np.uint8],
    covered: NDArray[np.uint8],
    kind: int,
    step: int,
    floor_weight: int,
) -> NDArray[np.int32]:
    """Pixels of the species less pixels of the floor, in squares of `step` pixels a side."""
    rows = (shown.shape[0] + step - 1) // step
    columns = (shown.shape[1] + step - 1) // step
    found = np.zeros((rows, columns), dtype=np.int32)
    own = np.uint8(1 << kind)
    for i in range(shown.shape[0]):
        row = i // step
        for column in range(columns):
            total = 0
            for j in range(column * step, min((column + 1) * step, shown.shape[1])):
                if shown[i, j] == kind:
                    total += 0 if covered[i, j] & own else 1
                elif shown[i, j] == FLOOR:
                    total -= floor_weight
            found[row, column] += total
    return found


@compiled
def _sum_row(balance: NDArray[np.int32], sums: NDArray[np.int32], i: int) -> None:
    """Fill a row of `sums` (rows, columns + 1): what lies left of each column."""
    for j in range(balance.shape[1]):
        sums[i, j + 1] = sums[i, j] + balance[i, j]


@compiled
def _gain(sums: NDArray[np.int32], i: int, j: int, widths: NDArray[np.int64]) -> int:
    """What a disc centred on a square would explain, less the floor it would hide."""
    reach = (widths.size - 1) // 2
    last = sums.shape[1] - 2
    total = 0
    for k in range(max(-reach, -i), min(reach, sums.shape[0] - 1 - i) + 1):
        width = widths[k + reach]
        total += sums[i + k, min(j + width, last) + 1] - sums[i + k, max(j - width, 0)]
    return total


@compiled
def _widths(radius: float) -> NDArray[np.int64]:
    """Half widths of the rows of a disc, in squares."""
    reach = int(radius)
    found = np.empty(2 * reach + 1, dtype=np.int64)
    for k in range(-reach, reach + 1):
        found[k + reach] = int(math.sqrt(max(radius * radius - k * k, 0.0)))
    return found


@compiled
def _explain(
    shown: NDArray[np.uint8],
    covered: NDArray[np.uint8],
    kind: int,
    disc: NDArray[np.float64],
    step: int,
    balance: NDArray[np.int32],
) -> int:
    """Take the pixels of a disc out of the balance; how many of them are the species'."""
    radius = disc[2] + _RIM_PX
    own = np.uint8(1 << kind)
    ring = np.uint8(1 << GRAY) if kind != GRAY else np.uint8(0)
    outer = disc[2] + (_GRAY_RING_PX if kind != GRAY else _RIM_PX)
    inner = max(disc[2] - _GRAY_RING_PX, 0.0)
    taken = 0
    for i in range(max(int(disc[1] - outer), 0), min(int(disc[1] + outer) + 1, shown.shape[0])):
        for j in range(
            max(int(disc[0] - outer), 0), min(int(disc[0] + outer) + 1, shown.shape[1])
        ):
            dx, dy = j + 0.5 - disc[0], i + 0.5 - disc[1]
            d2 = dx * dx + dy * dy
            if d2 <= radius * radius:
                if shown[i, j] == kind and not covered[i, j] & own:
                    balance[i // step, j // step] -= 1
                    taken += 1
                covered[i, j] |= own
            if inner * inner < d2 <= outer * outer:
                covered[i, j] |= ring
    return taken


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
def _follow_hints(
    shown: NDArray[np.uint8],
    darkness: NDArray[np.uint8],
    hue: NDArray[np.int16],
    kind: int,
    hue_sign: float,
    step: int,
    least_share: float,
    covered: NDArray[np.uint8],
    discs: NDArray[np.float64],
    fits: NDArray[np.float64],
    hints: NDArray[np.float64],
    balance: NDArray[np.int32],
) -> int:
    """Find beads where they should be; see `cover`."""
    fit = np.zeros(3)
    found = 0
    for k in range(min(hints.shape[0], discs.shape[0])):
        discs[found] = hints[k, :3]
        if _left_to_explain(shown, covered, kind, discs[found]) < least_share:
            continue
        fit_circle(darkness, hue, hue_sign, discs, found, found + 1, hints[k, 2:], fit)
        dx, dy = discs[found, 0] - hints[k, 0], discs[found, 1] - hints[k, 1]
        away = dx * dx + dy * dy > (_HINT_REACH * hints[k, 2]) ** 2
        if away or _left_to_explain(shown, covered, kind, discs[found]) < least_share:
            continue
        fits[found, :3] = fit
        area = np.pi * discs[found, 2] * discs[found, 2]
        fits[found, 3] = _explain(shown, covered, kind, discs[found], step, balance) / area
        found += 1
    return found


@compiled
def _left_to_explain(
    shown: NDArray[np.uint8], covered: NDArray[np.uint8], kind: int, disc: NDArray[np.float64]
) -> float:
    """Share of a disc that shows the species, unexplained, less the share that shows floor."""
    radius = disc[2]
    own = np.uint8(1 << kind)
    total = 0
    for i in range(max(int(disc[1] - radius), 0), min(int(disc[1] + radius) + 1, shown.shape[0])):
        for j in range(
            max(int(disc[0] - radius), 0), min(int(disc[0] + radius) + 1, shown.shape[1])
        ):
            dx, dy = j + 0.5 - disc[0], i + 0.5 - disc[1]
            if dx * dx + dy * dy <= radius * radius:
                if shown[i, j] == kind:
                    total += 0 if covered[i, j] & own else 1
                elif shown[i, j] == FLOOR:
                    total -= 1
    return total / (np.pi * radius * radius)


@compiled
def cover(
    shown: NDArray[np.uint8],
    darkness: NDArray[np.uint8],
    hue: NDArray[np.int16],
    kind: int,
    hue_sign: float,
    radii: NDArray[np.float64],
    expected: NDArray[np.float64],
    floor_weight: int,
    step: int,
    most: int,
    least_share: float,
    covered: NDArray[np.uint8],
    discs: NDArray[np.float64],
    fits: NDArray[np.float64],
    hints: NDArray[np.float64],
) -> int:
    """Cover the pixels of one species with discs.

    Parameters
    ----------
    shown, darkness, hue : ndarrays (rows, columns)
        See `look_at_pixels`.
    kind : int
        RED, BLUE or GRAY.
    hue_sign : float
    radii : ndarray (k,), [px]
        Sizes to try.
    expected : ndarray (2,), [px]
        Radius and its spread, see `fit_circle`.
    floor_weight : int
        Of a pixel of floor under a disc, against one of the species.
    step : int, [px]
        Squares in which places are tried.
    most : int
        Beads to look for.
    least_share : float
        Of its disc that a bead must show.
    covered : ndarray of uint8, (rows, columns)
        Changed: bit `kind` is set in the pixels of the beads found.
    discs : ndarray (most, 3), [px]
        Written: column, row, radius.
    fits : ndarray (most, 4)
        Written: see `fit_circle`, and the share of the disc that was seen.
    hints : ndarray (k, 4), [px]
        Where beads should be: column, row, radius and its standard deviation. These places are
        tried first, in this order; only what they leave unexplained is searched.

    Returns
    -------
    int
        Beads found.
    """
    if most == 0:
        return 0
    balance = _balance(shown, covered, kind, step, floor_weight)
    found = _follow_hints(
        shown,
        darkness,
        hue,
        kind,
        hue_sign,
        step,
        least_share,
        covered,
        discs,
        fits,
        hints,
        balance,
    )
    rows, columns = balance.shape
    sizes = radii.size
    gains = np.zeros((sizes, rows, columns), dtype=np.int32)
    tops = np.zeros((sizes, rows), dtype=np.int32)
    places = np.zeros((sizes, rows), dtype=np.int32)
    full = step * step
    sums = np.zeros((rows, columns + 1), dtype=np.int32)
    for i in range(rows):
        _sum_row(balance, sums, i)
    table = _surplus_table(balance)
    for size in range(sizes):
        widths = _widths(radii[size] / step)
        reach = int(radii[size] / step)
        least = least_share * np.pi * radii[size] * radii[size]
        for i in range(rows):
            above, below = max(i - reach, 0), min(i + reach + 1, rows)
            for j in range(columns):
                left, right = max(j - reach, 0), min(j + reach + 1, columns)
                most_gain = table[below, right] - table[above, right]
                most_gain -= table[below, left] - table[above, left]
                if most_gain > least and 2 * balance[i, j] > -full:
                    gains[size, i, j] = _gain(sums, i, j, widths)
                    if gains[size, i, j] > tops[size, i]:
                        tops[size, i], places[size, i] = gains[size, i, j], j
    fit = np.zeros(3)
    guess = np.zeros(3)
    while found < most:
        best, best_size, best_row = 0, 0, 0
        for size in range(sizes):
            least = least_share * np.pi * radii[size] * radii[size]
            for i in range(rows):
                if tops[size, i] > best and tops[size, i] > least:
                    best, best_size, best_row = tops[size, i], size, i
        if best == 0:
            break
        best_column = places[best_size, best_row]
        discs[found, 0] = (best_column + 0.5) * step
        discs[found, 1] = (best_row + 0.5) * step
        discs[found, 2] = radii[best_size]
        fit_circle(darkness, hue, hue_sign, discs, found, found + 1, expected, fit)
        fits[found, :3] = fit
        area = np.pi * discs[found, 2] * discs[found, 2]
        fits[found, 3] = _explain(shown, covered, kind, discs[found], step, balance) / area
        good = fits[found, 3] >= _FIT_KEEPS * least_share
        if not good:
            # The circle went elsewhere: these pixels are no bead, and not to be tried again.
            guess[0], guess[1] = (best_column + 0.5) * step, (best_row + 0.5) * step
            guess[2] = radii[best_size]
            _explain(shown, covered, kind, guess, step, balance)
        # Whatever happens, the same place is not the best again.
        gains[best_size, best_row, best_column] = 0
        reach = int((max(discs[found, 2], radii[best_size]) + radii[-1]) / step) + 2
        top = max(min(best_row, int(discs[found, 1] / step)) - reach, 0)
        bottom = min(max(best_row, int(discs[found, 1] / step)) + reach, rows - 1)
        left = max(min(best_column, int(discs[found, 0] / step)) - reach, 0)
        right = min(max(best_column, int(discs[found, 0] / step)) + reach, columns - 1)
        for i in range(top, bottom + 1):
            _sum_row(balance, sums, i)
        for size in range(sizes):
            widths = _widths(radii[size] / step)
            for i in range(top, bottom + 1):
                for j in range(left, right + 1):
                    if gains[size, i, j] > 0:
                        gains[size, i, j] = _gain(sums, i, j, widths)
                # Gains only fall: a best outside the changed part stays the best.
                if left <= places[size, i] <= right:
                    tops[size, i] = 0
                    for j in range(columns):
                        if gains[size, i, j] > tops[size, i]:
                            tops[size, i], places[size, i] = gains[size, i, j], j
        found += good
    return found
