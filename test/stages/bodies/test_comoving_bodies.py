"""Bodies that move together without a visible contact, and tracks that begin at bodies."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.sticking.chance_proximity import parting_rate
from nanorocks_ros.records import Tracks
from nanorocks_ros.stages.bodies.comoving_bodies import ComovingBodies
from nanorocks_ros.stages.bodies.reappearing_beads import ReappearingBeads
from nanorocks_ros.stages.bodies.touching_pairs import SeenBeads

TRAY = load_trays()[3]
RADIUS, ERROR, STEP = 5e-4, 1e-5, 1.0 / 30.0
# Two pairs of beads, with room for one bead between them.
BODY_OF = {0: 0, 1: 0, 2: 2, 3: 2}
POSITIONS = np.array([(0.0, 0.0), (1e-3, 0.0), (2.8e-3, 0.0), (3.8e-3, 0.0)])


def _bonds(drift, *, hidden):
    """Bonds found in 3 s at 1 mm/s; the bodies drift apart at a speed."""
    comoving = ComovingBodies(parting_rate(TRAY))
    rng = np.random.default_rng(1)
    bonds = []
    for k in range(90):
        time = k * STEP
        if not comoving.due(time):
            continue
        positions = POSITIONS + np.array([1e-3 * time, 0.0])
        positions += rng.normal(0.0, ERROR, (4, 2))
        positions[2:, 1] += drift * time
        beads = SeenBeads(
            ids=np.arange(4, dtype=np.int64),
            positions=positions,
            errors=np.full(4, ERROR),
            radii=np.full(4, RADIUS),
            radius_errors=np.zeros(4),
            variances=np.full(4, 1e-6),
            height=2e-3,
        )
        bonds += comoving.push(time, beads, BODY_OF, hidden, 1e-2)
    return bonds


def test_comoving_bodies_are_one_if_a_hidden_bead_may_lie_between():
    first = _bonds(0.0, hidden=True)[0]
    assert first.ids == (1, 2)
    assert first.offset == pytest.approx((1.8e-3, 0.0), abs=5 * ERROR)


def test_comoving_bodies_that_do_not_touch_are_two_without_hidden_beads():
    assert not _bonds(0.0, hidden=False)


def test_bodies_that_pass_each_other_are_two():
    assert not _bonds(5e-4, hidden=True)


def _tracks(ids, positions):
    n = len(ids)
    return Tracks(
        stamp_ns=0,
        tray=3,
        ids=np.array(ids, dtype=np.int32),
        species=np.zeros(n, dtype=np.int32),
        displacement=np.zeros(2),
        positions=np.array(positions),
        position_errors=np.full(n, ERROR),
        velocities=np.zeros((n, 2)),
        velocity_errors=np.full(n, 1e-5),
        radii=np.full(n, RADIUS),
        radius_errors=np.full(n, 1e-5),
        seen=np.ones(n, dtype=bool),
        expected=np.array([n], dtype=np.int32),
    )


def _attached(frames, members):
    """Attached beads in each frame; in the first frame no bodies are known."""
    reappearing = ReappearingBeads()
    attached = []
    for k, (ids, positions) in enumerate(frames):
        known = members if k else set()
        attached.append(
            reappearing.push(_tracks(ids, positions), np.array(ids, dtype=np.int64), known)
        )
    return attached


def test_a_track_that_begins_at_a_body_is_attached_until_it_moves_away():
    before = ([0, 1, 2], [(0.0, 0.0), (1e-3, 0.0), (9e-3, 0.0)])
    at_it = ([0, 1, 2, 7], [*before[1], (1.6e-3, 0.0)])
    apart = ([0, 1, 2, 7], [*before[1], (3e-3, 0.0)])
    attached = _attached([before, at_it, at_it, apart, at_it], {0, 1})
    assert attached == [(), ((7, 1),), ((7, 1),), (), ()]


def test_an_old_track_or_one_that_begins_at_a_single_bead_is_not_attached():
    before = ([0, 1], [(0.0, 0.0), (1e-3, 0.0)])
    later = ([0, 1, 7], [*before[1], (1.6e-3, 0.0)])
    assert _attached([later, later], {0, 1}) == [(), ()]
    assert _attached([before, later], set()) == [(), ()]
