"""Cell lists for beads of many sizes in a box.

There is one grid of cells for each factor of two in radius. The cells of a grid are at least as
wide as its largest bead. So a small bead checks few cells for large neighbours, and a large bead
few cells per grid.

Results do not depend on the cells; they only avoid tests of distant beads.

Tested by ``test/simulation/packing/test_random_placement.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined, kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

# The last grid takes all that is smaller than 1/128 of the largest bead.
GRIDS = 8

# Cells for a bead, and some to begin with: more would be empty and only cost time.
_CELLS_PER_BEAD = 2
_FEWEST_CELLS = 8
_WIDEN = 1.25
# Of the width of a cell: more than rounding.
_MARGIN = 1e-9


class Packing(NamedTuple):
    """Beads in a box with their present sizes.

    Parameters
    ----------
    sides : ndarray (3,), [m]
        Of the box.
    periodic : ndarray of bool, (3,)
    far : ndarray (3,), [m]
        A distance along an axis beyond this is shorter the other way round: half the side
        of a periodic axis, infinity between walls.
    apart : ndarray (1,)
        Square of the least distance of two beads, in squares of the sum of their sizes.
    order : ndarray of int64, (n,)
        The beads by rising radius.
    positions : ndarray (n, 3), [m]
        Of the beads that are in the cells; in [0, side) along a periodic axis.
    radii : ndarray (n,), [m]
        Full size of each bead, by which it keeps clear of the walls.
    sizes : ndarray (n,), [m]
        Radius of each bead so far, by which it keeps clear of others.
    grid_of : ndarray of int32, (n,)
        Grid of each bead.
    largest : ndarray (GRIDS,), [m]
        Largest radius of a grid; zero when it has no bead.
    counts : ndarray of int64, (GRIDS, 4)
        Cells along each axis, and number of the first cell.
    per_length : ndarray (GRIDS, 3), [1/m]
        Cells along each axis.
    heads : ndarray of int32, (n_cells,)
        First bead of each cell, or -1.
    links : ndarray of int32, (n,)
        Next bead of the same cell, or -1.
    """

    sides: NDArray[np.float64]
    periodic: NDArray[np.bool_]
    far: NDArray[np.float64]
    apart: NDArray[np.float64]
    order: NDArray[np.int64]
    positions: NDArray[np.float64]
    radii: NDArray[np.float64]
    sizes: NDArray[np.float64]
    grid_of: NDArray[np.int32]
    largest: NDArray[np.float64]
    counts: NDArray[np.int64]
    per_length: NDArray[np.float64]
    heads: NDArray[np.int32]
    links: NDArray[np.int32]


@compiled
def new_packing(
    radii: NDArray[np.float64],
    sides: NDArray[np.float64],
    periodic: NDArray[np.bool_],
    order: NDArray[np.int64],
) -> Packing:
    """An empty box, with beads of full size to be inserted.

    Parameters
    ----------
    radii : ndarray (n,), [m]
    sides : ndarray (3,), [m]
    periodic : ndarray of bool, (3,)
    order : ndarray of int64, (n,)
        The beads by rising radius.
    """
    n = radii.size
    grid_of, largest, beads = _grids(radii)
    counts = np.zeros((GRIDS, 4), dtype=np.int64)
    per_length = np.zeros((GRIDS, 3))
    total = 0
    for grid in range(GRIDS):
        if beads[grid] > 0:
            _divide(sides, 2.0 * largest[grid], beads[grid], counts[grid])
            for axis in range(3):
                per_length[grid, axis] = counts[grid, axis] / sides[axis]
            counts[grid, 3] = total
            total += counts[grid, 0] * counts[grid, 1] * counts[grid, 2]
    far = np.empty(3)
    for axis in range(3):
        far[axis] = 0.5 * sides[axis] if periodic[axis] else np.inf
    return Packing(
        sides=sides,
        periodic=periodic,
        far=far,
        apart=np.ones(1),
        order=order,
        positions=np.zeros((n, 3)),
        radii=radii,
        sizes=radii.copy(),
        grid_of=grid_of,
        largest=largest,
        counts=counts,
        per_length=per_length,
        heads=np.full(total, -1, dtype=np.int32),
        links=np.full(n, -1, dtype=np.int32),
    )


@compiled
def _grids(
    radii: NDArray[np.float64],
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.int64]]:
    """Grid of each bead, largest radius and number of beads of each grid."""
    limit = 0.0
    for i in range(radii.size):
        limit = max(limit, radii[i])
    grid_of = np.zeros(radii.size, dtype=np.int32)
    largest = np.zeros(GRIDS)
    beads = np.zeros(GRIDS, dtype=np.int64)
    for i in range(radii.size):
        grid = 0
        above = limit
        while grid < GRIDS - 1 and radii[i] <= 0.5 * above:
            above *= 0.5
            grid += 1
        grid_of[i] = grid
        beads[grid] += 1
        largest[grid] = max(largest[grid], radii[i])
    return grid_of, largest, beads


@compiled
def _divide(
    sides: NDArray[np.float64], width: float, beads: int, counts: NDArray[np.int64]
) -> None:
    """Divide a box into cells of at least a width, with a limit on their number."""
    max_cells = _FEWEST_CELLS + _CELLS_PER_BEAD * beads
    while True:
        product = 1.0
        for axis in range(3):
            counts[axis] = np.int64(min(max(sides[axis] / width, 1.0), 2.0 * max_cells))
            product *= counts[axis]
        if product <= max_cells:
            return
        width *= _WIDEN


@inlined
def _cell_along(packing: Packing, grid: int, axis: int, coordinate: float) -> int:
    place = math.floor(coordinate * packing.per_length[grid, axis])
    return int(min(max(place, 0), packing.counts[grid, axis] - 1))


@inlined
def cell_of(packing: Packing, i: int) -> int:
    """Number of the cell in which a bead lies."""
    grid, positions, counts = packing.grid_of[i], packing.positions, packing.counts
    x = _cell_along(packing, grid, 0, positions[i, 0])
    y = _cell_along(packing, grid, 1, positions[i, 1])
    z = _cell_along(packing, grid, 2, positions[i, 2])
    return int(counts[grid, 3] + (x * counts[grid, 1] + y) * counts[grid, 2] + z)


@inlined
def enter_cell(packing: Packing, cell: int, i: int) -> None:
    """Add a bead to a cell."""
    packing.links[i] = packing.heads[cell]
    packing.heads[cell] = i


@inlined
def leave_cell(packing: Packing, cell: int, i: int) -> None:
    """Remove a bead from its cell."""
    heads, links = packing.heads, packing.links
    k = heads[cell]
    if k == i:
        heads[cell] = links[i]
        return
    while links[k] != i:
        k = links[k]
    links[k] = links[i]


@kernel
def is_free(packing: Packing, i: int) -> bool:
    """Whether a bead overlaps no bead in the cells, at its present position and size."""
    for grid in range(GRIDS):
        if packing.largest[grid] > 0.0 and not _is_free_in(packing, i, grid):
            return False
    return True


@inlined
def _is_free_in(packing: Packing, i: int, grid: int) -> bool:
    """The same for the cells of one grid."""
    reach = packing.sizes[i] + packing.largest[grid]
    x, below_x, span_x = _cells_in_reach(packing, grid, 0, packing.positions[i, 0], reach)
    y, below_y, span_y = _cells_in_reach(packing, grid, 1, packing.positions[i, 1], reach)
    z, below_z, span_z = _cells_in_reach(packing, grid, 2, packing.positions[i, 2], reach)
    count_x, count_y, count_z, first = packing.counts[grid]
    for kx in range(span_x):
        plane = first + _visited_cell(x, kx, below_x, span_x, count_x) * count_y * count_z
        for ky in range(span_y):
            row = plane + _visited_cell(y, ky, below_y, span_y, count_y) * count_z
            for kz in range(span_z):
                j = packing.heads[row + _visited_cell(z, kz, below_z, span_z, count_z)]
                while j >= 0:
                    if j != i and _overlap(packing, i, j):
                        return False
                    j = packing.links[j]
    return True


@inlined
def _cells_in_reach(
    packing: Packing, grid: int, axis: int, coordinate: float, reach: float
) -> tuple[int, int, int]:
    """Cell of a coordinate, number of cells in reach below it, and in total."""
    count = packing.counts[grid, axis]
    per_length = packing.per_length[grid, axis]
    cell = _cell_along(packing, grid, axis, coordinate)
    first = math.floor((coordinate - reach) * per_length - _MARGIN)
    last = math.floor((coordinate + reach) * per_length + _MARGIN)
    if packing.periodic[axis]:
        if last - first >= count:
            first, last = 0, count - 1
    else:
        first, last = max(first, 0), min(last, count - 1)
    return cell, cell - first, last - first + 1


@inlined
def _visited_cell(cell: int, k: int, below: int, span: int, count: int) -> int:
    """The k-th cell to visit: from a bead's own upwards, then those below it.

    Most trials fail in the own cell, so this order saves 40 % of the time.
    """
    index = cell + (k if k < span - below else k - span)
    if index < 0:
        return index + count
    return index - count if index >= count else index


@inlined
def _overlap(packing: Packing, i: int, j: int) -> bool:
    """Whether two beads overlap."""
    square = 0.0
    for axis in range(3):
        d = packing.positions[j, axis] - packing.positions[i, axis]
        if d > packing.far[axis]:
            d -= packing.sides[axis]
        elif d < -packing.far[axis]:
            d += packing.sides[axis]
        square += d * d
    reach = packing.sizes[i] + packing.sizes[j]
    return bool(square < reach * reach * packing.apart[0])
