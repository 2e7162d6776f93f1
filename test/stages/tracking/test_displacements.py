"""Displacements between three frames against a calculation bead by bead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.records import Tracks
from nanorocks_ros.stages.tracking.displacements import (
    ALL_SPECIES,
    displacements_between,
    join_tracks,
    pair_displacements,
    position_noise,
)


def _frame(rng, number):
    """Some of 30 beads at random positions; some are hidden, one has a large position error."""
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
    """Position in the camera frame and variance of each usable bead, by its number."""
    own = tracks.seen & ((tracks.species == species) | (species == ALL_SPECIES))
    own &= tracks.position_errors <= 5.0 * np.median(tracks.position_errors[own])
    return {
        int(number): (tracks.positions[k] + tracks.displacement, tracks.position_errors[k] ** 2)
        for k, number in enumerate(tracks.ids)
        if own[k]
    }


@pytest.mark.parametrize('species', [ALL_SPECIES, 0, 1])
def test_displacements_are_of_the_beads_visible_in_all_three_frames(species):
    rng = np.random.default_rng(8)
    for _ in range(20):
        tracks = [_frame(rng, number) for number in range(3)]
        earlier, middle, later = (_usable(record, species) for record in tracks)
        common = sorted(earlier.keys() & middle.keys() & later.keys())
        distances, square, variance, position_variance = displacements_between(
            join_tracks(tracks), (2, 1, 0), species, 3e-12
        )
        assert distances.shape == (3, len(common))
        if not common:
            assert np.isnan(square)
            continue
        expected = np.array(
            [
                [np.hypot(*(a[number][0] - b[number][0])) for number in common]
                for a, b in ((later, middle), (middle, earlier), (later, earlier))
            ]
        )
        variances = [
            np.mean([record[k][1] for record in (earlier, middle, later)]) for k in common
        ]
        np.testing.assert_allclose(distances, expected, rtol=1e-12)
        assert square == pytest.approx(np.mean(expected[:2] ** 2))
        assert variance == pytest.approx(np.mean(np.minimum(variances, 3e-12)))
        assert position_variance == pytest.approx(np.median(variances))


@pytest.mark.parametrize('species', [ALL_SPECIES, 0, 1])
def test_pair_displacements_are_of_the_beads_visible_in_both_frames(species):
    rng = np.random.default_rng(9)
    for _ in range(20):
        tracks = [_frame(rng, number) for number in range(3)]
        earlier, later = (_usable(tracks[k], species) for k in (0, 2))
        common = sorted(earlier.keys() & later.keys())
        series = join_tracks(tracks)
        distances, rows = pair_displacements(series, 2, 0, species)
        paths = [np.linalg.norm(later[bead][0] - earlier[bead][0]) for bead in common]
        assert distances == pytest.approx(paths)
        assert series.ids[rows].tolist() == [common, common]
        assert np.all((rows >= series.first[[[2], [0]]]) & (rows < series.first[[[3], [1]]]))


def test_the_noise_is_unknown_without_three_frames_at_equal_intervals():
    rng = np.random.default_rng(9)
    tracks = [_frame(rng, number) for number in (0, 1, 5)]
    assert position_noise(join_tracks(tracks), ALL_SPECIES) == np.inf
    assert position_noise(join_tracks(tracks[:2]), ALL_SPECIES) == np.inf
    even = [replace(record, stamp_ns=33_000_000 * k) for k, record in enumerate(tracks)]
    assert position_noise(join_tracks(even), ALL_SPECIES) < np.inf
