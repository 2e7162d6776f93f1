"""Distances of independent beads in a box, against draws of them."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.physics.ideal_gas import pair_probabilities

ROOM = np.array([0.030, 0.008])
SMALL = np.array([0.029, 0.007])


@pytest.mark.parametrize('second', [ROOM, SMALL], ids=['equal beads', 'two sizes'])
def test_probabilities_are_those_of_drawn_pairs(second):
    rng = np.random.default_rng(1)
    n = 200_000
    first_places = ROOM * (rng.random((n, 2)) - 0.5)
    second_places = second * (rng.random((n, 2)) - 0.5)
    edges = np.linspace(0.0, 0.032, 17)
    counts = np.histogram(np.linalg.norm(first_places - second_places, axis=1), edges)[0]
    expected = n * pair_probabilities(ROOM, second, edges)
    chi_square = ((counts - expected) ** 2 / expected).sum()
    assert chi_square < 16 + 4.0 * np.sqrt(2.0 * 16)


def test_every_pair_is_at_some_distance():
    longest = np.hypot(*ROOM)
    total = pair_probabilities(ROOM, ROOM, np.linspace(0.0, longest, 201)).sum()
    assert total == pytest.approx(1.0, abs=2e-4)


@pytest.mark.parametrize(
    ('room', 'edges', 'fault'),
    [
        (np.array([0.0, 0.01]), np.array([0.0, 1.0]), 'no room'),
        (ROOM, np.array([0.0, 2.0, 1.0]), 'do not rise'),
        (ROOM, np.array([-1.0, 1.0]), 'do not rise'),
    ],
)
def test_impossible_boxes_and_bins_are_refused(room, edges, fault):
    with pytest.raises(ConfigurationError, match=fault):
        pair_probabilities(room, ROOM, edges)
