"""Huge memory pages for the state of a large gas."""

from __future__ import annotations

import mmap
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.simulation.engine.gas_state import State

_LINE = 64
_PAGE = 1 << 21
# Below this many bytes small pages cost nothing.
_LARGE = 1 << 21


def in_large_pages(state: State) -> State:
    """The state copied into one block of huge pages, where the system has them.

    Beads that collide next lie anywhere in memory; with small pages nearly every access misses
    the TLB. A small gas is returned unchanged.
    """
    arrays: tuple[NDArray[Any], ...] = state
    sizes = [-(-array.nbytes // _LINE) * _LINE for array in arrays]
    if sum(sizes) < _LARGE or not hasattr(mmap, 'MADV_HUGEPAGE'):
        return state
    memory = mmap.mmap(-1, sum(sizes) + _PAGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    memory.madvise(mmap.MADV_HUGEPAGE)
    octets = np.frombuffer(memory, dtype=np.uint8)
    place = -octets.ctypes.data % _PAGE
    moved = []
    for array, size in zip(arrays, sizes, strict=True):
        copy = octets[place : place + array.nbytes].view(array.dtype).reshape(array.shape)
        copy[...] = array
        moved.append(copy)
        place += size
    return type(state)(*moved)
