"""Predicted positions of the tracks in the next frame.

Tested by ``test/stages/tracking/test_tracker.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined, kernel
from nanorocks_ros.numerics.stable_sort import stable_argsort
from nanorocks_ros.stages.tracking.linking.link_probabilities import MIN_VELOCITY_CHANGE_PX_S
from nanorocks_ros.stages.tracking.linking.track_store import TrackStore

if TYPE_CHECKING:
    from numpy.typing import NDArray

MIN_RADIUS_VARIANCE = 0.03**2
"""Variance of a radius from errors that all frames share, [px^2]."""


class Walls(NamedTuple):
    """Walls of a tray: lowest and highest position along columns and rows, (2,), [px]."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]


@inlined
def predict_one(
    line: NDArray[np.float64], radius: float, time: float, walls: Walls
) -> tuple[float, float, float]:
    """Extrapolate a line, with reflection at walls: position and variance of a coordinate."""
    dt = time - line[0]
    has_velocity = line[6] < math.inf
    velocity_variance = (
        line[6] if has_velocity else MIN_VELOCITY_CHANGE_PX_S * MIN_VELOCITY_CHANGE_PX_S
    )
    x = _reflect(line[1] + (line[3] * dt if has_velocity else 0.0), radius, walls, 0)
    y = _reflect(line[2] + (line[4] * dt if has_velocity else 0.0), radius, walls, 1)
    return x, y, line[5] + velocity_variance * dt * dt


@inlined
def _reflect(position: float, radius: float, walls: Walls, axis: int) -> float:
    lowest, highest = walls.low[axis] + radius, walls.high[axis] - radius
    # Allow for an error of 1 px in the position of a wall.
    if highest > lowest and not lowest - 1.0 <= position <= highest + 1.0:
        width = highest - lowest
        position = lowest + abs((position - lowest + width) % (2.0 * width) - width)
    return position


@kernel
def predict(
    tracks: TrackStore,
    time: float,
    walls: Walls,
    positions: NDArray[np.float64],
    variances: NDArray[np.float64],
) -> None:
    """Predict the positions of the first n tracks, (n, 2), and their variances, (n,)."""
    for k in range(variances.size):
        x, y, variance = predict_one(tracks.lines[k], tracks.radii[k], time, walls)
        positions[k, 0], positions[k, 1], variances[k] = x, y, variance


@compiled
def write_hints(
    tracks: TrackStore,
    time: float,
    walls: Walls,
    least_error: float,
    positions: NDArray[np.float64],
    variances: NDArray[np.float64],
    hints: NDArray[np.float64],
) -> None:
    """Predict the first n tracks, as `predict`, and write hints for their detection.

    Hints are column, row, radius and its error, (n, 4), [px]. Beads with the largest visible share
    come first: they lie on top.
    """
    count = variances.size
    predict(tracks, time, walls, positions, variances)
    order = stable_argsort(-tracks.visible_shares[:count])
    for row in range(count):
        k = order[row]
        hints[row, 0] = positions[k, 0] - walls.low[0]
        hints[row, 1] = positions[k, 1] - walls.low[1]
        hints[row, 2] = tracks.radii[k]
        error = math.sqrt(1.0 / tracks.radius_weights[k] + MIN_RADIUS_VARIANCE)
        hints[row, 3] = max(error, least_error)
