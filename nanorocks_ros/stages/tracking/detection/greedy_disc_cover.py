"""Greedy cover of the pixels of a species by discs: the highest score first, hidden beads last.

Tested by ``test/stages/tracking/detection/test_bead_detector.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined, kernel
from nanorocks_ros.stages.tracking.detection.bead_edges import (
    EdgeMaps,
    Rays,
    allocate_rays,
    edge_maps,
)
from nanorocks_ros.stages.tracking.detection.circle_fit import find_neighbours, fit_circle
from nanorocks_ros.stages.tracking.detection.disc_scores import (
    DiscScores,
    DiscSearch,
    best_disc,
    initial_scores,
    score_map,
    update_scores,
)
from nanorocks_ros.stages.tracking.detection.pixel_classes import FLOOR, GRAY, PixelMaps

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Distance beyond the fitted outline within which pixels belong to the bead, [px].
_RIM_PX = 1.0
# Smallest newly covered share of a fitted disc, over `DiscSearch.min_share`.
_MIN_KEPT_SHARE = 0.7
# Half width of the ring at the outline of a coloured bead that compression turns gray, [px].
_OUTLINE_RING_PX = 2.5
# Largest distance of a bead from its hint, in radii.
_MAX_HINT_DISTANCE = 0.3


@compiled
def cover_with_discs(
    pixels: PixelMaps,
    search: DiscSearch,
    hints: NDArray[np.float64],
    discs: NDArray[np.float64],
    fits: NDArray[np.float64],
) -> int:
    """Cover the pixels of one species with discs.

    Parameters
    ----------
    pixels : PixelMaps
        `covered` is changed: bit `kind` is set in the pixels of the beads.
    search : DiscSearch
    hints : ndarray (k, 4), [px]
        Predicted beads: column, row, radius and its standard deviation. They are tried first, in
        this order; only pixels that they leave uncovered are searched.
    discs : ndarray (most, 3), [px]
        Written: column, row, radius.
    fits : ndarray (most, 4)
        Written: error of a coordinate and of the radius [px], visible shares of the outline and
        of the disc.

    Returns
    -------
    int
        Number of beads.
    """
    if search.max_beads == 0:
        return 0
    maps, rays, guess = edge_maps(pixels), allocate_rays(), np.empty(3)
    count = _try_hints(pixels, maps, search, hints, discs, fits, rays)
    scores = initial_scores(score_map(pixels, search), search)
    return _cover_rest(pixels, maps, search, scores, discs, fits, count, guess, rays)


@kernel
def _cover_rest(
    pixels: PixelMaps,
    maps: EdgeMaps,
    search: DiscSearch,
    scores: DiscScores,
    discs: NDArray[np.float64],
    fits: NDArray[np.float64],
    count: int,
    guess: NDArray[np.float64],
    rays: Rays,
) -> int:
    """Add discs in the order of their scores; return the number of beads."""
    n_candidates = scores.candidates.shape[0]
    while count < search.max_beads and n_candidates:
        is_bead, n_candidates = _fit_best_disc(
            pixels, maps, search, scores, n_candidates, discs, fits, count, guess, rays
        )
        count += is_bead
    return count


@kernel
def _fit_best_disc(
    pixels: PixelMaps,
    maps: EdgeMaps,
    search: DiscSearch,
    scores: DiscScores,
    n_candidates: int,
    discs: NDArray[np.float64],
    fits: NDArray[np.float64],
    disc_row: int,
    guess: NDArray[np.float64],
    rays: Rays,
) -> tuple[bool, int]:
    """Fit the disc of highest score; whether it is a bead, and how many candidates are left."""
    best = best_disc(scores, n_candidates)
    size, row, column = (
        scores.candidates[best, 0],
        scores.candidates[best, 1],
        scores.candidates[best, 2],
    )
    step = search.step
    guess[0], guess[1], guess[2] = (column + 0.5) * step, (row + 0.5) * step, search.radii[size]
    disc, fit = discs[disc_row], fits[disc_row]
    disc[0], disc[1], disc[2] = guess[0], guess[1], guess[2]
    neighbours = find_neighbours(discs, disc_row, disc_row, rays)
    fit_circle(maps, search.hue_sign, disc, neighbours, search.expected, fit, rays)
    _remove_from_balance(pixels, search, disc, scores.balance)
    fit[3] = _mark_covered(pixels, search.kind, disc)
    is_bead = bool((fit[3] >= _MIN_KEPT_SHARE * search.min_share) & (fit[2] >= search.min_outline))
    if not is_bead:
        # The fit moved away: these pixels are no bead and are not tried again.
        _remove_from_balance(pixels, search, guess, scores.balance)
        _mark_covered(pixels, search.kind, guess)
    # The same candidate must not be the best again.
    scores.candidates[best, 1], scores.candidates[best, 3] = -1, 0
    reach = int((max(disc[2], guess[2]) + search.radii[-1]) / step) + 2
    fitted_row, fitted_column = int(disc[1] / step), int(disc[0] / step)
    n_candidates = update_scores(
        scores,
        n_candidates,
        (min(row, fitted_row) - reach, max(row, fitted_row) + reach),
        (min(column, fitted_column) - reach, max(column, fitted_column) + reach),
    )
    return is_bead, n_candidates


@kernel
def _try_hints(
    pixels: PixelMaps,
    maps: EdgeMaps,
    search: DiscSearch,
    hints: NDArray[np.float64],
    discs: NDArray[np.float64],
    fits: NDArray[np.float64],
    rays: Rays,
) -> int:
    """Find beads at their hints; see `cover_with_discs`."""
    count = 0
    for k in range(min(hints.shape[0], discs.shape[0])):
        disc, hint = discs[count], hints[k]
        disc[0], disc[1], disc[2] = hint[0], hint[1], hint[2]
        if _uncovered_share(pixels, search.kind, disc) < search.min_share:
            continue
        neighbours = find_neighbours(discs, count, count, rays)
        fit_circle(maps, search.hue_sign, disc, neighbours, hint[2:], fits[count], rays)
        dx, dy = disc[0] - hint[0], disc[1] - hint[1]
        if dx * dx + dy * dy > (_MAX_HINT_DISTANCE * hint[2]) ** 2:
            continue
        if _uncovered_share(pixels, search.kind, disc) < search.min_share:
            continue
        if fits[count, 2] < search.min_outline:
            continue
        fits[count, 3] = _mark_covered(pixels, search.kind, disc)
        count += 1
    return count


@inlined
def _span(
    disc: NDArray[np.float64], radius: float, row: int, columns: int
) -> tuple[np.uint64, np.uint64]:
    """Columns of a row within a radius of the centre: the first, and the one after the last."""
    dy = row + 0.5 - disc[1]
    half2 = radius * radius - dy * dy
    if half2 < 0.0:
        return np.uint64(0), np.uint64(0)
    half = math.sqrt(half2)
    first = max(math.ceil(disc[0] - half - 0.5), 0)
    last = min(math.floor(disc[0] + half - 0.5) + 1, columns)
    return np.uint64(first), np.uint64(max(first, last))


@inlined
def _rows(disc: NDArray[np.float64], radius: float, rows: int) -> tuple[int, int]:
    return max(int(disc[1] - radius), 0), min(int(disc[1] + radius) + 1, rows)


@kernel
def _remove_from_balance(
    pixels: PixelMaps, search: DiscSearch, disc: NDArray[np.float64], balance: NDArray[np.int32]
) -> None:
    """Subtract the pixels that a disc covers from the balance."""
    radius = disc[2] + _RIM_PX
    mask = np.uint8(1 << search.kind)
    first_row, last_row = _rows(disc, radius, pixels.pixel_class.shape[0])
    for i in range(first_row, last_row):
        first, last = _span(disc, radius, i, pixels.pixel_class.shape[1])
        for j in range(first, last):
            if pixels.pixel_class[i, j] == search.kind and not pixels.covered[i, j] & mask:
                balance[i // search.step, j // search.step] -= 1


@kernel
def _mark_covered(pixels: PixelMaps, kind: int, disc: NDArray[np.float64]) -> float:
    """Mark the pixels of a disc as covered; return the share of it that is newly covered."""
    columns, radius = pixels.pixel_class.shape[1], disc[2] + _RIM_PX
    own_class, mask = np.uint8(kind), np.uint8(1 << kind)
    n_new = np.int32(0)
    first_row, last_row = _rows(disc, radius, pixels.pixel_class.shape[0])
    for i in range(first_row, last_row):
        pixel_class, covered = pixels.pixel_class[i], pixels.covered[i]
        first, last = _span(disc, radius, i, columns)
        for j in range(first, last):
            n_new += np.int32((pixel_class[j] == own_class) & (covered[j] & mask == 0))
            covered[j] |= mask
    if kind != GRAY:
        _mark_outline(pixels, disc)
    return float(n_new / (np.pi * disc[2] * disc[2]))


@kernel
def _mark_outline(pixels: PixelMaps, disc: NDArray[np.float64]) -> None:
    """Mark the outline of a coloured bead as covered for gray beads."""
    columns = pixels.pixel_class.shape[1]
    outer, inner = disc[2] + _OUTLINE_RING_PX, max(disc[2] - _OUTLINE_RING_PX, 0.0)
    gray = np.uint8(1 << GRAY)
    first_row, last_row = _rows(disc, outer, pixels.pixel_class.shape[0])
    for i in range(first_row, last_row):
        covered = pixels.covered[i]
        first, last = _span(disc, outer, i, columns)
        inner_first, inner_last = _span(disc, inner, i, columns)
        if inner_first == inner_last:
            inner_first, inner_last = last, last
        for j in range(first, inner_first):
            covered[j] |= gray
        for j in range(inner_last, last):
            covered[j] |= gray


@kernel
def _uncovered_share(pixels: PixelMaps, kind: int, disc: NDArray[np.float64]) -> float:
    """Uncovered share of a disc in its species, minus the share of background."""
    columns, radius = pixels.pixel_class.shape[1], disc[2]
    mask, own_class, background = np.uint8(1 << kind), np.uint8(kind), np.uint8(FLOOR)
    total = np.int32(0)
    first_row, last_row = _rows(disc, radius, pixels.pixel_class.shape[0])
    for i in range(first_row, last_row):
        pixel_class, covered = pixels.pixel_class[i], pixels.covered[i]
        first, last = _span(disc, radius, i, columns)
        for j in range(first, last):
            total += np.int32((pixel_class[j] == own_class) & (covered[j] & mask == 0))
            total -= np.int32(pixel_class[j] == background)
    return float(total / (np.pi * radius * radius))
