"""Dense packings: beads enter small and grow during Monte Carlo moves.

Random sequential insertion jams at a filling factor of about one third. Here the beads that do
not fit enter at a fraction of their radius. Then all beads make random moves, and each bead that
is not yet of full size grows as far as its neighbours allow. Beads never overlap. Further
Metropolis moves at full size lead to the equilibrium of a hard-sphere fluid.

When beads lock each other in a tight box, a new attempt begins: all enter small, and grow more
slowly than before.

Tested by ``test/simulation/packing/test_random_placement.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, kernel
from nanorocks_ros.numerics.counter_rng import hashed
from nanorocks_ros.simulation.packing.cell_list import Packing, is_free
from nanorocks_ros.simulation.packing.monte_carlo import (
    adapt_steps,
    equilibrate,
    initial_steps,
    insert_at_random,
    metropolis_sweep,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Factor on the least squared distance: more than rounding, so that all gaps are positive.
_APART = 1.0 + 1e-12

# Tries of one size before a bead shrinks, and how often it may: 0.8^40 is 1/7500.
_TRIES = 100
_SHRINKS = 40

# Sweeps at full size, and additional moves for few beads. At a filling of 0.45 they displace a
# bead by 0.6 of its diameter, and the contact value is that of three times as many sweeps; waves
# of density longer than some 20 diameters would take more.
_LAST_SWEEPS = 300
_LAST_MOVES = 30_000

# A bead that cannot grow by the full step tries 1/2, 1/4, ... 1/2^8 of it, sweep by sweep: a
# large bead among small ones has no more room.
_PARTS = 8

# Size at which beads enter a new attempt, and largest growth per sweep in the first attempt; it
# is halved in each further one, since slower growth packs better.
_SMALL = 0.5
_PACE = 0.01

# No new attempt after this many moves: some seconds.
_MOST_MOVES = 6_000_000
# An attempt ends after this many sweeps (more for few beads), or earlier, when the missing size
# is more than this fraction of that at half the time.
_MOST_SWEEPS = 2000
_LITTLE_PROGRESS = 0.8
_FIRST_CHECK = 250
_FIRST_CHECK_MOVES = 20_000


@compiled
def grow_while_moving(packing: Packing, placed: int, key: np.uint64) -> bool:
    """Find positions for beads that are too dense for random sequential insertion.

    Parameters
    ----------
    packing : Packing
    placed : int
        Beads in the box: the last ones of the order. On failure their positions are
        restored.
    key : uint64

    Returns
    -------
    bool
        Whether all beads are in the box at full size, none touching another.
    """
    n = packing.radii.size
    before = packing.positions.copy()
    packing.apart[0] = _APART
    pace = 2.0 * _PACE
    moves = 0
    attempt = 0
    inside = placed
    while moves < _MOST_MOVES:
        enter_key, grow_key = hashed(key, 3 * attempt), hashed(key, 3 * attempt + 1)
        if insert_at_random(packing, inside, enter_key, _TRIES, _SHRINKS) < n:
            break
        # The first attempt continues from the present state, at the fastest pace.
        sweeps, lack = _grow(packing, 1.0 if attempt == 0 else pace, grow_key)
        if lack == 0.0:
            equilibrate(packing, hashed(key, 3 * attempt + 2), _LAST_SWEEPS + _LAST_MOVES // n)
            return _are_apart(packing)
        moves += sweeps * n
        pace *= 0.5
        attempt += 1
        _empty_box(packing)
        inside = 0
    _restore_positions(packing, before)
    return False


@compiled
def _grow(packing: Packing, pace: float, key: np.uint64) -> tuple[int, float]:
    """Move all beads and let them grow, until all have full size or growth stalls.

    Parameters
    ----------
    packing : Packing
    pace : float
        Most a bead may grow in a sweep, in its radius.
    key : uint64

    Returns
    -------
    sweeps : int
    lack : float
        What all beads lack of full size, in radii.
    """
    n = packing.radii.size
    steps, tallies = initial_steps(packing)
    max_sweeps = _MOST_SWEEPS + _MOST_MOVES // n
    check = _FIRST_CHECK + _FIRST_CHECK_MOVES // n + np.int64(1.0 / pace)
    lacked = np.inf
    lack = np.inf
    for sweep in range(1, max_sweeps + 1):
        metropolis_sweep(packing, steps, tallies, hashed(key, sweep))
        adapt_steps(packing, steps, tallies)
        lack = _grow_all(packing, pace, 1.0 / (1 << (1 + sweep % _PARTS)))
        if lack == 0.0:
            return sweep, lack
        if sweep == check:
            if lack > _LITTLE_PROGRESS * lacked:
                return sweep, lack
            lacked = lack
            check *= 2
    return max_sweeps, lack


@kernel
def _grow_all(packing: Packing, pace: float, part: float) -> float:
    """Let beads grow where there is room; returns the missing size of all beads, in radii.

    Parameters
    ----------
    packing : Packing
    pace : float
        Most a bead may grow, in its radius.
    part : float
        Of that, what it is offered when there is no room for it.
    """
    lack = 0.0
    for i in range(packing.radii.size):
        size, radius = packing.sizes[i], packing.radii[i]
        if size == radius:
            continue
        growth = pace * radius
        packing.sizes[i] = size + growth
        if growth >= radius - size:
            growth = radius - size
            packing.sizes[i] = radius
        if not is_free(packing, i):
            packing.sizes[i] = size + part * growth
            if not is_free(packing, i):
                packing.sizes[i] = size
        lack += 1.0 - packing.sizes[i] / radius
    return lack


@kernel
def _are_apart(packing: Packing) -> bool:
    """Whether no two beads touch."""
    touching = 0
    for i in range(packing.radii.size):
        if not is_free(packing, i):
            touching += 1
    return touching == 0


@kernel
def _empty_box(packing: Packing) -> None:
    """Empty the box and reset all beads to the small size."""
    for cell in range(packing.heads.size):
        packing.heads[cell] = -1
    for i in range(packing.radii.size):
        packing.sizes[i] = _SMALL * packing.radii[i]


@kernel
def _restore_positions(packing: Packing, positions: NDArray[np.float64]) -> None:
    """Restore stored positions."""
    for i in range(packing.radii.size):
        for axis in range(3):
            packing.positions[i, axis] = positions[i, axis]
