"""The queue of pending events: a tree of minima, eight children to a node.

Every bead has one pending event. The lowest level holds their times; each level above holds
the smallest time of each group of eight below, so one cache line answers for a group.

Tested by ``test/simulation/engine/test_epochs.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined

if TYPE_CHECKING:
    from numpy.typing import NDArray

# 8^12 beads fill more memory than any machine has.
_MOST_LEVELS = 12


@compiled
def new_queue(n: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """An empty queue for n beads.

    Returns
    -------
    times : ndarray (n_nodes,), [s]
        The pending times of the beads first, then the levels above; all infinite.
    levels : ndarray of int64, (n_levels + 1,)
        Where each level begins, and the end.
    """
    starts = np.zeros(_MOST_LEVELS + 1, dtype=np.int64)
    size = n
    level = 0
    while True:
        padded = (size + 7) // 8 * 8
        starts[level + 1] = starts[level] + padded
        level += 1
        if padded == 8:
            break
        size = padded // 8
    # One cache line of slack, so that groups start at the start of a line.
    memory = np.full(starts[level] + 8, np.inf)
    first = (64 - memory.ctypes.data % 64) % 64 // 8
    return memory[first : first + starts[level]], starts[: level + 1].copy()


@inlined
def smallest(times: NDArray[np.float64], start: int) -> float:
    """Smallest of the eight times from an index on."""
    a = times[start] if times[start] < times[start + 1] else times[start + 1]
    b = times[start + 2] if times[start + 2] < times[start + 3] else times[start + 3]
    c = times[start + 4] if times[start + 4] < times[start + 5] else times[start + 5]
    d = times[start + 6] if times[start + 6] < times[start + 7] else times[start + 7]
    a = a if a < b else b
    c = c if c < d else d
    return a if a < c else c


@inlined
def index_of(times: NDArray[np.float64], start: int, value: float) -> int:
    """Index of the first of eight times that equals a value."""
    for k in range(7):
        if times[start + k] == value:
            return start + k
    return start + 7


@inlined
def schedule(times: NDArray[np.float64], levels: NDArray[np.int64], i: int, time: float) -> None:
    """Set the pending time of a bead and update the tree."""
    times[i] = time
    node = i
    for level in range(1, levels.size - 1):
        node >>= 3
        least = smallest(times, levels[level - 1] + 8 * node)
        place = levels[level] + node
        if times[place] == least:
            return
        times[place] = least


@inlined
def earliest(times: NDArray[np.float64], levels: NDArray[np.int64]) -> int:
    """The bead with the earliest event; the lowest index at equal times."""
    top = levels.size - 2
    start = levels[top]
    node = index_of(times, start, smallest(times, start)) - start
    for level in range(top - 1, -1, -1):
        value = times[levels[level + 1] + node]
        node = index_of(times, levels[level] + 8 * node, value) - levels[level]
    return node
