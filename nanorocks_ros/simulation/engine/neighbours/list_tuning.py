"""Sizes of neighbour lists and cells: skin, order of the beads, room.

Tested by ``test/simulation/engine/neighbours/test_neighbour_lists.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.simulation.engine.gas_state import (
    AHEAD,
    CELLS,
    HALF_SKIN,
    LARGEST_RADIUS,
    PER_CELL,
)
from nanorocks_ros.simulation.engine.neighbours.huge_pages import in_large_pages
from nanorocks_ros.simulation.engine.neighbours.neighbour_lists import (
    CELL_FULL,
    COMPLETE,
    LIST_FULL,
    build_lists,
    set_references,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.simulation.engine.gas_state import State
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules

# Fastest mean length of the lists at all densities, and fastest offset of the centre of a shell
# ahead of its bead (`python -m benchmarks engine`).
_WANTED = 6.0
_SKINS = 0.3, 2.5
AHEAD_OF_BEAD = 0.85
# Cell width over reach: slightly above 1, for the rounding of references.
_CELL_SLACK = 1.004
_FIRST_ROOM = 12
_FIRST_CELL_ROOM = 5
_CELLS_AROUND = 27
# Cells for each bead; more would be empty.
_MOST_CELLS = 4


def list_skin(radii: NDArray[np.float64], rules: Rules) -> float:
    """Skin of the neighbour lists, [m]; 0 when a periodic box is too small for lists."""
    sides = np.array(rules.sides)
    diameter = 2.0 * float(np.mean(radii))
    density = radii.size * diameter**3 / float(np.prod(sides))
    ratio = (_WANTED / (4.0 / 3.0 * np.pi * density)) ** (1.0 / 3.0) - 1.0
    skin = diameter * float(np.clip(ratio, *_SKINS))
    largest = 2.0 * float(radii.max())
    for axis in range(3):
        if rules.periodic[axis]:
            # Neighbours, two shells apart at most, are then always the nearest images.
            skin = min(skin, 0.49 * (0.5 * sides[axis] - largest))
    return skin if skin > 0.05 * diameter else 0.0


def z_order(positions: NDArray[np.float64], width: float) -> NDArray[np.int64]:
    """Order of the beads along a Z-order curve, so that neighbours are close in memory."""
    cells = np.floor((positions - positions.min(axis=0)) / width).astype(np.uint64)
    code = np.zeros(len(positions), dtype=np.uint64)
    for bit in range(21):
        for axis in range(3):
            bits = (cells[:, axis] >> np.uint64(bit)) & np.uint64(1)
            code |= bits << np.uint64(3 * bit + axis)
    return np.argsort(code, kind='stable')


def with_lists(state: State, rules: Rules, skin: float) -> State:
    """The state with neighbour lists and cells, filled."""
    n = state.rows.shape[0]
    sides = np.array(rules.sides)
    reach = state.reach.copy()
    width = (2.0 * reach[LARGEST_RADIUS] + skin) * _CELL_SLACK
    cells = np.maximum(1.0, np.floor(sides / width))
    excess = cells.prod() / (_MOST_CELLS * n + 64)
    if excess > 1.0:
        cells = np.maximum(1.0, np.floor(cells / excess ** (1.0 / 3.0)))
    reach[HALF_SKIN] = 0.5 * skin
    reach[CELLS : CELLS + 3] = cells
    reach[PER_CELL : PER_CELL + 3] = cells / sides
    reach[AHEAD] = AHEAD_OF_BEAD
    state = state._replace(reach=reach, references=np.zeros((n, 4), dtype=np.float32))
    state = _with_room(state, int(cells.prod()), _FIRST_ROOM, _FIRST_CELL_ROOM)
    set_references(state, rules)
    return rebuilt_lists(state, rules)


def rebuilt_lists(state: State, rules: Rules) -> State:
    """The state with all lists rebuilt, with as much room as they need."""
    room, cell_room = state.neighbours.shape[1] - 1, state.cells.shape[1] - 1
    while True:
        status = build_lists(state, rules)
        if status == COMPLETE:
            return in_large_pages(state)
        room += status == LIST_FULL
        cell_room += status == CELL_FULL
        state = _with_room(state, state.cells.shape[0], room, cell_room)


def _with_room(state: State, cells: int, room: int, cell_room: int) -> State:
    n = state.rows.shape[0]
    # All that a cell and those around it can hold, or all of the largest body.
    n_marked = n if state.masses.shape[1] > 1 else min(n, _CELLS_AROUND * cell_room)
    return state._replace(
        neighbours=np.zeros((n, 1 + room), dtype=np.int32),
        cells=np.zeros((cells, 1 + cell_room), dtype=np.int32),
        dirty=np.zeros(n_marked + 8, dtype=np.int32),
    )
