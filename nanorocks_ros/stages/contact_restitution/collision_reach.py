"""The sum of the radii of two beads, from the distances at which they collide in the picture.

In a container whose height nobody told collisions may be tilted out of the picture: the distance
is then shorter than the sum of the radii, and tells the tilt. That takes radii that are right to
a percent, which a diameter measured by hand is not. The largest distances are those of collisions
that are not tilted.

Tested by ``test/stages/contact_restitution/test_track_contacts.py``.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import PairCollision

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nanorocks_ros.records import Contact

ANY_HEIGHT = 2.0
"""Height of a container of unknown height, in diameters of the largest beads: a bead may be a
whole diameter above another, as far as it can be at a contact."""

# The distance of collisions that are not tilted is this quantile of all.
_QUANTILE = 0.9


def with_seen_reach(contacts: Iterable[Contact]) -> list[Contact]:
    """The contacts, collisions with the radii that their distances show.

    Parameters
    ----------
    contacts : iterable of Rebound or PairCollision
    """
    every = list(contacts)
    ratios = defaultdict(list)
    for contact in every:
        if isinstance(contact, PairCollision):
            ratios[_kinds(contact)].append(
                float(np.hypot(*contact.separation) / contact.radii.sum())
            )
    factors = {kinds: float(np.quantile(values, _QUANTILE)) for kinds, values in ratios.items()}
    return [
        replace(contact, radii=factors[_kinds(contact)] * contact.radii)
        if isinstance(contact, PairCollision)
        else contact
        for contact in every
    ]


def _kinds(collision: PairCollision) -> tuple[int, ...]:
    """The species of both beads."""
    return tuple(sorted(collision.species.tolist()))
