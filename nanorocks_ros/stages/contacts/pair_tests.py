"""Tests that two velocity jumps are one collision of two beads without a third body.

Tested by ``test/stages/contacts/test_contact_finder.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.contacts.momentum_balance import MOST_MISSING, missing_momentum

if TYPE_CHECKING:
    from nanorocks_ros.records import PairCollision

MAX_SIGMAS = 4.0
"""Largest deviation, in standard errors, that a contact may have from its model."""

MIN_SIGNAL = 12.0
"""Smallest speed of a contact in its standard errors; below, the ratio of speeds is biased."""

# Ratio of the relative speeds after and before; beads below it have merged.
_MAX_MERGED_RATIO = 0.1


def is_isolated_collision(pair: PairCollision) -> bool:
    """Whether two beads approached, conserved momentum, and changed it along the normal only.

    The normal is the line of centres. Beads at relative rest afterwards have merged and fail.
    """
    normal = pair.separation / math.hypot(*pair.separation)
    tangent = np.array([-normal[1], normal[0]])
    errors = np.hypot(pair.before_errors, pair.after_errors)
    change = pair.after - pair.before
    approach = -float((pair.before[1] - pair.before[0]) @ normal)
    approach_error = float(np.hypot(*pair.before_errors))
    missing = missing_momentum(pair)
    slip = float((change[1] - change[0]) @ tangent)
    # An error in the direction of the normal turns part of the normal change into slip.
    normal_error = pair.separation_error / math.hypot(*pair.separation)
    slip_error = math.hypot(*errors, normal_error * float((change[1] - change[0]) @ normal))
    relative_speeds = [
        float(np.hypot(*(velocities[1] - velocities[0])))
        for velocities in (pair.before, pair.after)
    ]
    return bool(
        relative_speeds[1] > _MAX_MERGED_RATIO * relative_speeds[0]
        and approach > MIN_SIGNAL * approach_error
        and float(missing @ missing) < MOST_MISSING**2
        and abs(slip) < MAX_SIGMAS * slip_error
    )
