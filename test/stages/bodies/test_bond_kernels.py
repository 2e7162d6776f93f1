"""Bonds between beads: which break, and which tracks only jump."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.bodies.bonds import Bond, BondFinder
from nanorocks_ros.stages.bodies.touching_pairs import SeenBeads

RADIUS, ERROR, STEP = 5e-4, 1e-5, 1.0 / 30.0


def _beads(positions):
    n = len(positions)
    return SeenBeads(
        ids=np.arange(n, dtype=np.int64),
        positions=np.array(positions),
        errors=np.full(n, ERROR),
        radii=np.full(n, RADIUS),
        radius_errors=np.zeros(n),
        variances=np.full(n, 1e-6),
        height=2.0 * RADIUS,
    )


def _pushed(finder, motion, start, frames):
    """New and broken bonds of beads that are at `motion(k)` in frame k."""
    bonds, broken = [], []
    for k in range(start, start + frames):
        bonds_now, broken_now = finder.push(k * STEP, _beads(motion(k)), 1.0)
        bonds += [bond.ids for bond in bonds_now]
        broken += broken_now
    return bonds, broken


@pytest.fixture
def finder():
    # So many encounters per metre that every pair that stays together is a bond.
    return BondFinder(1e6, lambda radii, _: np.full_like(radii, 1e6), 1.0)


@pytest.mark.parametrize(('speed', 'breaks'), [(0.0, False), (3e-3, True)])
def test_a_jump_within_a_cluster_keeps_a_bond_and_a_drift_breaks_it(finder, speed, breaks):
    def motion(k):
        jumped = 6e-4 if k >= 20 else 0.0
        return [(0.0, 0.0), (1e-3 + jumped + speed * STEP * max(k - 20, 0), 0.0)]

    bonds, broken = _pushed(finder, motion, 0, 60)
    assert bonds[0] == (0, 1)
    assert broken == ([(0, 1)] if breaks else [])


def test_an_added_bond_is_tracked_until_it_breaks(finder):
    far = [(0.0, 0.0), (1.8e-3, 0.0)]
    finder.push(0.0, _beads(far), 1.0)
    finder.add_bonds(0.0, _beads(far), [Bond((0, 1), 0.0, (1.8e-3, 0.0), 4e-5)])
    assert _pushed(finder, lambda _: far, 1, 30) == ([], [])
    _, broken = _pushed(finder, lambda k: [(0.0, 0.0), (1.8e-3 + 1e-4 * (k - 30), 0.0)], 31, 60)
    assert broken == [(0, 1)]


def test_a_pair_that_turned_first_says_since_when_it_is_beside_each_other():
    # Turns in space for 1.5 s, and keeps its separation from then on.
    finder = BondFinder(300.0, lambda radii, _: np.full_like(radii, 300.0), 0.75)
    bonds = []
    for k in range(120):
        angle = 2.0 * min(k * STEP, 1.5)
        distance = 1e-3 * (0.8 + 0.2 * np.cos(2.0 * angle))
        second = (distance * np.cos(angle), distance * np.sin(angle))
        beads = _beads([(0.0, 0.0), second])
        beads = beads._replace(variances=np.full(2, 9e-6), height=4.0 * RADIUS)
        bonds += finder.push(k * STEP, beads, 1e-5)[0]
    assert [bond.ids for bond in bonds] == [(0, 1)]
    (bond,) = bonds
    assert bond.start == pytest.approx(1.5, abs=0.2)
    assert bond.met == 0.0
    # Free beads would have covered 6 mm by then, and few of them would not have been parted.
    assert bond.met_chance < 0.05
