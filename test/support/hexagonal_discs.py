"""Dense clusters of equal discs."""

from __future__ import annotations

import math

import numpy as np


def hexagonal_patch(beads, radius):
    """Centres of equal discs in hexagonal order round one of them, (n, 2), [m]."""
    rings = math.ceil(math.sqrt(beads)) + 1
    i, j = (index.ravel() for index in np.mgrid[-rings : rings + 1, -rings : rings + 1])
    x, y = 2.0 * radius * (i + 0.5 * j), math.sqrt(3.0) * radius * j
    # Rounded, so that those equally near are taken in order round the centre.
    nearest = np.lexsort((np.arctan2(y, x), np.round((x**2 + y**2) / radius**2)))
    return np.column_stack((x, y))[nearest[:beads]]
