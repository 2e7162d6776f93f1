"""Which contacts and flights are those of beads that belonged to no body.

Tested by ``test/stages/restitution/test_cycles_that_stick.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.records import ContactOrFlight, PairCollision, Rebound

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from nanorocks_ros.records import Merge

# Error of the time of a merge, [ns]: the contact that made the body may be dated before it.
_MERGE_ERROR_NS = 100_000_000


def bound_since(merges: Iterable[Merge]) -> dict[int, int]:
    """Of each track that merged, since when its bead may belong to a body, [ns]."""
    since: dict[int, int] = {}
    for merge in merges:
        stamp_ns = merge.stamp_ns - _MERGE_ERROR_NS
        for track in merge.tracks.tolist():
            since[track] = min(stamp_ns, since.get(track, stamp_ns))
    return since


def is_free(contact: ContactOrFlight, since: Mapping[int, int]) -> bool:
    """Whether it is of beads that belonged to no body, or of a body as a whole.

    Beads of a body change their velocity without a contact where it turns, and rebound with the
    mass of all. Rebounds of bodies allow for that.

    Parameters
    ----------
    contact : Rebound, PairCollision or FreeFlight
    since : mapping of int to int
        From `bound_since`.
    """
    if isinstance(contact, PairCollision):
        tracks = contact.tracks.tolist()
    elif isinstance(contact, Rebound) and contact.beads > 1:
        return True
    else:
        tracks = [contact.track]
    return all(contact.stamp_ns < since.get(track, math.inf) for track in tracks)
