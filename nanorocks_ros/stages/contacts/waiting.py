"""Turns of beads whose partner in the collision is not known yet."""

from __future__ import annotations

import math
from typing import NamedTuple

from nanorocks_ros.stages.contacts.checks import FAR
from nanorocks_ros.stages.contacts.flights import Meeting
from nanorocks_ros.stages.contacts.history import Kink

# How close or far two beads are at a quick look, over the sum of their radii.
_ABOUT = 0.3


class Waiting(NamedTuple):
    """A turn whose other bead has not turned yet, with plain numbers for a quick look.

    Parameters
    ----------
    kink : Kink
    when : Meeting
    slack : float, [s]
        By how much more or less another may have turned at the same time.
    line : tuple of 5 floats
        Flight before: time, place and velocity.
    """

    kink: Kink
    when: Meeting
    slack: float
    line: tuple[float, float, float, float, float]

    @classmethod
    def of(cls, kink: Kink, when: Meeting) -> Waiting:
        """A turn that is known now."""
        before = kink.before
        x, y = before.place.tolist()
        u, v = before.velocity.tolist()
        return cls(kink, when, FAR * when.error, (before.time, x, y, u, v))

    def near(self, other: Waiting, time: float) -> bool:
        """Whether the two beads were about a diameter apart."""
        start, x, y, u, v = self.line
        its_start, its_x, its_y, its_u, its_v = other.line
        since, its_since = time - start, time - its_start
        apart = math.hypot(its_x + its_u * its_since - x - u * since,
                           its_y + its_v * its_since - y - v * since)  # fmt: skip
        reach = self.kink.radius + other.kink.radius
        return (1.0 - _ABOUT) * reach < apart < (1.0 + _ABOUT) * reach
