"""Random sequential insertion of beads in a box, and Metropolis moves.

References
----------
Widom 1966, J. Chem. Phys. 44, 3888: random sequential insertion, and where it jams.
Metropolis et al. 1953, J. Chem. Phys. 21, 1087: the moves.

Tested by ``test/simulation/packing/test_random_placement.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, kernel
from nanorocks_ros.numerics.counter_rng import hashed, uniform
from nanorocks_ros.simulation.packing.cell_list import (
    GRIDS,
    Packing,
    cell_of,
    enter_cell,
    is_free,
    leave_cell,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

# To what part a bead shrinks that found no place.
_SHRINK = 0.8

# Longest step along an axis at first and at least, in the largest radius of a grid. It is
# changed by a tenth whenever so many moves are known, until one in so many succeeds: at a
# filling of 0.45 beads then get three times as far in a second as when half of them do.
_FIRST_STEP = 0.3
_LEAST_STEP = 1e-3
_ADAPT = 1.1
_ENOUGH = 100
_ONE_IN = 5


@kernel
def insert_at_random(
    packing: Packing, placed: int, key: np.uint64, tries: int, shrinks: int
) -> int:
    """Insert beads at random positions, the largest first, without overlap.

    Parameters
    ----------
    packing : Packing
    placed : int
        How many are in the box already: the last ones of the order.
    key : uint64
    tries : int
        For one bead of one size.
    shrinks : int
        How often a bead that found no place may shrink and try again.

    Returns
    -------
    placed : int
        How many are in the box now.
    """
    n = packing.order.size
    counter = 0
    for k in range(n - 1 - placed, -1, -1):
        i = packing.order[k]
        tries_left, shrinks_left = tries, shrinks
        while True:
            if tries_left == 0:
                if shrinks_left == 0:
                    return n - 1 - k
                packing.sizes[i] *= _SHRINK
                tries_left = tries
                shrinks_left -= 1
            tries_left -= 1
            _draw_place(packing, i, key, counter)
            counter += 3
            if is_free(packing, i):
                break
        enter_cell(packing, cell_of(packing, i), i)
    return n


@kernel
def _draw_place(packing: Packing, i: int, key: np.uint64, counter: int) -> None:
    """Draw a random position of a bead, clear of the walls."""
    radius = packing.radii[i]
    for axis in range(3):
        if packing.periodic[axis]:
            coordinate = packing.sides[axis] * uniform(key, counter + axis)
        else:
            free = packing.sides[axis] - 2.0 * radius
            coordinate = radius + free * uniform(key, counter + axis)
        packing.positions[i, axis] = coordinate


@compiled
def equilibrate(packing: Packing, key: np.uint64, sweeps: int) -> None:
    """Equilibrate the beads by sweeps of random moves.

    The steps are adapted during the first half alone: with steps that do not depend on what
    happens, every arrangement of the beads becomes as likely as any other.
    """
    steps, tallies = initial_steps(packing)
    for sweep in range(sweeps):
        metropolis_sweep(packing, steps, tallies, hashed(key, sweep))
        if 2 * sweep < sweeps:
            adapt_steps(packing, steps, tallies)


@compiled
def initial_steps(packing: Packing) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Initial longest steps and empty tallies, see `metropolis_sweep`."""
    return _FIRST_STEP * packing.largest, np.zeros((GRIDS, 2), dtype=np.int64)


@kernel
def metropolis_sweep(
    packing: Packing,
    steps: NDArray[np.float64],
    tallies: NDArray[np.int64],
    key: np.uint64,
) -> None:
    """Attempt one random move of each bead.

    Parameters
    ----------
    packing : Packing
    steps : ndarray (GRIDS,), [m]
        Longest step along an axis, for the beads of each grid.
    tallies : ndarray of int64, (GRIDS, 2)
        Moves tried and done, counted on.
    key : uint64
    """
    positions = packing.positions
    for i in range(packing.radii.size):
        grid = packing.grid_of[i]
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        before = cell_of(packing, i)
        tallies[grid, 0] += 1
        if _step(packing, i, steps[grid], key) and is_free(packing, i):
            tallies[grid, 1] += 1
            after = cell_of(packing, i)
            if after != before:
                leave_cell(packing, before, i)
                enter_cell(packing, after, i)
        else:
            positions[i, 0], positions[i, 1], positions[i, 2] = x, y, z


@kernel
def _step(packing: Packing, i: int, longest: float, key: np.uint64) -> bool:
    """Displace a bead at random; False when it would cross a wall."""
    radius = packing.radii[i]
    for axis in range(3):
        side = packing.sides[axis]
        part = 2.0 * uniform(key, 3 * i + axis) - 1.0
        coordinate = packing.positions[i, axis]
        if packing.periodic[axis]:
            coordinate += part * min(longest, 0.5 * side)
            if coordinate < 0.0:
                coordinate += side
            if coordinate >= side:
                coordinate -= side
        else:
            coordinate += part * min(longest, 0.5 * side - radius)
            if coordinate < radius or coordinate > side - radius:
                return False
        packing.positions[i, axis] = coordinate
    return True


@kernel
def adapt_steps(packing: Packing, steps: NDArray[np.float64], tallies: NDArray[np.int64]) -> None:
    """Adapt the steps of each grid to its acceptance rate."""
    longest = max(packing.sides[0], packing.sides[1], packing.sides[2])
    for grid in range(GRIDS):
        tried, done = tallies[grid, 0], tallies[grid, 1]
        if tried < _ENOUGH:
            continue
        if _ONE_IN * done > tried:
            steps[grid] = min(steps[grid] * _ADAPT, longest)
        else:
            steps[grid] = max(steps[grid] / _ADAPT, _LEAST_STEP * packing.largest[grid])
        tallies[grid, 0] = 0
        tallies[grid, 1] = 0
