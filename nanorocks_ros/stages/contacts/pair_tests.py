"""Whether two kinks were one collision of two beads, and of nobody else."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from nanorocks_ros.records import PairCollision

FAR = 4.0
"""Standard errors beyond which a contact is no such contact."""

LEAST_SIGNAL = 12.0
"""Least speed of a contact, in its errors: below, its own error bends the ratio."""

# Beads that go on together have merged.
_MERGED = 0.1


def only_these_two(pair: PairCollision) -> bool:
    """Whether they met, exchanged momentum along their line of centres, and with nobody else.

    And did not merge, which leaves them at rest to each other.
    """
    normal = pair.separation / math.hypot(*pair.separation)
    across = np.array([-normal[1], normal[0]])
    errors = np.hypot(pair.before_errors, pair.after_errors)
    change = pair.after - pair.before
    approach = -float((pair.before[1] - pair.before[0]) @ normal)
    error = float(np.hypot(*pair.before_errors))
    lost = pair.masses @ change
    lost_error = math.hypot(*(pair.masses * errors))
    slip = float((change[1] - change[0]) @ across)
    # A line of centres that is turned a little makes a slip of the change along it.
    turned = pair.separation_error / math.hypot(*pair.separation)
    slip_error = math.hypot(*errors, turned * float((change[1] - change[0]) @ normal))
    relative = [float(np.hypot(*(one[1] - one[0]))) for one in (pair.before, pair.after)]
    return bool(
        relative[1] > _MERGED * relative[0]
        and approach > LEAST_SIGNAL * error
        and float(lost @ lost) < FAR**2 * lost_error**2
        and abs(slip) < FAR * slip_error
    )
