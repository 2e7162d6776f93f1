"""Table of the latest contacts, for the contact duration.

A table with room for as many contacts as can matter: one older than the contact duration has
no effect, and its place is free.

Tested by ``test/simulation/engine/test_epochs.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined
from nanorocks_ros.simulation.engine.integer_width import as_int64

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Slots checked for a pair. The oldest is overwritten when none is free, so a contact is lost only
# when this many others in the same slots are more recent.
_PLACES = 16

_SCRAMBLE = np.uint64(0x9E3779B97F4A7C15)
_TOP = np.uint64(32)


@compiled
def new_contact_table(n: int, duration: float) -> NDArray[np.float64]:
    """A table for n beads; without a contact duration an empty one.

    Returns
    -------
    ndarray (room, 3)
        Both numbers of a pair, exact as floats, and the time [s] of its contact.
    """
    room = 0
    if duration > 0.0:
        room = 64
        while room < n // 4:
            room *= 2
        room += _PLACES
    return np.full((room, 3), -np.inf)


@inlined
def is_repeated(
    contacts: NDArray[np.float64], i: int, j: int, now: float, duration: float
) -> bool:
    """Whether a pair touched less than the duration ago; stores the present contact.

    Parameters
    ----------
    contacts : ndarray (room, 3)
    i, j : int
        i < j.
    now, duration : float, [s]
    """
    room = contacts.shape[0]
    if room == 0:
        return False
    pair = (as_int64(i) << as_int64(32)) | as_int64(j)
    rows = np.uint64(room - _PLACES - 1)
    first = as_int64(((np.uint64(pair) * _SCRAMBLE) >> _TOP) & rows)
    place = first
    oldest = np.inf
    for k in range(first, first + _PLACES):
        if contacts[k, 0] == i and contacts[k, 1] == j:
            last = contacts[k, 2]
            contacts[k, 2] = now
            return bool(now - last < duration)
        if contacts[k, 2] < oldest:
            oldest = contacts[k, 2]
            place = k
    contacts[place, 0] = i
    contacts[place, 1] = j
    contacts[place, 2] = now
    return False
