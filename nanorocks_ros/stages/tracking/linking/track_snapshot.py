"""Snapshot of the confirmed tracks of a tray at one time.

Tested by ``test/stages/tracking/test_tracker.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, kernel
from nanorocks_ros.numerics.stable_sort import stable_argsort
from nanorocks_ros.stages.tracking.linking.motion_prediction import (
    MIN_RADIUS_VARIANCE,
    Walls,
    predict_one,
)
from nanorocks_ros.stages.tracking.linking.track_store import CONFIRM_FRAMES, TrackStore

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLUR_BIAS_PX2 = 1.0
"""Error of the radii of all beads of a film times their radius, [px^2].

Blur moves a curved outline by its variance over the diameter; over 31 films by drawn cameras and
by other code, biases have this rms, from 0.06 px at 17 px to 0.3 px at 3 to 4 px.
"""


class TrackSnapshot(NamedTuple):
    """Confirmed tracks at one time; lengths in pixels, NaN for an unknown velocity.

    Parameters
    ----------
    ids, species : ndarrays of int32, (n,)
    positions, velocities : ndarray (n, 2), [px], [px/s]
    errors, velocity_errors, radii, radius_errors : ndarray (n,)
    seen : ndarray of bool, (n,)
        Whether the bead is detected in this frame; positions of others are predictions.
    """

    ids: NDArray[np.int32]
    species: NDArray[np.int32]
    positions: NDArray[np.float64]
    errors: NDArray[np.float64]
    velocities: NDArray[np.float64]
    velocity_errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    seen: NDArray[np.bool_]


def allocate_snapshot(size: int) -> TrackSnapshot:
    """Allocate an uninitialised snapshot for so many beads."""
    # Nine arrays from a compiled function take ten times as long.
    return TrackSnapshot(
        np.empty(size, dtype=np.int32),
        np.empty(size, dtype=np.int32),
        np.empty((size, 2)),
        np.empty(size),
        np.empty((size, 2)),
        np.empty(size),
        np.empty(size),
        np.empty(size),
        np.empty(size, dtype=np.bool_),
    )


@kernel
def write_snapshot(
    tracks: TrackStore,
    n_tracks: int,
    time: float,
    walls: Walls,
    scaling: tuple[float, float],
    collisions: tuple[float, float],
    species: int,
    snapshot: TrackSnapshot,
    first: int,
) -> int:
    """Write the confirmed tracks.

    Parameters
    ----------
    tracks, n_tracks, time
        See `append_detections`.
    walls : Walls
    scaling : tuple of 2 floats
        Error of a seen position over that of its fit; and an error that all positions of a bead
        share, [px].
    collisions : tuple of 2 floats, [1/s], [px/s]
        Collision rate of a bead, and standard deviation of its change of velocity.
    species : int
    snapshot : TrackSnapshot
        Written from row `first` on.

    Returns
    -------
    int
        Row after the last one.
    """
    rate, velocity_change = collisions
    factor, systematic = scaling
    row = first
    for k in range(n_tracks):
        if tracks.hits[k] < CONFIRM_FRAMES:
            continue
        line = tracks.lines[k]
        seen = tracks.last_seen[k] == time
        if seen:
            x, y = tracks.positions[k, 0, 0], tracks.positions[k, 0, 1]
            error = factor * tracks.errors[k, 0]
        else:
            # Unseen collisions, uniformly distributed in time.
            dt = time - tracks.last_seen[k]
            collision_variance = (
                min(rate * dt, 1.0) * (velocity_change * dt) * (velocity_change * dt) / 3.0
            )
            x, y, variance = predict_one(line, tracks.radii[k], time, walls)
            error = math.sqrt(variance + collision_variance)
        has_velocity = abs(line[6]) < math.inf
        snapshot.ids[row], snapshot.species[row], snapshot.seen[row] = tracks.ids[k], species, seen
        snapshot.positions[row, 0], snapshot.positions[row, 1] = x, y
        snapshot.errors[row] = math.sqrt(error * error + systematic * systematic)
        for axis in range(2):
            snapshot.velocities[row, axis] = line[3 + axis] if has_velocity else np.nan
        snapshot.velocity_errors[row] = math.sqrt(line[6]) if has_velocity else np.nan
        snapshot.radii[row] = tracks.radii[k]
        # Residuals above the stated errors inflate that of the mean.
        inflation = max(tracks.radius_squares[k] / max(tracks.hits[k] - 1, 1), 1.0)
        shared = BLUR_BIAS_PX2 / tracks.radii[k]
        snapshot.radius_errors[row] = math.sqrt(
            inflation / tracks.independent_weights[k] + MIN_RADIUS_VARIANCE + shared * shared
        )
        row += 1
    return row


@compiled
def write_in_metres(
    snapshot: TrackSnapshot,
    metres_per_pixel: float,
    displacement: NDArray[np.float64],
    scaled: TrackSnapshot,
    seen: NDArray[np.int64],
) -> None:
    """Sort a snapshot by number, convert it to metres in the tray frame, and count.

    Parameters
    ----------
    snapshot : TrackSnapshot
    metres_per_pixel : float, [m/px]
    displacement : ndarray (2,), [m]
        Displacement of the tray.
    scaled : TrackSnapshot
        Written; as many rows of `snapshot` are used as it has.
    seen : ndarray of int64, (species,)
        Written: number of visible beads of each species.
    """
    seen[:] = 0
    order = stable_argsort(snapshot.ids[: scaled.ids.size])
    for row in range(order.size):
        k = order[row]
        scaled.ids[row], scaled.species[row] = snapshot.ids[k], snapshot.species[k]
        scaled.seen[row] = snapshot.seen[k]
        seen[snapshot.species[k]] += snapshot.seen[k]
        for axis in range(2):
            scaled.positions[row, axis] = (
                metres_per_pixel * snapshot.positions[k, axis] - displacement[axis]
            )
            scaled.velocities[row, axis] = metres_per_pixel * snapshot.velocities[k, axis]
        scaled.errors[row] = metres_per_pixel * snapshot.errors[k]
        scaled.velocity_errors[row] = metres_per_pixel * snapshot.velocity_errors[k]
        scaled.radii[row] = metres_per_pixel * snapshot.radii[k]
        scaled.radius_errors[row] = metres_per_pixel * snapshot.radius_errors[k]
