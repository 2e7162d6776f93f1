"""Mean speed from synthetic tracks of known speed, and from a film."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tracking_films import RATE, SCALE, pipeline_settings, tray_film

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Tracks
from nanorocks_ros.stages.tracking.mean_speed import mean_speed
from nanorocks_ros.stages.tracking.tracker import Tracker

PIXEL = 1.0 / SCALE


def _tracks(velocities, jitter, frames, seed=1, species=None):
    """Beads in free flight, with noise on their positions."""
    rng = np.random.default_rng(seed)
    n = len(velocities)
    start = rng.uniform(0.0, 0.01, (n, 2))
    species = np.zeros(n, dtype=np.int32) if species is None else species
    for k in range(frames):
        yield Tracks(
            stamp_ns=round(k / RATE * 1e9),
            tray=1,
            ids=np.arange(n, dtype=np.int32),
            species=species,
            displacement=np.zeros(2),
            positions=start + velocities * k / RATE + rng.normal(0.0, jitter, (n, 2)),
            position_errors=np.full(n, jitter),
            velocities=np.full((n, 2), np.nan),
            velocity_errors=np.full(n, np.nan),
            radii=np.full(n, 1e-3),
            radius_errors=np.full(n, 1e-5),
            seen=np.ones(n, dtype=bool),
            expected=np.bincount(species).astype(np.int32),
        )


@pytest.mark.parametrize('speed', [0.1e-3, 0.5e-3, 2e-3, 15e-3])
def test_the_speed_of_a_maxwellian_gas_does_not_depend_on_the_noise(speed):
    rng = np.random.default_rng(5)
    velocities = rng.normal(0.0, speed * np.sqrt(2.0 / np.pi), (400, 2))
    true = np.hypot(*velocities.T).mean()
    for jitter in (0.02 * PIXEL, 0.3 * PIXEL):
        estimate = mean_speed(list(_tracks(velocities, jitter, 90)), least_distance=1.5 * PIXEL)
        assert estimate.mean_projected_speed == pytest.approx(true, rel=0.03)


def test_resting_beads_do_not_move():
    estimates = [
        mean_speed(
            list(_tracks(np.zeros((40, 2)), 0.1 * PIXEL, 60, seed)), least_distance=1.5 * PIXEL
        )
        for seed in range(10)
    ]
    speeds = [estimate.mean_projected_speed for estimate in estimates]
    # The noise between frames alone would look like 5 px/s.
    assert np.mean(speeds) < 0.1 * PIXEL
    assert all(
        estimate.mean_projected_speed <= 4.0 * estimate.mean_projected_speed_error
        for estimate in estimates
    )


def test_each_species_has_a_speed_of_its_own():
    velocities = np.zeros((20, 2))
    velocities[:10, 0], velocities[10:, 1] = 2e-3, 6e-3
    species = np.repeat([0, 1], 10).astype(np.int32)
    tracks = list(_tracks(velocities, 0.05 * PIXEL, 30, species=species))
    for index, speed in ((0, 2e-3), (1, 6e-3)):
        estimate = mean_speed(tracks, least_distance=1.5 * PIXEL, species=index)
        assert estimate.mean_projected_speed == pytest.approx(speed, rel=0.03)
        assert estimate.beads == 10
    overall = mean_speed(tracks, least_distance=1.5 * PIXEL)
    assert overall.mean_projected_speed == pytest.approx(4e-3, rel=0.03)


def test_a_species_counts_whose_positions_are_far_better_or_worse_than_others():
    velocities = np.zeros((20, 2))
    velocities[:14, 0], velocities[14:, 1] = 2e-3, 6e-3
    species = np.repeat([0, 1], [14, 6]).astype(np.int32)
    for factor in (0.1, 10.0):
        tracks = [
            replace(record, position_errors=np.where(species, factor, 1.0) * 2e-6)
            for record in _tracks(velocities, 1e-6, 30, species=species)
        ]
        estimate = mean_speed(tracks, least_distance=1.5 * PIXEL)
        assert estimate.beads == 20
        assert estimate.mean_projected_speed == pytest.approx(3.2e-3, rel=0.01)


def test_a_speed_of_half_of_the_beads_is_not_reliable():
    tracks = list(_tracks(np.full((20, 2), 1e-3), 1e-6, 20))
    assert mean_speed(tracks, least_distance=PIXEL).reliable
    seen = np.arange(20) < 10
    half = [replace(record, seen=seen) for record in tracks]
    estimate = mean_speed(half, least_distance=PIXEL)
    assert (estimate.beads, estimate.share, estimate.reliable) == (10, 0.5, False)


def test_a_species_that_is_hidden_counts_by_its_number_in_the_tray():
    velocities = np.zeros((40, 2))
    velocities[:10, 0], velocities[10:, 1] = 2e-3, 6e-3
    species = np.repeat([0, 1], [10, 30]).astype(np.int32)
    seen = (np.arange(40) < 10) | (np.arange(40) % 2 == 0)
    tracks = [
        replace(record, seen=seen)
        for record in _tracks(velocities, 0.05 * PIXEL, 30, species=species)
    ]
    estimate = mean_speed(tracks, least_distance=1.5 * PIXEL)
    assert estimate.mean_projected_speed == pytest.approx(5e-3, rel=0.01)


def test_a_species_that_is_hardly_seen_is_no_sample_of_its_beads():
    velocities = np.zeros((40, 2))
    velocities[:10, 0], velocities[10:, 1] = 2e-3, 6e-3
    species = np.repeat([0, 1], [10, 30]).astype(np.int32)
    tracks = [
        replace(record, seen=np.arange(40) < 11)
        for record in _tracks(velocities, 0.05 * PIXEL, 30, species=species)
    ]
    estimate = mean_speed(tracks, least_distance=1.5 * PIXEL)
    # The only one seen stands for 1 / 0.3 beads.
    expected = (10 * 2e-3 + 6e-3 / 0.3) / (10 + 1 / 0.3)
    assert estimate.mean_projected_speed == pytest.approx(expected, rel=0.01)


def test_beads_count_that_are_seen_in_two_frames_of_three():
    velocities = np.zeros((20, 2))
    velocities[:10, 0], velocities[10:, 0] = 3e-3, 9e-3
    tracks = list(_tracks(velocities, 0.01 * PIXEL, 12))
    # The fast ones were lost and come back in the last two frames.
    slow = np.arange(20) < 10
    tracks = [*(replace(record, seen=slow) for record in tracks[:-2]), *tracks[-2:]]
    estimate = mean_speed(tracks, least_distance=PIXEL)
    assert estimate.window == pytest.approx(2.0 / RATE)
    assert estimate.mean_projected_speed == pytest.approx(6e-3, rel=0.01)


def test_fast_beads_that_are_lost_half_way_count_as_the_others():
    velocities = np.zeros((40, 2))
    velocities[:20, 0], velocities[20:, 0] = 3e-3, 9e-3
    tracks = list(_tracks(velocities, 0.01 * PIXEL, 12))
    # Half of the fast ones are not seen at the end.
    late = replace(tracks[-1], seen=np.arange(40) < 30)
    estimate = mean_speed([*tracks[:-1], late], least_distance=PIXEL)
    assert estimate.mean_projected_speed == pytest.approx(6e-3, rel=0.01)


@pytest.mark.parametrize('per_frame', [0.1, 0.2, 0.3])
def test_paths_with_many_deflections_are_as_long_as_they_are(per_frame):
    rng = np.random.default_rng(7)
    beads, frames, steps = 10_000, 7, 40
    speed = 4e-3
    angles = rng.uniform(0.0, 2.0 * np.pi, beads)
    places, position = [], np.zeros((beads, 2))
    for step in range(frames * steps):
        if step % steps == 0:
            places.append(position.copy())
        deflected = rng.random(beads) < per_frame / steps
        angles[deflected] = rng.uniform(0.0, 2.0 * np.pi, np.count_nonzero(deflected))
        position += speed / RATE / steps * np.column_stack([np.cos(angles), np.sin(angles)])
    flight = list(_tracks(np.zeros((beads, 2)), 1e-3 * PIXEL, frames))
    tracks = [
        replace(record, positions=place) for record, place in zip(flight, places, strict=True)
    ]
    estimate = mean_speed(tracks, least_distance=PIXEL)
    assert estimate.window == pytest.approx(2.0 / RATE)
    assert estimate.mean_projected_speed == pytest.approx(speed, rel=0.004)


def test_two_beads_or_two_frames_have_no_mean_speed():
    tracks = list(_tracks(np.full((5, 2), 1e-3), 1e-6, 20))
    assert mean_speed(tracks[:2], least_distance=PIXEL) is None
    assert mean_speed([], least_distance=PIXEL) is None
    few = list(_tracks(np.full((2, 2), 1e-3), 1e-6, 20))
    assert mean_speed(few, least_distance=PIXEL) is None


@pytest.mark.parametrize('speed', [0.5e-3, 7e-3])
def test_the_mean_speed_of_a_filmed_gas_is_right_within_five_percent(speed):
    tracker = Tracker(pipeline_settings(1), load_trays()[1])
    tracks, true, ratios = [], [], []
    for k, (image, truth) in enumerate(
        tray_film(1, 90, speed=speed, restitution=1.0, wall_restitution=1.0)
    ):
        if k > 7:
            tracks += tracker.push(image)
            true.append(np.hypot(*truth.velocities[:, :2].T).mean())
            estimate = mean_speed(tracks, least_distance=1.5 * PIXEL)
            if estimate is not None and len(tracks) > 30:
                frames = round(estimate.window * RATE)
                ratios.append(estimate.mean_projected_speed / np.mean(true[-frames - 1 :]))
    assert len(ratios) > 40
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.05)
