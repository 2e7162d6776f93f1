"""Track store of one species: flight, size and visibility of each track.

Tested by ``test/stages/tracking/test_tracker.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled, inlined, kernel
from nanorocks_ros.stages.tracking.linking.free_flight import (
    MAX_POINTS,
    extend_flight,
    median_square_speed,
)
from nanorocks_ros.stages.tracking.linking.link_probabilities import DetectedBeads

if TYPE_CHECKING:
    from numpy.typing import NDArray

CONFIRM_FRAMES = 3
"""Number of frames in which a new bead must be seen before it is reported."""

# Weight of a frame in the exponential mean of the speed.
_SPEED_WEIGHT = 0.1

ALIKE_RADII = 0.5
"""Length over which light, shadow and outline displace a bead by the same amount, in radii."""


class TrackStore(NamedTuple):
    """Arrays with one row for each track, and spare rows; lengths in pixels, times in seconds.

    Parameters
    ----------
    ids : ndarray of int32, (capacity,)
    last_seen : ndarray (capacity,), [s]
        Time of the last detection.
    hits : ndarray of int64, (capacity,)
        Number of detections.
    radii, radius_weights : ndarray (capacity,), [px], [1/px^2]
    radius_squares : ndarray (capacity,)
        Sum of the squared residuals of the radii, over their stated variances.
    independent_weights : ndarray (capacity,), [1/px^2]
        Weight of the radii as far as their errors are not those of the frame before.
    visible_shares : ndarray (capacity,)
        Share of the disc that was visible last, halved in each frame since.
    times, errors : ndarrays (capacity, MAX_POINTS)
        Of the current flight, newest first.
    positions : ndarray (capacity, MAX_POINTS, 2)
    flight_points : ndarray of int64, (capacity,)
        Number of positions of the flight.
    lines : ndarray (capacity, 9)
        See `fit_line`.
    """

    ids: NDArray[np.int32]
    last_seen: NDArray[np.float64]
    hits: NDArray[np.int64]
    radii: NDArray[np.float64]
    radius_weights: NDArray[np.float64]
    radius_squares: NDArray[np.float64]
    independent_weights: NDArray[np.float64]
    visible_shares: NDArray[np.float64]
    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    errors: NDArray[np.float64]
    flight_points: NDArray[np.int64]
    lines: NDArray[np.float64]


class LinkSettings(NamedTuple):
    """Number of beads of a species, and settings of the linking.

    Parameters
    ----------
    expected : int
        Number of beads in the tray.
    memory, window : float, [s]
        See `TrackingSettings`.
    """

    expected: int
    memory: float
    window: float


def allocate_tracks(capacity: int) -> TrackStore:
    """Allocate an uninitialised store for so many tracks."""
    return TrackStore(
        ids=np.empty(capacity, dtype=np.int32),
        last_seen=np.empty(capacity),
        hits=np.empty(capacity, dtype=np.int64),
        radii=np.empty(capacity),
        radius_weights=np.empty(capacity),
        radius_squares=np.empty(capacity),
        independent_weights=np.empty(capacity),
        visible_shares=np.empty(capacity),
        times=np.empty((capacity, MAX_POINTS)),
        positions=np.empty((capacity, MAX_POINTS, 2)),
        errors=np.empty((capacity, MAX_POINTS)),
        flight_points=np.empty(capacity, dtype=np.int64),
        lines=np.empty((capacity, 9)),
    )


@kernel
def append_detections(
    tracks: TrackStore,
    n_tracks: int,
    links: NDArray[np.int64],
    detected: DetectedBeads,
    visible_shares: NDArray[np.float64],
    time: float,
    settings: LinkSettings,
) -> None:
    """Append to each track the detection linked to it, if any.

    Parameters
    ----------
    tracks : TrackStore
        Its first `n_tracks` rows are in use.
    links : ndarray of int64, (n_tracks,)
        Index of the detection of each track, or -1.
    detected, visible_shares : DetectedBeads, ndarray (m,)
        Detections, and the visible share of the disc of each.
    time : float, [s]
    settings : LinkSettings
    """
    for k in range(n_tracks):
        j = links[k]
        if j < 0:
            tracks.visible_shares[k] *= 0.5
            continue
        tracks.flight_points[k] = extend_flight(
            tracks.times[k],
            tracks.positions[k],
            tracks.errors[k],
            tracks.flight_points[k],
            tracks.lines[k],
            time,
            detected.positions[j, 0],
            detected.positions[j, 1],
            detected.errors[j],
            settings.window,
        )
        _append_radius(tracks, k, detected.radii[j], detected.radius_errors[j])
        tracks.last_seen[k] = time
        tracks.visible_shares[k] = visible_shares[j]
        tracks.hits[k] += 1


@inlined
def _append_radius(tracks: TrackStore, k: int, radius: float, error: float) -> None:
    """Average a measured radius with those before.

    Light and outline are alike where the bead has hardly moved, and so is the error: only the
    part of the way to independence counts for the error of the mean.
    """
    weight = 1.0 / (error * error)
    total = tracks.radius_weights[k] + weight
    residual = radius - tracks.radii[k]
    tracks.radii[k] += residual * weight / total
    tracks.radius_weights[k] = total
    tracks.radius_squares[k] += weight * residual * (radius - tracks.radii[k])
    dx = tracks.positions[k, 0, 0] - tracks.positions[k, 1, 0]
    dy = tracks.positions[k, 0, 1] - tracks.positions[k, 1, 1]
    independent = min(math.sqrt(dx * dx + dy * dy) / (ALIKE_RADII * tracks.radii[k]), 1.0)
    tracks.independent_weights[k] += weight * independent


@compiled
def update_speed(tracks: TrackStore, n_tracks: int, speed: float) -> float:
    """Update the standard deviation of a velocity component, [px/s], from the median speed."""
    has_velocity = np.empty(n_tracks, dtype=np.bool_)
    any_velocity = False
    for k in range(n_tracks):
        has_velocity[k] = tracks.flight_points[k] >= 2 and tracks.hits[k] >= CONFIRM_FRAMES
        any_velocity |= has_velocity[k]
    if not any_velocity:
        return speed
    squared_speed = median_square_speed(tracks.lines[:n_tracks], has_velocity)
    # For a Maxwellian gas; the median is robust against wrong links.
    component = math.sqrt(squared_speed / (2.0 * math.log(2.0)))
    weight = 1.0 if component > speed else _SPEED_WEIGHT
    return speed + weight * (component - speed)


@kernel
def drop_tracks(
    tracks: TrackStore,
    n_tracks: int,
    links: NDArray[np.int64],
    time: float,
    settings: LinkSettings,
) -> int:
    """Drop tracks that were not confirmed, or not seen for too long; how many are left.

    `links` is -1 for tracks without a detection; changed.
    """
    surplus = -settings.expected
    for k in range(n_tracks):
        confirmed = tracks.hits[k] >= CONFIRM_FRAMES
        if links[k] < 0 and not (confirmed and time - tracks.last_seen[k] <= settings.memory):
            links[k] = _DROPPED
        surplus += confirmed and links[k] != _DROPPED
    # More tracks than beads: those lost for longest have reappeared under another number.
    for _ in range(surplus):
        longest_lost, lost = -math.inf, -1
        for k in range(n_tracks):
            if links[k] == -1 and time - tracks.last_seen[k] > longest_lost:
                longest_lost, lost = time - tracks.last_seen[k], k
        if lost < 0:
            break
        links[lost] = _DROPPED
    kept = 0
    for k in range(n_tracks):
        if links[k] != _DROPPED:
            if kept < k:
                _copy_track(tracks, k, kept)
            kept += 1
    return kept


_DROPPED = -2


@inlined
def _copy_track(tracks: TrackStore, source: int, target: int) -> None:
    tracks.ids[target] = tracks.ids[source]
    tracks.last_seen[target] = tracks.last_seen[source]
    tracks.hits[target] = tracks.hits[source]
    tracks.radii[target] = tracks.radii[source]
    tracks.radius_weights[target] = tracks.radius_weights[source]
    tracks.radius_squares[target] = tracks.radius_squares[source]
    tracks.independent_weights[target] = tracks.independent_weights[source]
    tracks.visible_shares[target] = tracks.visible_shares[source]
    tracks.flight_points[target] = tracks.flight_points[source]
    for k in range(9):
        tracks.lines[target, k] = tracks.lines[source, k]
    for k in range(tracks.flight_points[source]):
        tracks.times[target, k] = tracks.times[source, k]
        tracks.errors[target, k] = tracks.errors[source, k]
        tracks.positions[target, k, 0] = tracks.positions[source, k, 0]
        tracks.positions[target, k, 1] = tracks.positions[source, k, 1]


@kernel
def add_tracks(
    tracks: TrackStore,
    n_tracks: int,
    new: NDArray[np.bool_],
    detected: DetectedBeads,
    visible_shares: NDArray[np.float64],
    time: float,
    first_id: int,
    hits: int,
) -> int:
    """Begin a track with each new detection; return the number of tracks.

    Parameters
    ----------
    tracks, n_tracks, detected, visible_shares, time
        See `append_detections`; the capacity must suffice.
    new : ndarray of bool, (m,)
    first_id : int
        Number of the first new track.
    """
    first_row = n_tracks
    for j in range(new.size):
        if not new[j]:
            continue
        tracks.ids[n_tracks] = first_id + n_tracks - first_row
        tracks.last_seen[n_tracks], tracks.hits[n_tracks] = time, hits
        tracks.radii[n_tracks] = detected.radii[j]
        tracks.radius_weights[n_tracks] = 1.0 / (
            detected.radius_errors[j] * detected.radius_errors[j]
        )
        tracks.radius_squares[n_tracks] = 0.0
        tracks.independent_weights[n_tracks] = tracks.radius_weights[n_tracks]
        tracks.visible_shares[n_tracks], tracks.flight_points[n_tracks] = visible_shares[j], 1
        tracks.times[n_tracks, 0], tracks.errors[n_tracks, 0] = time, detected.errors[j]
        line = tracks.lines[n_tracks]
        line[0], line[3], line[4], line[7], line[8] = time, 0.0, 0.0, 0.0, 0.0
        line[5], line[6] = detected.errors[j] * detected.errors[j], math.inf
        for axis in range(2):
            tracks.positions[n_tracks, 0, axis] = detected.positions[j, axis]
            line[1 + axis] = detected.positions[j, axis]
        n_tracks += 1
    return n_tracks


@compiled
def update_tracks(
    tracks: TrackStore,
    n_tracks: int,
    links: NDArray[np.int64],
    detected: DetectedBeads,
    visible_shares: NDArray[np.float64],
    time: float,
    settings: LinkSettings,
    speed: float,
    first_id: int,
    hits: int,
) -> tuple[int, int, float]:
    """Update all tracks with the linked detections of the next frame.

    Returns
    -------
    int, int
        Number of tracks, and how many of them are new.
    float, [px/s]
        See `update_speed`.
    """
    new = np.ones(detected.radii.size, dtype=np.bool_)
    for k in range(n_tracks):
        if links[k] >= 0:
            new[links[k]] = False
    append_detections(tracks, n_tracks, links, detected, visible_shares, time, settings)
    speed = update_speed(tracks, n_tracks, speed)
    kept = drop_tracks(tracks, n_tracks, links, time, settings)
    n_tracks = add_tracks(tracks, kept, new, detected, visible_shares, time, first_id, hits)
    return n_tracks, n_tracks - kept, speed
