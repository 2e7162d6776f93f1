"""Tracks that begin: which are of beads found twice, and for how long that is known."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.records import Tracks
from nanorocks_ros.stages.bodies.new_tracks import Births

RADIUS = 5e-4


def see(births, places):
    """Show a picture of beads: their numbers, and where they are along a line [m]."""
    ids = np.array(sorted(places))
    n = ids.size
    tracks = Tracks(
        stamp_ns=0,
        tray=1,
        ids=ids.astype(np.int32),
        species=np.zeros(n, dtype=np.int32),
        displacement=np.zeros(2),
        positions=np.array([(places[one], 5e-3) for one in ids.tolist()]),
        position_errors=np.full(n, 4e-6),
        velocities=np.zeros((n, 2)),
        velocity_errors=np.full(n, 1e-5),
        radii=np.full(n, RADIUS),
        radius_errors=np.full(n, 1e-6),
        seen=np.ones(n, dtype=np.bool_),
        expected=np.array([n], dtype=np.int32),
    )
    births.push(tracks, ids)


def test_a_bead_that_appears_over_another_is_the_same_one():
    births = Births()
    see(births, {1: 2e-3, 2: 6e-3})
    see(births, {1: 2e-3, 2: 6e-3, 3: 2.3e-3, 4: 9e-3})
    assert births.one_bead((3, 1))
    assert not births.one_bead((2, 4))
    assert births.rate(2.0) == 1.0


def test_who_was_there_in_the_cycle_before_is_known_and_so_is_who_is_one_bead():
    births = Births()
    see(births, {1: 2e-3, 2: 6e-3})
    see(births, {1: 2e-3, 2: 6e-3, 3: 2.3e-3, 4: 9e-3, 5: 9.2e-3})
    births.next_cycle()
    see(births, {1: 2e-3, 3: 2.3e-3, 4: 9e-3})
    assert births.rate(1.0) == 0.0
    assert births.one_bead((1, 3))
    births.next_cycle()
    # Numbers of tracks that ended a cycle ago do not come back; nothing is kept of them.
    see(births, {1: 2e-3, 3: 2.3e-3})
    assert births.one_bead((1, 3))
    assert not births.one_bead((4, 5))
    assert births.rate(1.0) == 0.0
