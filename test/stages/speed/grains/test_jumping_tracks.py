"""Tracks of grains that jump, or are hidden for long, are cut there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bead_paths import tracks_of

from nanorocks_ros.stages.speed.grains.jumping_tracks import JumpingTracks

SCALE = 10_000.0
STEP = 5e-5
BEADS = 20


def picture(number, *, moved=(), hidden=()):
    """Beads that move by half a pixel between pictures; some elsewhere, some hidden."""
    places = np.column_stack([1e-3 * np.arange(BEADS), np.full(BEADS, STEP * number)])
    for bead in moved:
        places[bead, 1] += 8e-4
    (tracks,) = tracks_of(places[np.newaxis])
    seen = ~np.isin(tracks.ids, hidden)
    return replace(tracks, seen=seen)


def numbers(pictures):
    """Number of the unbroken track of each bead in the last picture; -1 where it is hidden."""
    jumps = JumpingTracks(SCALE)
    for each in pictures:
        cut = jumps.cut(each)
    assert (np.diff(cut.ids) > 0).all()
    own = np.full(BEADS, -1)
    own[np.rint(cut.positions[:, 0] / 1e-3).astype(int)] = cut.ids
    return own


def test_steady_tracks_keep_their_numbers():
    assert numbers([picture(k) for k in range(5)]).tolist() == list(range(BEADS))


def test_a_track_that_jumps_begins_anew_there_and_when_it_comes_back():
    there = numbers([picture(0), picture(1), picture(2, moved=[3])])
    back = numbers([picture(0), picture(1), picture(2, moved=[3]), picture(3)])
    others = np.arange(BEADS) != 3
    assert (there[others] == np.flatnonzero(others)).all()
    assert there[3] == BEADS
    assert back[3] == BEADS + 1


@pytest.mark.parametrize(('pictures_hidden', 'keeps'), [(1, True), (2, True), (3, False)])
def test_a_bead_may_be_hidden_for_two_pictures(pictures_hidden, keeps):
    hidden = [picture(1 + k, hidden=[5]) for k in range(pictures_hidden)]
    after = numbers([picture(0), *hidden, picture(1 + pictures_hidden)])
    assert (after[5] == 5) == keeps


def test_hidden_beads_are_left_out():
    assert numbers([picture(0), picture(1, hidden=[0, 7])]).tolist().count(-1) == 2
