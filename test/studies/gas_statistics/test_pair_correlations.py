"""Pair correlations of ideal gases and of hard spheres."""

from __future__ import annotations

import numpy as np
import pytest
from small_gases import acrylic, tray_of

from nanorocks_ros.studies.gas_statistics.pair_correlations import (
    accessible_lengths,
    pair_correlations,
)
from nanorocks_ros.studies.gas_statistics.random_arrangements import Places, random_arrangements

TRAY = tray_of(acrylic(8), acrylic(12, low=0.001))


def ideal_frames(n, share=1.0, seed=1):
    """Beads that do not see each other, between the walls; a share of them is seen."""
    rng = np.random.default_rng(seed)
    species = np.repeat([0, 1], [8, 12]).astype(np.int32)
    frames = []
    for _ in range(n):
        rooms = np.array([accessible_lengths(TRAY, kind) for kind in species])
        radii = np.array([0.5 * TRAY.species[kind].diameter for kind in species])
        places = radii[:, np.newaxis] + rooms * rng.random((20, 2))
        seen = rng.random(20) < share
        frames.append(Places(places[seen], species[seen]))
    return frames


@pytest.mark.parametrize('share', [1.0, 0.6])
def test_an_ideal_gas_has_no_correlation_up_to_the_walls(share):
    """Also where a share of the beads is lost, each for itself."""
    n = 3000
    block = np.arange(n) // 150
    frames = ideal_frames(n, share)
    for pair in pair_correlations(frames, block, TRAY, frames):
        known = pair.error > 0.0
        sigmas = ((pair.value - 1.0) / pair.error)[known]
        assert known.sum() > 90
        assert np.sqrt((sigmas**2).mean()) == pytest.approx(1.0, abs=0.25)
        assert abs(sigmas.mean()) < 0.3


def test_beads_exclude_each_other_as_far_as_they_cannot_lie_one_above_the_other():
    random = random_arrangements(TRAY)
    pair = pair_correlations(random, np.arange(len(random)) // 20, TRAY, random)[0]
    # Centres are at most 1 mm apart in height, in a tray of 3 mm.
    nearest = np.sqrt(0.002**2 - 0.001**2)
    assert (pair.value[pair.distance < nearest - 5e-5] == 0.0).all()
    at_contact = (pair.distance > 0.002) & (pair.distance < 0.0022)
    assert pair.value[at_contact].mean() > 1.1
    np.testing.assert_allclose(pair.value, pair.random, atol=1e-9 + 0.02 * pair.random.max())


def test_pairs_of_two_species_are_told_apart():
    frames = [Places(np.array([[0.004, 0.004], [0.0055, 0.004], [0.010, 0.004]]),
                     np.array([0, 1, 0], dtype=np.int32))]  # fmt: skip
    own, mixed, other = pair_correlations(frames, np.zeros(1, dtype=np.int64), TRAY, frames)
    assert (own.species, mixed.species, other.species) == ((0, 0), (0, 1), (1, 1))
    assert own.distance[own.value > 0.0] == pytest.approx([0.006], abs=1e-4)
    assert mixed.distance[mixed.value > 0.0] == pytest.approx([0.0015, 0.0045], abs=1e-4)
    assert not other.value.any()
