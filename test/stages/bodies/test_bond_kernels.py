"""Pairs of beads that are bodies: which come apart, and which only seem to."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.bodies.bond_kernels import Beads
from nanorocks_ros.stages.bodies.bonds import Bond, Pairs

RADIUS, ERROR, STEP = 5e-4, 1e-5, 1.0 / 30.0


def _beads(places):
    n = len(places)
    return Beads(
        ids=np.arange(n, dtype=np.int64),
        places=np.array(places),
        errors=np.full(n, ERROR),
        radii=np.full(n, RADIUS),
        radius_errors=np.zeros(n),
        variances=np.full(n, 1e-6),
        height=2.0 * RADIUS,
    )


def _pushed(pairs, motion, start, pictures):
    """Bonds and what broke of beads that are at `motion(k)` in picture k."""
    bonds, broken = [], []
    for k in range(start, start + pictures):
        new, gone = pairs.push(k * STEP, _beads(motion(k)), 1.0)
        bonds += [one.ids for one in new]
        broken += gone
    return bonds, broken


@pytest.fixture
def pairs():
    # Whatever stays is a body.
    return Pairs(lambda way, _: np.zeros_like(way))


@pytest.mark.parametrize(('speed', 'breaks'), [(0.0, False), (3e-3, True)])
def test_a_track_that_jumps_within_its_cluster_stays_and_one_that_flies_off_does_not(
    pairs, speed, breaks
):
    def motion(k):
        jumped = 6e-4 if k >= 20 else 0.0
        return [(0.0, 0.0), (1e-3 + jumped + speed * STEP * max(k - 20, 0), 0.0)]

    bonds, broken = _pushed(pairs, motion, 0, 60)
    assert bonds[0] == (0, 1)
    assert broken == ([(0, 1)] if breaks else [])


def test_a_pair_that_is_taken_in_is_followed_until_it_comes_apart(pairs):
    far = [(0.0, 0.0), (1.8e-3, 0.0)]
    pairs.push(0.0, _beads(far), 1.0)
    pairs.adopt(0.0, _beads(far), [Bond((0, 1), 0.0, (1.8e-3, 0.0), 4e-5)])
    assert _pushed(pairs, lambda _: far, 1, 30) == ([], [])
    _, broken = _pushed(pairs, lambda k: [(0.0, 0.0), (1.8e-3 + 1e-4 * (k - 30), 0.0)], 31, 60)
    assert broken == [(0, 1)]
