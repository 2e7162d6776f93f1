"""Contact times of pairs and of walls at rest; delays count from now."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

TOUCHING = 1e-12  # |distance² - reach²| / reach² that is only rounding
RESTING = 1e-26  # b² / (distance² · speeds²) that is only rounding
MARGIN = 1.0 + 1e-9  # images looked at reach a little farther than the beads


@dataclass(frozen=True)
class Contact:
    """The next contact of bead i: with the image of bead `partner` that is shifted by `shift`.

    Without a shift, `partner` is a wall.
    """

    time: float
    delay: float
    i: int
    partner: int
    shift: np.ndarray | None = None

    @property
    def order(self):
        """First in time; at the same time the lower bead, its pairs before its walls."""
        return self.time, self.i, self.shift is None, self.partner


def pair_delay(apart, relative, reach, speeds_squared):
    """Delay until two beads `apart` are `reach` from each other and approach; inf if never."""
    b = apart @ relative
    if b >= 0.0:
        return math.inf
    distance_squared = apart @ apart
    c = distance_squared - reach**2
    touching = abs(c) <= TOUCHING * reach**2
    if touching and b**2 <= RESTING * distance_squared * speeds_squared:
        return math.inf
    if c <= 0.0:
        return 0.0
    discriminant = b**2 - (relative @ relative) * c
    if discriminant < 0.0:
        return math.inf
    return c / (-b + math.sqrt(discriminant))


def image_shifts(apart, relative, reach, window, periods):
    """Every shift of the second bead, by whole periods, that may bring it into reach.

    Parameters
    ----------
    window : (first, last) delay
    periods : length of the period of each axis, None for an axis that has walls
    """
    choices = []
    for axis, period in enumerate(periods):
        if period is None:
            choices.append([0.0])
            continue
        passed = [apart[axis] + relative[axis] * delay for delay in window]
        lowest = math.ceil((-reach * MARGIN - max(passed)) / period)
        highest = math.floor((reach * MARGIN - min(passed)) / period)
        choices.append([k * period for k in range(lowest, highest + 1)])
    return [np.array(shift) for shift in itertools.product(*choices)]


def next_of_pair(bodies, i, j, window, periods):
    """(delay, shift): the first contact of two beads in the window, over all their images."""
    first = math.inf, None
    apart = bodies.positions[j] - bodies.positions[i]
    relative = bodies.velocities[j] - bodies.velocities[i]
    if not relative.any():
        return first
    reach = bodies.radii[i] + bodies.radii[j]
    speeds_squared = (bodies.velocities[i] ** 2).sum() + (bodies.velocities[j] ** 2).sum()
    for shift in image_shifts(apart, relative, reach, window, periods):
        delay = pair_delay(apart + shift, relative, reach, speeds_squared)
        if delay < first[0]:
            first = delay, shift
    return first


def resting_wall_delay(clearance, approach):
    """Delay until a bead meets a wall at rest; inf if never.

    Parameters
    ----------
    clearance : free way between bead and wall, [m]
    approach : speed towards the wall, [m/s]
    """
    return max(clearance, 0.0) / approach if approach > 0.0 else math.inf
