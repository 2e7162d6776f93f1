"""Distances between three pictures against the same made bead by bead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.records import Tracks
from nanorocks_ros.stages.tracking.displacements import ALL, distances_of, jitter_of, joined


def _picture(rng, number):
    """Some of thirty beads in any places, some hidden, one placed badly."""
    ids = np.sort(rng.choice(30, rng.integers(18, 26), replace=False)).astype(np.int32)
    n = ids.size
    errors = rng.uniform(1e-6, 2e-6, n)
    errors[rng.integers(n)] = 1e-4
    return Tracks(
        stamp_ns=33_000_000 * number,
        tray=1,
        ids=ids,
        species=(ids % 2).astype(np.int32),
        displacement=rng.normal(0.0, 1e-4, 2),
        positions=rng.uniform(0.0, 0.01, (n, 2)),
        position_errors=errors,
        velocities=np.full((n, 2), np.nan),
        velocity_errors=np.full(n, np.nan),
        radii=np.full(n, 1e-3),
        radius_errors=np.full(n, 1e-5),
        seen=rng.random(n) < 0.8,
        expected=np.array([15, 15], dtype=np.int32),
    )


def _usable(tracks, species):
    """Place past the camera and variance of each bead that is used, by its number."""
    own = tracks.seen & ((tracks.species == species) | (species == ALL))
    own &= tracks.position_errors <= 5.0 * np.median(tracks.position_errors[own])
    return {
        int(number): (tracks.positions[k] + tracks.displacement, tracks.position_errors[k] ** 2)
        for k, number in enumerate(tracks.ids)
        if own[k]
    }


@pytest.mark.parametrize('species', [ALL, 0, 1])
def test_distances_are_those_of_the_beads_seen_in_all_three_pictures(species):
    rng = np.random.default_rng(8)
    for _ in range(20):
        tracks = [_picture(rng, number) for number in range(3)]
        earlier, middle, later = (_usable(one, species) for one in tracks)
        common = sorted(earlier.keys() & middle.keys() & later.keys())
        found, square, variance, place_variance = distances_of(
            joined(tracks), (2, 1, 0), species, 3e-12
        )
        assert found.shape == (3, len(common))
        if not common:
            assert np.isnan(square)
            continue
        expected = np.array(
            [
                [np.hypot(*(a[number][0] - b[number][0])) for number in common]
                for a, b in ((later, middle), (middle, earlier), (later, earlier))
            ]
        )
        variances = [np.mean([one[k][1] for one in (earlier, middle, later)]) for k in common]
        np.testing.assert_allclose(found, expected, rtol=1e-12)
        assert square == pytest.approx(np.mean(expected[:2] ** 2))
        assert variance == pytest.approx(np.mean(np.minimum(variances, 3e-12)))
        assert place_variance == pytest.approx(np.median(variances))


def test_without_three_pictures_evenly_apart_nothing_is_known_of_the_jitter():
    rng = np.random.default_rng(9)
    tracks = [_picture(rng, number) for number in (0, 1, 5)]
    assert jitter_of(joined(tracks), ALL) == np.inf
    assert jitter_of(joined(tracks[:2]), ALL) == np.inf
    even = [replace(one, stamp_ns=33_000_000 * k) for k, one in enumerate(tracks)]
    assert jitter_of(joined(even), ALL) < np.inf
