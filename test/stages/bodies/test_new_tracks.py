"""Tracks that begin: their rate, and which of them are double detections."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.records import Tracks
from nanorocks_ros.stages.bodies.new_tracks import NewTracks

RADIUS = 5e-4


def push_frame(new_tracks, columns):
    """Add a frame of beads; `columns` maps their numbers to positions along a line, [m]."""
    ids = np.array(sorted(columns))
    n = ids.size
    tracks = Tracks(
        stamp_ns=0,
        tray=1,
        ids=ids.astype(np.int32),
        species=np.zeros(n, dtype=np.int32),
        displacement=np.zeros(2),
        positions=np.array([(columns[track], 5e-3) for track in ids.tolist()]),
        position_errors=np.full(n, 4e-6),
        velocities=np.zeros((n, 2)),
        velocity_errors=np.full(n, 1e-5),
        radii=np.full(n, RADIUS),
        radius_errors=np.full(n, 1e-6),
        seen=np.ones(n, dtype=np.bool_),
        expected=np.array([n], dtype=np.int32),
    )
    new_tracks.push(tracks, ids)


def test_a_track_that_begins_on_another_is_a_double_detection():
    new_tracks = NewTracks()
    push_frame(new_tracks, {1: 2e-3, 2: 6e-3})
    push_frame(new_tracks, {1: 2e-3, 2: 6e-3, 3: 2.3e-3, 4: 9e-3})
    assert new_tracks.is_double_detection((3, 1))
    assert not new_tracks.is_double_detection((2, 4))
    assert new_tracks.rate(2.0) == 1.0


def test_tracks_and_double_detections_of_the_last_cycle_are_remembered():
    new_tracks = NewTracks()
    push_frame(new_tracks, {1: 2e-3, 2: 6e-3})
    push_frame(new_tracks, {1: 2e-3, 2: 6e-3, 3: 2.3e-3, 4: 9e-3, 5: 9.2e-3})
    new_tracks.next_cycle()
    push_frame(new_tracks, {1: 2e-3, 3: 2.3e-3, 4: 9e-3})
    assert new_tracks.rate(1.0) == 0.0
    assert new_tracks.is_double_detection((1, 3))
    new_tracks.next_cycle()
    # Numbers of tracks that ended a cycle ago do not come back; nothing is kept of them.
    push_frame(new_tracks, {1: 2e-3, 3: 2.3e-3})
    assert new_tracks.is_double_detection((1, 3))
    assert not new_tracks.is_double_detection((4, 5))
    assert new_tracks.rate(1.0) == 0.0
