"""Beads that lie under others, and how many beads each one that is seen stands for.

Where a gas with little restitution gathers in crowds, its slow beads lie under others, so that
the mean speed of those seen is too high. The beads seen in a picture show at which places another
bead would be hidden. Around each bead seen they are a share p of all places. Of the beads there a
share s p is not seen, where s is the chance that a bead at such a place lies below. So each bead
seen stands for

    1 / (1 - s p)

beads, and s is such that the sum is the number of beads in the tray. Of two beads in line, either
may be the lower one: s is 1/2 at most, and less where no two beads fit above each other. Beads
that are missing beyond that are lost in some other way, which says nothing of where they are.

Beads that others hide in part are placed too badly to tell how far they moved. In the same way
the usable beads stand for these, too, but it is known how many they are.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.median import median_of
from nanorocks_ros.stages.tracking.displacements import usable_beads

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.displacements import TrackSeries

# Covered share of a bead above which it is not found (`tracking.min_visible_fraction`).
_HIDDEN = 0.7
# Radius of the surroundings of a bead, in radii; 2 or 4 changed mean speeds by less than 1 %.
_SURROUNDINGS = 3.0
# Largest chance to lie below, and to be placed badly, where a bead would be hidden.
_MAX_BELOW, _MAX_SPOILT = 0.5, 0.8
# Cells of the map in a radius, and most cells of a map; larger trays have no crowds to look for.
_CELLS = 4.0
_MOST_CELLS = 300_000
_HALVINGS = 30


@compiled
def bead_weights(
    series: TrackSeries,
    frame: int,
    species: int,
    expected: NDArray[np.int32],
    floor: tuple[float, float],
) -> tuple[NDArray[np.float64], float]:
    """How many beads of its species each usable bead of a frame stands for.

    Parameters
    ----------
    series : TrackSeries
    frame : int
    species : int
        Index of the species, or `ALL_SPECIES`.
    expected : ndarray of int32, (species,)
        Number of beads in the tray; 0 where it is not known.
    floor : tuple of 2 floats, [m]
        Its sides.

    Returns
    -------
    weights : ndarray (n,)
        Of each bead of the frame, at least 1; 1 of those that are not usable.
    hidden : float
        Share of the beads that lie under others, of the species with the largest share.
    """
    first, last = series.first[frame], series.first[frame + 1]
    weights = np.ones(last - first)
    seen = first + np.flatnonzero(series.seen[first:last])
    usable = usable_beads(series, frame, species)
    places = series.positions[seen] - series.displacements[frame]
    radii = series.radii[seen]
    largest_share = 0.0
    for kind in range(expected.size):
        own = np.flatnonzero(series.species[seen] == kind)
        good = usable[series.species[usable] == kind]
        if good.size == 0 or good.size >= expected[kind]:
            continue
        shares = hidden_shares(places, radii, own, floor)
        below = _chance(np.ones(own.size), shares, float(expected[kind]), _MAX_BELOW)
        of_seen = 1.0 / (1.0 - below * shares)
        largest_share = max(largest_share, 1.0 - own.size / np.sum(of_seen))
        is_good = np.searchsorted(seen[own], good)
        spoilt = _chance(of_seen[is_good], shares[is_good], np.sum(of_seen), _MAX_SPOILT)
        weights[good - first] = of_seen[is_good] / (1.0 - spoilt * shares[is_good])
    return weights, largest_share


@compiled
def _chance(
    weights: NDArray[np.float64], shares: NDArray[np.float64], count: float, largest: float
) -> float:
    """The chance s for which weights / (1 - s p) add up to a number of beads."""
    if np.sum(weights / (1.0 - largest * shares)) <= count:
        return largest
    low, high = 0.0, largest
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if np.sum(weights / (1.0 - middle * shares)) < count:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@compiled
def hidden_shares(
    places: NDArray[np.float64],
    radii: NDArray[np.float64],
    own: NDArray[np.int64],
    floor: tuple[float, float],
) -> NDArray[np.float64]:
    """Share of the places around some beads at which beads seen would hide such a bead.

    Parameters
    ----------
    places : ndarray (n, 2), [m]
        Of all beads seen, from the corner of the floor.
    radii : ndarray (n,), [m]
    own : ndarray of int64
        Rows of these beads.
    floor : tuple of 2 floats, [m]
        Its sides.

    Returns
    -------
    ndarray (own,)
        0 where the tray is too large for a map of it.
    """
    radius = median_of(radii[own])
    cell = radius / _CELLS
    columns, rows = math.ceil(floor[0] / cell), math.ceil(floor[1] / cell)
    shares = np.zeros(own.size)
    if not 0 < columns * rows <= _MOST_CELLS:
        return shares
    # Squares have the area of the discs that they stand for.
    half = round(0.5 * (math.sqrt(math.pi) * _CELLS - 1.0))
    wall = math.ceil(_CELLS)
    covered = _summed(_covered_cells(places, radii, cell, columns, rows))
    hidden = np.zeros((columns, rows), dtype=np.int32)
    enough = _HIDDEN * (2 * half + 1) ** 2
    for i in range(wall, columns - wall):
        for j in range(wall, rows - wall):
            hidden[i, j] = _sum_within(covered, i, j, half) > enough
    places_hidden = _summed(hidden)
    around = round(0.5 * (math.sqrt(math.pi) * _SURROUNDINGS * _CELLS - 1.0))
    for number, row in enumerate(own):
        i = min(max(int(places[row, 0] / cell), 0), columns - 1)
        j = min(max(int(places[row, 1] / cell), 0), rows - 1)
        # A bead lies at least a radius from the walls.
        wide = min(i + around, columns - wall - 1) - max(i - around, wall) + 1
        deep = min(j + around, rows - wall - 1) - max(j - around, wall) + 1
        if wide > 0 and deep > 0:
            shares[number] = _sum_within(places_hidden, i, j, around) / (wide * deep)
    return shares


@compiled
def _covered_cells(
    places: NDArray[np.float64], radii: NDArray[np.float64], cell: float, columns: int, rows: int
) -> NDArray[np.int32]:
    """1 where the middle of a cell lies on a bead, 0 elsewhere."""
    covered = np.zeros((columns, rows), dtype=np.int32)
    for k in range(radii.size):
        x, y, reach = places[k, 0] / cell - 0.5, places[k, 1] / cell - 0.5, radii[k] / cell
        for i in range(max(math.ceil(x - reach), 0), min(math.floor(x + reach), columns - 1) + 1):
            for j in range(max(math.ceil(y - reach), 0), min(math.floor(y + reach), rows - 1) + 1):
                if (i - x) * (i - x) + (j - y) * (j - y) <= reach * reach:
                    covered[i, j] = 1
    return covered


@compiled
def _summed(cells: NDArray[np.int32]) -> NDArray[np.int32]:
    """Sums of all cells before each corner of a cell."""
    sums = np.zeros((cells.shape[0] + 1, cells.shape[1] + 1), dtype=np.int32)
    for i in range(cells.shape[0]):
        of_column = 0
        for j in range(cells.shape[1]):
            of_column += cells[i, j]
            sums[i + 1, j + 1] = sums[i, j + 1] + of_column
    return sums


@compiled
def _sum_within(sums: NDArray[np.int32], i: int, j: int, half: int) -> int:
    """Sum of the cells at most `half` from a cell in each direction."""
    left, right = max(i - half, 0), min(i + half + 1, sums.shape[0] - 1)
    top, bottom = max(j - half, 0), min(j + half + 1, sums.shape[1] - 1)
    return int(sums[right, bottom] - sums[left, bottom] - sums[right, top] + sums[left, top])
