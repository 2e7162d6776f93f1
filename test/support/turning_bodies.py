"""Gases in which beads have just merged into a body of a known shape and motion."""

from __future__ import annotations

import numpy as np
from gases import gas_of

# From the start to the merge.
MERGING = 0.25

# Moment of inertia of two beads of mass and radius 1 that touch, across the line of centres.
ROD = 2.0 * (0.4 + 1.0)


def rod(centre, velocity, across, **rules):
    """A gas of two beads that touch along x at the time `MERGING` and turn from then on.

    Both have mass and radius 1. Their centre is then at `centre`; `across` is the velocity of
    the second relative to the first, across the line of centres (y, z); the angular velocity is
    `across` / 1.4, see `ROD`, about -z and y... by the right-hand rule.
    """
    half = np.array([1.0, 0.0, 0.0])
    relative = np.array([-0.01, *across])
    positions, velocities = [], []
    for sign in (-1.0, 1.0):
        own = np.array(velocity) + 0.5 * sign * relative
        velocities.append(own)
        positions.append(np.array(centre) + sign * half - MERGING * own)
    rules = {'sticking_speed': 0.02, 'box': (20.0, 20.0, 20.0), **rules}
    return gas_of(positions, velocities, **rules)


def spin_of_rod(across):
    """Angular velocity of that rod: the angular momentum is half of 2 x across, times 1."""
    return np.array([0.0, -across[1], across[0]]) / ROD
