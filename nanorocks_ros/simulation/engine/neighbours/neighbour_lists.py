"""Neighbour lists: the beads that a bead can hit before it leaves the shell around its reference.

Lists are symmetric. A bead that leaves its shell gets a new list alone. Cells of
space, by reference position, give the candidates, so a bead changes its cell only then.
References are in single precision without loss of exactness: the shell is centred on the rounded
reference, and the reach of a list allows for the rounding of distances.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import inlined, kernel
from nanorocks_ros.simulation.engine.collision.aggregates import advance
from nanorocks_ros.simulation.engine.flight.pair_times import speed_square
from nanorocks_ros.simulation.engine.gas_state import (
    AHEAD,
    CELLS,
    FLAGS,
    HALF_SKIN,
    LARGEST_RADIUS,
    NEAR,
    PER_CELL,
    RADIUS,
    RENEWED,
    SLOT,
    SPECIES,
    VX,
    State,
    X,
)
from nanorocks_ros.simulation.engine.integer_width import as_index, as_int64

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules

# Relative to the reach; single precision of coordinates up to a thousand reaches.
_ROUNDING = 1e-3
_AT_ONCE = 4

# How building lists can end.
COMPLETE, CELL_FULL, LIST_FULL = range(3)


@inlined
def cells_along(state: State, axis: int) -> int:
    """Number of cells along an axis."""
    return as_int64(state.reach[CELLS + axis])


@inlined
def cell_along(state: State, axis: int, coordinate: float) -> int:
    """Index of the cell along an axis; positions outside belong to the outermost cell."""
    place = as_int64(math.floor(coordinate * state.reach[PER_CELL + axis]))
    return min(max(place, 0), cells_along(state, axis) - 1)


@inlined
def cell_of(state: State, i: int) -> int:
    """Cell of a bead's reference position."""
    x = cell_along(state, 0, np.float64(state.references[i, 0]))
    y = cell_along(state, 1, np.float64(state.references[i, 1]))
    z = cell_along(state, 2, np.float64(state.references[i, 2]))
    return (x * cells_along(state, 1) + y) * cells_along(state, 2) + z


@inlined
def enter_cell(state: State, i: int) -> bool:
    """Put a bead into its cell; False when the cell is full."""
    cells = state.cells
    cell = cell_of(state, i)
    last = cells[cell, 0] + 1
    if last == cells.shape[1]:
        return False
    cells[cell, last] = i
    cells[cell, 0] = last
    state.links[i, SLOT] = last
    return True


@inlined
def leave_cell(state: State, i: int) -> None:
    """Remove a bead from its cell; the last bead of the cell takes its slot."""
    cells = state.cells
    cell = cell_of(state, i)
    last = cells[cell, 0]
    moved = as_int64(cells[cell, last])
    slot = state.links[i, SLOT]
    cells[cell, slot] = moved
    state.links[moved, SLOT] = slot
    cells[cell, 0] = last - 1


@inlined
def set_reference(state: State, rules: Rules, i: int) -> None:
    """Make the present position of a bead its reference, folded into a periodic box."""
    near = 0
    half = state.reach[HALF_SKIN]
    speed = math.sqrt(speed_square(state.rows, i))
    per_speed = state.reach[AHEAD] * half / speed if speed > 0.0 else 0.0
    for axis in range(3):
        side = rules.sides[axis]
        at = state.rows[i, X + axis] + state.rows[i, VX + axis] * per_speed
        if rules.periodic[axis]:
            boxes = math.floor(at * rules.per_side[axis])
            if boxes != 0.0:
                at -= boxes * side
                state.rows[i, X + axis] -= boxes * side
                state.images[i, axis] += np.int32(boxes)
            room = 2.02 * (state.reach[LARGEST_RADIUS] + half)
        else:
            room = state.rows[i, RADIUS] + 1.01 * half
            if rules.moving:
                room += abs(rules.amplitude[axis])
        if at < room or at > side - room:
            near |= 3 << (2 * axis)
        state.references[i, axis] = np.float32(at)
    state.links[i, FLAGS] = (state.links[i, FLAGS] >> SPECIES) << SPECIES | near


@inlined
def remove_from_lists(state: State, i: int) -> None:
    """Remove a bead from the lists of its neighbours, and empty its own list."""
    neighbours = state.neighbours
    for k in range(1, neighbours[i, 0] + 1):
        j = as_int64(neighbours[i, k])
        last = neighbours[j, 0]
        place = 1
        while neighbours[j, place] != i:
            place += 1
        neighbours[j, place] = neighbours[j, last]
        neighbours[j, 0] = last - 1
    neighbours[i, 0] = 0


@inlined
def first_cell(rules: Rules, axis: int, cell: int, cells: int) -> int:
    """First cell along an axis that may hold neighbours, perhaps outside a periodic box."""
    if rules.periodic[axis]:
        return cell - 1 if cells >= 3 else 0
    return max(cell - 1, 0)


@inlined
def last_cell(rules: Rules, axis: int, cell: int, cells: int) -> int:
    """One after the last cell along an axis that may hold neighbours."""
    if rules.periodic[axis]:
        return cell + 2 if cells >= 3 else cells
    return min(cell + 2, cells)


@inlined
def wrapped(cell: int, cells: int) -> int:
    """A cell number within the box."""
    if cell < 0:
        return cell + cells
    if cell >= cells:
        return cell - cells
    return cell


@inlined
def collect_neighbours(state: State, rules: Rules, i: int) -> int:
    """Collect the beads that a bead can hit before either leaves its shell; may include itself.

    Returns
    -------
    int
        How many; they stand in ``state.dirty``. One more than can be neighbours, when there
        are more.
    """
    marked = state.dirty
    references = state.references
    total = np.uint64(collect_beads_nearby(state, rules, i))
    folded = state.links[i, FLAGS] & NEAR != 0
    x, y, z = references[i, 0], references[i, 1], references[i, 2]
    own_reach = np.float32(
        (state.rows[i, RADIUS] + 2.0 * state.reach[HALF_SKIN]) * (1.0 + _ROUNDING)
    )
    count = np.uint64(0)
    for k in range(total):
        j = as_index(marked[k])
        dx = references[j, 0] - x
        dy = references[j, 1] - y
        dz = references[j, 2] - z
        if folded:
            dx = minimum_image_single(rules, 0, dx)
            dy = minimum_image_single(rules, 1, dy)
            dz = minimum_image_single(rules, 2, dz)
        reach = own_reach + references[j, 3]
        marked[count] = j
        count += np.uint64(dx * dx + dy * dy + dz * dz < reach * reach)
    return as_int64(count)


@inlined
def minimum_image_single(rules: Rules, axis: int, difference: float) -> float:
    """Difference of coordinates to the nearest periodic image, single precision."""
    if rules.periodic[axis]:
        boxes = np.rint(difference * np.float32(rules.per_side[axis]))
        return difference - np.float32(rules.sides[axis]) * boxes
    return difference


@inlined
def collect_beads_nearby(state: State, rules: Rules, i: int) -> int:
    """Collect the beads of a cell and the cells around it in ``state.dirty``; returns how many."""
    marked = state.dirty
    cells = state.cells
    nx, ny, nz = cells_along(state, 0), cells_along(state, 1), cells_along(state, 2)
    cx = cell_along(state, 0, np.float64(state.references[i, 0]))
    cy = cell_along(state, 1, np.float64(state.references[i, 1]))
    cz = cell_along(state, 2, np.float64(state.references[i, 2]))
    total = np.uint64(0)
    for ix in range(first_cell(rules, 0, cx, nx), last_cell(rules, 0, cx, nx)):
        plane = wrapped(ix, nx) * ny
        for iy in range(first_cell(rules, 1, cy, ny), last_cell(rules, 1, cy, ny)):
            row = (plane + wrapped(iy, ny)) * nz
            for iz in range(first_cell(rules, 2, cz, nz), last_cell(rules, 2, cz, nz)):
                cell = np.uint64(row + wrapped(iz, nz))
                # Always copies four: the number in the cell cannot be predicted by the processor.
                for k in range(_AT_ONCE):
                    marked[total + np.uint64(k)] = cells[cell, np.uint64(1 + k)]
                held = np.uint64(cells[cell, 0])
                for k in range(_AT_ONCE, held):
                    marked[total + np.uint64(k)] = cells[cell, np.uint64(1 + k)]
                total += held
    return as_int64(total)


@inlined
def find_neighbours(state: State, rules: Rules, i: int, above: bool) -> bool:
    """Fill the list of a bead and enter it in those of its neighbours; False when one is full.

    Parameters
    ----------
    state : State
    rules : Rules
    i : int
    above : bool
        Only those with a higher number: for building all lists at once.
    """
    neighbours = state.neighbours
    capacity = neighbours.shape[1] - 1
    n_own = as_int64(neighbours[i, 0])
    for k in range(collect_neighbours(state, rules, i)):
        j = as_int64(state.dirty[k])
        if j == i or (above and j < i):
            continue
        n_others = neighbours[j, 0]
        if n_own == capacity or n_others == capacity:
            return False
        n_own += 1
        neighbours[i, n_own] = j
        neighbours[j, n_others + 1] = i
        neighbours[j, 0] = n_others + 1
    neighbours[i, 0] = n_own
    return True


@inlined
def renew(state: State, rules: Rules, i: int, now: float) -> bool:
    """Rebuild the list of a bead at its present position; False when a list or cell is full.

    The lists are then incomplete and must be built again, with more room.
    """
    advance(state, i, now)
    leave_cell(state, i)
    remove_from_lists(state, i)
    set_reference(state, rules, i)
    state.counts[RENEWED] += 1
    return find_neighbours(state, rules, i, False) and enter_cell(state, i)


@kernel
def build_lists(state: State, rules: Rules) -> int:
    """Build all lists from the present references; returns what was full, if anything."""
    state.cells[:, 0] = 0
    state.neighbours[:, 0] = 0
    n = state.rows.shape[0]
    for i in range(n):
        if not enter_cell(state, i):
            return CELL_FULL
    for i in range(n):
        if not find_neighbours(state, rules, i, True):
            return LIST_FULL
    return COMPLETE


@kernel
def set_references(state: State, rules: Rules) -> None:
    """Make the present position of every bead its reference."""
    for i in range(state.rows.shape[0]):
        set_reference(state, rules, i)
        state.references[i, 3] = np.float32(state.rows[i, RADIUS])
