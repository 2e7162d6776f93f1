"""Pairs of beads that may touch, against a search over all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.bodies.touching_pairs import SeenBeads, touching_pairs

RADIUS, ERROR = 1e-3, 1e-6


def _beads(positions, height):
    n = len(positions)
    return SeenBeads(
        ids=np.arange(n, dtype=np.int64),
        positions=positions,
        errors=np.full(n, ERROR),
        radii=np.full(n, RADIUS),
        radius_errors=np.zeros(n),
        variances=np.full(n, 1e-6),
        height=height,
    )


@pytest.mark.parametrize(('height', 'min_distance'), [(4e-3, 0.0), (2e-3, 2.0 * RADIUS / 1.03)])
def test_touching_pairs_equal_a_search_over_all_pairs(height, min_distance):
    positions = np.random.default_rng(3).uniform(0.0, 0.02, (200, 2))
    keys, first, second = touching_pairs(_beads(positions, height))
    slack = 2.0 * np.sqrt(2.0) * ERROR
    expected = [
        (i, j)
        for i in range(200)
        for j in range(i + 1, 200)
        if min_distance - slack
        < np.hypot(*(positions[j] - positions[i]))
        < 1.03 * 2.0 * RADIUS + slack
    ]
    assert len(expected) > 5
    assert list(zip(first.tolist(), second.tolist(), strict=True)) == expected
    assert (np.diff(keys) > 0).all()
