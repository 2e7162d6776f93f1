"""Stable sorting for compiled code: the same order with every version of every library."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray


@compiled
def rising(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Indices of the values from the smallest to the largest; equals keep their order."""
    order = np.empty(values.size, dtype=np.int64)
    for new in range(values.size):
        place = new
        while place > 0 and values[order[place - 1]] > values[new]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = new
    return order
