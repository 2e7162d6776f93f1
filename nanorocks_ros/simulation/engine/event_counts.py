"""How many events of each kind there were.

Tested by ``test/simulation/test_shaken_tray.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from nanorocks_ros.simulation.engine.gas_state import (
    BREAK_UP,
    ELASTIC_PAIR,
    ELASTIC_WALL,
    FIX,
    MERGE,
    MISSED,
    PAIR,
    RENEWED,
    STALE,
    WALL,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class EventCounts:
    """How many events of each kind there were.

    Parameters
    ----------
    pair, wall, merge, fix : int
        Collisions of two beads, and of a bead with a wall; bodies that merged, and that stuck
        to a wall.
    elastic_pair, elastic_wall : int
        Collisions made elastic by the contact duration.
    stale, missed, renewed : int
        Events taken but void: the partner had moved on, or a graze rounded to a miss; lists
        renewed.
    break_up : int
        Beads that a contact released from their body.
    """

    pair: int
    wall: int
    merge: int
    fix: int
    elastic_pair: int
    elastic_wall: int
    stale: int
    missed: int
    renewed: int
    break_up: int

    @classmethod
    def of(cls, counts: NDArray[np.int64]) -> EventCounts:
        """Counts of events from those of a state, see `State.counts`."""
        values = counts.tolist()
        return cls(**{name: values[place] for name, place in _PLACES.items()})


_PLACES = {
    'pair': PAIR,
    'wall': WALL,
    'merge': MERGE,
    'fix': FIX,
    'elastic_pair': ELASTIC_PAIR,
    'elastic_wall': ELASTIC_WALL,
    'stale': STALE,
    'missed': MISSED,
    'renewed': RENEWED,
    'break_up': BREAK_UP,
}
