"""Where the beads that are followed should be in the next picture."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import inlined, kernel
from nanorocks_ros.stages.tracking.linking.link_probabilities import SLOWEST_PX_S
from nanorocks_ros.stages.tracking.linking.track_store import Followed

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIZE_FLOOR2 = 0.03**2
"""The size of a bead is measured with an error that pictures share, [px^2]."""


class Walls(NamedTuple):
    """The sides of a tray: smallest and largest place along columns and rows, (2,), [px]."""

    near: NDArray[np.float64]
    far: NDArray[np.float64]


@inlined
def predicted(
    line: NDArray[np.float64], radius: float, time: float, walls: Walls
) -> tuple[float, float, float]:
    """Where a line leads, and the variance of a coordinate; walls reflect."""
    after = time - line[0]
    moving = line[6] < math.inf
    spread = line[6] if moving else SLOWEST_PX_S * SLOWEST_PX_S
    x = _reflected(line[1] + (line[3] * after if moving else 0.0), radius, walls, 0)
    y = _reflected(line[2] + (line[4] * after if moving else 0.0), radius, walls, 1)
    return x, y, line[5] + spread * after * after


@inlined
def _reflected(place: float, radius: float, walls: Walls, axis: int) -> float:
    low, high = walls.near[axis] + radius, walls.far[axis] - radius
    # A bead may be a little beyond where its wall should be.
    if high > low and not low - 1.0 <= place <= high + 1.0:
        room = high - low
        place = low + abs((place - low + room) % (2.0 * room) - room)
    return place


@kernel
def predict(
    followed: Followed,
    time: float,
    walls: Walls,
    places: NDArray[np.float64],
    variances: NDArray[np.float64],
) -> None:
    """Where the first tracks should be, (n, 2), and the variance of a coordinate, (n,)."""
    for k in range(variances.size):
        x, y, variance = predicted(followed.lines[k], followed.radii[k], time, walls)
        places[k, 0], places[k, 1], variances[k] = x, y, variance


@kernel
def hint_at(
    followed: Followed,
    order: NDArray[np.int64],
    places: NDArray[np.float64],
    corner: NDArray[np.float64],
    least_error: float,
    hints: NDArray[np.float64],
) -> None:
    """Write where beads should be in a picture: column, row, radius and its error, (n, 4), [px].

    `order` says which comes first, `places` where each should be past the camera, `corner` where
    the first pixel is.
    """
    for row in range(order.size):
        k = order[row]
        hints[row, 0], hints[row, 1] = places[k, 0] - corner[0], places[k, 1] - corner[1]
        hints[row, 2] = followed.radii[k]
        error = math.sqrt(1.0 / followed.radius_weights[k] + SIZE_FLOOR2)
        hints[row, 3] = max(error, least_error)
