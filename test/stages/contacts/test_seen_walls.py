"""Walls that nobody described are where beads turn back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bead_paths import PIXEL, RATE, tracks_of

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.stages.contacts.seen_walls import seen_walls

TRAY = load_trays()[1]
TIME = np.arange(240) / RATE


def folded(start, speed, low, high):
    """Places of the centre of a bead of 2 mm that flies to and fro between two walls."""
    room = high - low - 2e-3
    return low + 1e-3 + np.abs((start + speed * TIME + room) % (2.0 * room) - room)


def test_walls_are_found_where_beads_turn_and_no_others():
    x = folded(0.001, 0.014, 0.004, 0.018)
    y = 0.001 + 0.0005 * TIME
    walls = seen_walls(
        list(tracks_of(np.stack([x, y], axis=1)[:, None], jitter=0.02 * PIXEL)), TRAY
    )
    assert walls.places[:2] == pytest.approx((0.004, 0.018), abs=3e-5)
    assert walls.turns[0] >= 1
    assert math.isnan(walls.places[2])
    assert math.isnan(walls.places[3])


def test_a_bead_that_turns_twice_shows_no_wall():
    x = folded(0.001, 0.003, 0.004, 0.018)[:150]
    y = np.full(x.size, 0.01)
    walls = seen_walls(
        list(tracks_of(np.stack([x, y], axis=1)[:, None], jitter=0.02 * PIXEL)), TRAY
    )
    assert not walls.any


def test_beads_that_turn_at_places_of_their_own_show_no_wall():
    """As in a crowd that rattles: each turns back from its neighbours."""
    turns = np.array([0.004, 0.008, 0.012, 0.016])
    x = turns[None, :] + 0.006 * np.abs(TIME[:, None] - 4.0)
    y = np.broadcast_to(np.linspace(0.004, 0.022, 4), x.shape)
    walls = seen_walls(list(tracks_of(np.stack([x, y], axis=2), jitter=0.02 * PIXEL)), TRAY)
    assert not walls.any
