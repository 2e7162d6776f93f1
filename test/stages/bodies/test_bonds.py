"""Pairs of beads, picture by picture."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.bodies.bond_kernels import Beads, touching
from nanorocks_ros.stages.bodies.bonds import Pairs

RADIUS = 1e-3


def _beads(places):
    n = len(places)
    return Beads(
        ids=np.arange(n, dtype=np.int64),
        places=np.array(places, dtype=float),
        errors=np.full(n, 1e-6),
        radii=np.full(n, RADIUS),
        radius_errors=np.zeros(n),
        variances=np.full(n, 1e-6),
        height=4e-3,
    )


@pytest.mark.parametrize('odd', [0, 1])
def test_a_body_that_falls_apart_is_named_though_others_meet_meanwhile(odd):
    pairs = Pairs(lambda way, _: np.zeros_like(way))
    bonds, broken = [], []
    for number in range(60):
        # The first two meet in every other picture.
        apart = 2.0 * RADIUS if number % 2 == odd else 5e-3
        away = 0.0 if number < 30 else 4e-3
        places = [(0.0, 0.0), (apart, 0.0), (0.02, 0.0), (0.02 + 2.0 * RADIUS + away, 0.0)]
        new, fallen = pairs.push(number / 30.0, _beads(places), 0.5)
        bonds += [bond.ids for bond in new]
        broken += fallen
    assert (2, 3) in bonds
    assert broken == [(2, 3)]


def test_pairs_that_touch_are_those_found_one_by_one():
    rng = np.random.default_rng(3)
    beads = _beads(rng.uniform(0.0, 0.02, (60, 2)))
    keys, first, second = touching(beads)
    slack = 2.0 * np.sqrt(2.0) * 1e-6
    expected = [
        (i, j)
        for i in range(60)
        for j in range(i + 1, 60)
        if np.hypot(*(beads.places[j] - beads.places[i])) < 1.03 * 2.0 * RADIUS + slack
        and np.hypot(*(beads.places[j] - beads.places[i])) > -slack
    ]
    assert list(zip(first.tolist(), second.tolist(), strict=True)) == expected
    assert (np.diff(keys) > 0).all()
