"""Which discs explain the pixels of a species: the most explaining first, hidden ones last."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined, kernel
from nanorocks_ros.stages.tracking.detection.bead_edges import (
    Planes,
    Rays,
    planes_of,
    room_for_rays,
)
from nanorocks_ros.stages.tracking.detection.circle_fit import find_neighbours, fit_circle
from nanorocks_ros.stages.tracking.detection.disc_scores import (
    Gains,
    Search,
    balance_of,
    best_disc,
    first_gains,
    renew_gains,
)
from nanorocks_ros.stages.tracking.detection.pixel_classes import FLOOR, GRAY, Picture

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Beyond the fitted outline a pixel may still be dark, [px].
_RIM_PX = 1.0
# Of the area for which a place was chosen, what the fitted disc must still explain.
_FIT_KEEPS = 0.7
# The outline of a coloured bead has lost its colour to the compression in a ring so wide, [px].
_GRAY_RING_PX = 2.5
# Of its radius, how far from where it should be a bead is taken for the expected one.
_HINT_REACH = 0.3


@compiled
def cover(
    picture: Picture,
    search: Search,
    hints: NDArray[np.float64],
    discs: NDArray[np.float64],
    fits: NDArray[np.float64],
) -> int:
    """Cover the pixels of one species with discs.

    Parameters
    ----------
    picture : Picture
        `covered` is changed: bit `kind` is set in the pixels of the beads found.
    search : Search
    hints : ndarray (k, 4), [px]
        Where beads should be: column, row, radius and its standard deviation. These places are
        tried first, in this order; only what they leave unexplained is searched.
    discs : ndarray (most, 3), [px]
        Written: column, row, radius.
    fits : ndarray (most, 4)
        Written: error of a coordinate and of the radius [px], shares of the outline and of the
        disc that are seen.

    Returns
    -------
    int
        Beads found.
    """
    if search.most == 0:
        return 0
    planes, rays, guess = planes_of(picture), room_for_rays(), np.empty(3)
    found = _follow_hints(picture, planes, search, hints, discs, fits, rays)
    gains = first_gains(balance_of(picture, search), search)
    return _search(picture, planes, search, gains, discs, fits, found, guess, rays)


@kernel
def _search(
    picture: Picture,
    planes: Planes,
    search: Search,
    gains: Gains,
    discs: NDArray[np.float64],
    fits: NDArray[np.float64],
    found: int,
    guess: NDArray[np.float64],
    rays: Rays,
) -> int:
    """Find beads where most is left to explain; how many there are then. `guess` is room."""
    left = gains.places.shape[0]
    while found < search.most and left:
        good, left = _take(picture, planes, search, gains, left, discs, fits, found, guess, rays)
        found += good
    return found


@kernel
def _take(
    picture: Picture,
    planes: Planes,
    search: Search,
    gains: Gains,
    left: int,
    discs: NDArray[np.float64],
    fits: NDArray[np.float64],
    own: int,
    guess: NDArray[np.float64],
    rays: Rays,
) -> tuple[bool, int]:
    """Fit the disc that explains most; whether it is a bead, and how many places are left."""
    best = best_disc(gains, left)
    size, row, column = gains.places[best, 0], gains.places[best, 1], gains.places[best, 2]
    step = search.step
    guess[0], guess[1], guess[2] = (column + 0.5) * step, (row + 0.5) * step, search.radii[size]
    disc, fit = discs[own], fits[own]
    disc[0], disc[1], disc[2] = guess[0], guess[1], guess[2]
    neighbours = find_neighbours(discs, own, own, rays)
    fit_circle(planes, search.hue_sign, disc, neighbours, search.expected, fit, rays)
    _uncount(picture, search, disc, gains.balance)
    fit[3] = _explain(picture, search.kind, disc)
    good = bool(fit[3] >= _FIT_KEEPS * search.least_share)
    if not good:
        # The circle went elsewhere: these pixels are no bead, and not to be tried again.
        _uncount(picture, search, guess, gains.balance)
        _explain(picture, search.kind, guess)
    # Whatever happens, the same place is not the best again.
    gains.places[best, 1], gains.places[best, 3] = -1, 0
    reach = int((max(disc[2], guess[2]) + search.radii[-1]) / step) + 2
    there, here = int(disc[1] / step), int(disc[0] / step)
    left = renew_gains(
        gains,
        left,
        (min(row, there) - reach, max(row, there) + reach),
        (min(column, here) - reach, max(column, here) + reach),
    )
    return good, left


@kernel
def _follow_hints(
    picture: Picture,
    planes: Planes,
    search: Search,
    hints: NDArray[np.float64],
    discs: NDArray[np.float64],
    fits: NDArray[np.float64],
    rays: Rays,
) -> int:
    """Find beads where they should be; see `cover`."""
    found = 0
    for k in range(min(hints.shape[0], discs.shape[0])):
        disc, hint = discs[found], hints[k]
        disc[0], disc[1], disc[2] = hint[0], hint[1], hint[2]
        if _left_to_explain(picture, search.kind, disc) < search.least_share:
            continue
        neighbours = find_neighbours(discs, found, found, rays)
        fit_circle(planes, search.hue_sign, disc, neighbours, hint[2:], fits[found], rays)
        dx, dy = disc[0] - hint[0], disc[1] - hint[1]
        if dx * dx + dy * dy > (_HINT_REACH * hint[2]) ** 2:
            continue
        if _left_to_explain(picture, search.kind, disc) < search.least_share:
            continue
        fits[found, 3] = _explain(picture, search.kind, disc)
        found += 1
    return found


@inlined
def _span(
    disc: NDArray[np.float64], radius: float, row: int, columns: int
) -> tuple[np.uint64, np.uint64]:
    """The columns of a row, from the first to before the second, within a radius of a centre."""
    dy = row + 0.5 - disc[1]
    left2 = radius * radius - dy * dy
    if left2 < 0.0:
        return np.uint64(0), np.uint64(0)
    half = math.sqrt(left2)
    first = max(math.ceil(disc[0] - half - 0.5), 0)
    last = min(math.floor(disc[0] + half - 0.5) + 1, columns)
    return np.uint64(first), np.uint64(max(first, last))


@inlined
def _rows(disc: NDArray[np.float64], radius: float, rows: int) -> tuple[int, int]:
    return max(int(disc[1] - radius), 0), min(int(disc[1] + radius) + 1, rows)


@kernel
def _uncount(
    picture: Picture, search: Search, disc: NDArray[np.float64], balance: NDArray[np.int32]
) -> None:
    """Take the pixels that a disc explains out of the balance."""
    radius = disc[2] + _RIM_PX
    own = np.uint8(1 << search.kind)
    first_row, last_row = _rows(disc, radius, picture.shown.shape[0])
    for i in range(first_row, last_row):
        first, last = _span(disc, radius, i, picture.shown.shape[1])
        for j in range(first, last):
            if picture.shown[i, j] == search.kind and not picture.covered[i, j] & own:
                balance[i // search.step, j // search.step] -= 1


@kernel
def _explain(picture: Picture, kind: int, disc: NDArray[np.float64]) -> float:
    """Mark the pixels of a disc as explained; the share of it that show its species."""
    columns, radius = picture.shown.shape[1], disc[2] + _RIM_PX
    bead, own = np.uint8(kind), np.uint8(1 << kind)
    taken = np.int32(0)
    first_row, last_row = _rows(disc, radius, picture.shown.shape[0])
    for i in range(first_row, last_row):
        shown, covered = picture.shown[i], picture.covered[i]
        first, last = _span(disc, radius, i, columns)
        for j in range(first, last):
            taken += np.int32((shown[j] == bead) & (covered[j] & own == 0))
            covered[j] |= own
    if kind != GRAY:
        _keep_from_outline(picture, disc)
    return float(taken / (np.pi * disc[2] * disc[2]))


@kernel
def _keep_from_outline(picture: Picture, disc: NDArray[np.float64]) -> None:
    """Keep gray beads from the outline of a coloured one."""
    columns = picture.shown.shape[1]
    outer, inner = disc[2] + _GRAY_RING_PX, max(disc[2] - _GRAY_RING_PX, 0.0)
    gray = np.uint8(1 << GRAY)
    first_row, last_row = _rows(disc, outer, picture.shown.shape[0])
    for i in range(first_row, last_row):
        covered = picture.covered[i]
        first, last = _span(disc, outer, i, columns)
        begin, end = _span(disc, inner, i, columns)
        if begin == end:
            begin, end = last, last
        for j in range(first, begin):
            covered[j] |= gray
        for j in range(end, last):
            covered[j] |= gray


@kernel
def _left_to_explain(picture: Picture, kind: int, disc: NDArray[np.float64]) -> float:
    """Share of a disc that shows the species, unexplained, less the share that shows floor."""
    columns, radius = picture.shown.shape[1], disc[2]
    own, bead, floor = np.uint8(1 << kind), np.uint8(kind), np.uint8(FLOOR)
    total = np.int32(0)
    first_row, last_row = _rows(disc, radius, picture.shown.shape[0])
    for i in range(first_row, last_row):
        shown, covered = picture.shown[i], picture.covered[i]
        first, last = _span(disc, radius, i, columns)
        for j in range(first, last):
            total += np.int32((shown[j] == bead) & (covered[j] & own == 0))
            total -= np.int32(shown[j] == floor)
    return float(total / (np.pi * radius * radius))
