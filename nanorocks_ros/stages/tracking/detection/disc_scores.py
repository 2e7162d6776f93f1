"""Scores of disc candidates: the pixels that a disc of each position and size would cover.

Tested by ``test/stages/tracking/detection/test_bead_detector.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined, kernel
from nanorocks_ros.stages.tracking.detection.pixel_classes import FLOOR, PixelMaps

if TYPE_CHECKING:
    from numpy.typing import NDArray


# Candidates that are tested together, along a row.
_BLOCK_COLUMNS = 8


class DiscSearch(NamedTuple):
    """Search parameters of one species.

    Parameters
    ----------
    kind : int
        RED, BLUE or GRAY.
    hue_sign : float
        1, -1 or 0 for these.
    radii : ndarray (k,), [px]
        Trial radii, ascending.
    expected : ndarray (2,), [px]
        Radius and its spread.
    step : int, [px]
        Side of the squares of the candidate grid.
    max_beads : int
        Largest number of beads; 0 if the species is too crowded.
    background_weight : int
        Weight of a background pixel under a disc, over a pixel of the species.
    min_share : float
        Smallest visible share of the disc of a bead.
    min_outline : float
        Smallest share of its outline with an edge.
    """

    kind: int
    hue_sign: float
    radii: NDArray[np.float64]
    expected: NDArray[np.float64]
    step: int
    max_beads: int
    background_weight: int
    min_share: float
    min_outline: float


class DiscScores(NamedTuple):
    """Scores of discs on a grid of squares of `DiscSearch.step` pixels a side.

    Parameters
    ----------
    balance : ndarray of int32, (rows, columns)
        Uncovered pixels of the species, minus weighted background pixels.
    row_sums : ndarray of int32, (rows, columns + 1)
        Cumulative sums of the balance along rows, up to each column.
    half_widths : ndarray of int32, (sizes, rows)
        Half widths of the rows of a disc of each size, from its central row on.
    half_heights : ndarray of int32, (sizes,)
        Number of rows of a disc above its central row, and below.
    min_scores : ndarray of int32, (sizes,)
        Score that a bead must exceed.
    candidates : ndarray of int32, (n, 4)
        Size, row, column and score of each disc above `min_scores`.
    """

    balance: NDArray[np.int32]
    row_sums: NDArray[np.int32]
    half_widths: NDArray[np.int32]
    half_heights: NDArray[np.int32]
    min_scores: NDArray[np.int32]
    candidates: NDArray[np.int32]


@compiled
def score_map(pixels: PixelMaps, search: DiscSearch) -> NDArray[np.int32]:
    """Uncovered pixels of the species minus weighted background pixels, in each square."""
    height, width = pixels.pixel_class.shape
    step = search.step
    rows, columns = (height + step - 1) // step, (width + step - 1) // step
    balance = np.empty((rows, columns), dtype=np.int32)
    _write_score_map(pixels, search, np.zeros(columns * step, dtype=np.int16), balance)
    return balance


@kernel
def _write_score_map(
    pixels: PixelMaps,
    search: DiscSearch,
    row_pixels: NDArray[np.int16],
    balance: NDArray[np.int32],
) -> None:
    """See `score_map`; `row_pixels` is a work array of a row, padded to whole squares."""
    height, width = pixels.pixel_class.shape
    step = search.step
    kind, mask = np.uint8(search.kind), np.uint8(1 << search.kind)
    weight, background = np.int16(search.background_weight), np.uint8(FLOOR)
    for row in range(balance.shape[0]):
        # The rows of a square are summed first: that loop is vectorised.
        row_pixels[:] = 0
        for i in range(row * step, min((row + 1) * step, height)):
            pixel_class, covered = pixels.pixel_class[i], pixels.covered[i]
            for j in range(width):
                bead = np.int16((pixel_class[j] == kind) & (covered[j] & mask == 0))
                row_pixels[j] += bead - weight * np.int16(pixel_class[j] == background)
        squares = balance[row]
        if step == 2:
            # The smallest squares are many: a fixed number of columns is summed faster.
            for column in range(squares.size):
                squares[column] = np.int32(row_pixels[2 * column]) + np.int32(
                    row_pixels[2 * column + 1]
                )
            continue
        for column in range(squares.size):
            total = np.int32(0)
            for j in range(column * step, (column + 1) * step):
                total += row_pixels[j]
            squares[column] = total


@inlined
def _sum_row(balance: NDArray[np.int32], row_sums: NDArray[np.int32], i: int) -> None:
    total = np.int32(0)
    for j in range(balance.shape[1]):
        total += balance[i, j]
        row_sums[i, j + 1] = total


@inlined
def _disc_score(scores: DiscScores, size: int, i: int, j: int) -> int:
    """Score of a disc that is centred on a square."""
    reach, last = scores.half_heights[size], scores.row_sums.shape[1] - 2
    total = 0
    for row in range(max(i - reach, 0), min(i + reach, scores.row_sums.shape[0] - 1) + 1):
        width = scores.half_widths[size, abs(row - i)]
        total += (
            scores.row_sums[row, min(j + width, last) + 1]
            - scores.row_sums[row, max(j - width, 0)]
        )
    return total


@kernel
def _positive_sums(balance: NDArray[np.int32], integral: NDArray[np.int32]) -> None:
    """Integral image of the positive part of the balance."""
    for i in range(balance.shape[0]):
        total = np.int32(0)
        for j in range(balance.shape[1]):
            total += max(balance[i, j], 0)
            integral[i + 1, j + 1] = integral[i, j + 1] + total


@compiled
def initial_scores(balance: NDArray[np.int32], search: DiscSearch) -> DiscScores:
    """Scores of all discs that can exceed `min_scores`."""
    rows, columns = balance.shape
    sizes = search.radii.size
    half_heights = np.empty(sizes, dtype=np.int32)
    min_scores = np.empty(sizes, dtype=np.int32)
    half_widths = np.zeros((sizes, int(search.radii[-1] / search.step) + 1), dtype=np.int32)
    for size in range(sizes):
        radius = search.radii[size] / search.step
        half_heights[size] = int(radius)
        for k in range(half_heights[size] + 1):
            half_widths[size, k] = int(math.sqrt(max(radius * radius - k * k, 0.0)))
        min_scores[size] = int(search.min_share * np.pi * search.radii[size] * search.radii[size])
    integral = np.zeros((rows + 1, columns + 1), dtype=np.int32)
    _positive_sums(balance, integral)
    candidates = np.empty((sizes * rows * columns, 4), dtype=np.int32)
    count = _find_candidates(balance, search.step, integral, half_heights, min_scores, candidates)
    row_sums = np.zeros((rows, columns + 1), dtype=np.int32)
    scores = DiscScores(
        balance, row_sums, half_widths, half_heights, min_scores, candidates[:count]
    )
    if not count:
        return scores
    count = update_scores(scores, count, (0, rows), (0, columns))
    return DiscScores(balance, row_sums, half_widths, half_heights, min_scores, candidates[:count])


@kernel
def _find_candidates(
    balance: NDArray[np.int32],
    step: int,
    integral: NDArray[np.int32],
    half_heights: NDArray[np.int32],
    min_scores: NDArray[np.int32],
    candidates: NDArray[np.int32],
) -> int:
    """Write the candidates with enough uncovered pixels around; return their number."""
    rows, columns = balance.shape
    count = 0
    for size in range(half_heights.size):
        reach, min_score = half_heights[size], min_scores[size]
        for i in range(rows):
            above, below = integral[max(i - reach, 0)], integral[min(i + reach + 1, rows)]
            if below[columns] - above[columns] <= min_score:
                continue
            for block in range(0, columns, _BLOCK_COLUMNS):
                # Upper limit for all candidates of the block.
                left, right = max(block - reach, 0), min(block + _BLOCK_COLUMNS + reach, columns)
                if below[right] - above[right] - below[left] + above[left] <= min_score:
                    continue
                for j in range(block, min(block + _BLOCK_COLUMNS, columns)):
                    left, right = max(j - reach, 0), min(j + reach + 1, columns)
                    limit = below[right] - above[right] - below[left] + above[left]
                    middle_is_floor = 2 * balance[i, j] <= -step * step
                    if limit > min_score and not middle_is_floor:
                        candidates[count, 0], candidates[count, 1] = size, i
                        candidates[count, 2] = j
                        count += 1
    return count


@kernel
def best_disc(scores: DiscScores, count: int) -> int:
    """Index of the highest score among the first `count` candidates, at least one."""
    best = 0
    for k in range(1, count):
        if scores.candidates[k, 3] > scores.candidates[best, 3]:
            best = k
    return best


@kernel
def update_scores(
    scores: DiscScores, count: int, rows: tuple[int, int], columns: tuple[int, int]
) -> int:
    """Update the scores in a rectangle of squares whose balance has decreased.

    Scores only decrease: of the first `count` candidates, those still above `min_scores` are kept
    in their order. Returns their number.
    """
    top, bottom = max(rows[0], 0), min(rows[1], scores.balance.shape[0] - 1)
    left, right = max(columns[0], 0), min(columns[1], scores.balance.shape[1] - 1)
    for i in range(top, bottom + 1):
        _sum_row(scores.balance, scores.row_sums, i)
    kept = 0
    for k in range(count):
        size, i, j = scores.candidates[k, 0], scores.candidates[k, 1], scores.candidates[k, 2]
        value = scores.candidates[k, 3]
        if top <= i <= bottom and left <= j <= right:
            value = _disc_score(scores, size, i, j)
        if value > scores.min_scores[size]:
            scores.candidates[kept, 0], scores.candidates[kept, 1] = size, i
            scores.candidates[kept, 2], scores.candidates[kept, 3] = j, value
            kept += 1
    return kept
