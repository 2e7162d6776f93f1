"""Counts of how well beads are recognised follow from the tracks."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import NOTHING_WRONG, Quality, Tracks
from nanorocks_ros.stages.tracking.recognition_counts import RecognitionCounter

RADIUS = 0.001
TRAY = load_trays()[1]
FRAMES = 40
MAX_SPEED = 0.05


def tracks_at(frame, positions, *, speed=0.003, seen=None, quality=NOTHING_WRONG, first_id=0):
    count = len(positions)
    return Tracks(
        stamp_ns=frame * 33_000_000,
        tray=1,
        ids=np.arange(first_id, first_id + count, dtype=np.int32),
        species=np.zeros(count, dtype=np.int32),
        displacement=np.zeros(2),
        positions=np.asarray(positions, dtype=np.float64).reshape(count, 2),
        position_errors=np.full(count, 5e-6),
        velocities=np.tile([speed, 0.0], (count, 1)),
        velocity_errors=np.full(count, 1e-5),
        radii=np.full(count, RADIUS),
        radius_errors=np.full(count, 5e-6),
        seen=np.ones(count, dtype=bool) if seen is None else seen,
        expected=np.array([15], dtype=np.int32),
        quality=quality,
    )


def lattice(count, spacing=2.5 * RADIUS):
    columns = math.ceil(math.sqrt(count))
    return spacing * np.array([divmod(k, columns) for k in range(count)], dtype=np.float64)


def counts_of(records, tray=TRAY):
    counter = RecognitionCounter(tray)
    for tracks in records:
        counter.push(tracks, MAX_SPEED)
    return counter.counts()[0]


def test_nothing_is_counted_before_the_first_image():
    assert RecognitionCounter(TRAY).counts() == ()


def test_beads_that_move_are_seen_and_not_at_rest():
    counts = counts_of(tracks_at(k, lattice(15) + 1e-4 * k) for k in range(FRAMES))
    assert (counts.seen, counts.complete, counts.tracks) == (15.0, 1.0, 15)
    assert counts.track_length == FRAMES
    assert counts.at_rest == 0.0
    assert counts.overlapping == 0.0
    assert counts.near_limit == 0.0


def test_hidden_beads_are_tracked_but_not_seen():
    seen = np.arange(15) < 12
    counts = counts_of(tracks_at(k, lattice(15) + 1e-4 * k, seen=seen) for k in range(FRAMES))
    assert (counts.seen, counts.tracked, counts.complete) == (12.0, 15.0, 0.0)


def test_discs_that_only_jitter_are_at_rest():
    rng = np.random.default_rng(1)
    moving = np.arange(15)[:, None] < 5
    counts = counts_of(
        tracks_at(k, lattice(15) + moving * 1e-4 * k + rng.normal(0.0, 5e-6, (15, 2)))
        for k in range(FRAMES)
    )
    assert counts.at_rest == pytest.approx(10 / 15)


def test_discs_are_not_called_at_rest_from_short_tracks():
    counts = counts_of(tracks_at(k, lattice(3), first_id=3 * k) for k in range(FRAMES))
    assert math.isnan(counts.at_rest)
    assert counts.track_length == 1.0
    assert counts.tracks == 3 * FRAMES


def test_circles_on_a_rod_overlap_and_stacked_beads_may():
    rods = [tracks_at(k, lattice(9, spacing=RADIUS) + 1e-4 * k) for k in range(FRAMES)]
    assert counts_of(rods).overlapping == 1.0
    deep = replace(TRAY, dimensions=(0.015, 0.015, 0.005))
    assert counts_of(rods, deep).overlapping == 0.0


def test_speeds_near_the_limit_are_counted():
    fast = [tracks_at(k, lattice(15), speed=0.9 * MAX_SPEED) for k in range(10)]
    slow = [tracks_at(k, lattice(15)) for k in range(10, 40)]
    assert counts_of([*fast, *slow]).near_limit == pytest.approx(0.25)


def test_frames_of_a_wrong_scale_are_counted():
    records = [
        tracks_at(k, lattice(15), quality=Quality.WRONG_SCALE if k < 30 else Quality(0))
        for k in range(FRAMES)
    ]
    assert counts_of(records).wrong_scale == pytest.approx(0.75)


def test_a_tray_without_any_disc_has_none():
    counts = counts_of(tracks_at(k, np.empty((0, 2))) for k in range(3))
    assert (counts.seen, counts.tracks) == (0.0, 0)
    assert math.isnan(counts.track_length)


@pytest.mark.parametrize(('power', 'low', 'high'), [(1.0, 1.9, 2.1), (0.5, 0.7, 1.3)])
def test_displacements_tell_flight_from_diffusion(power, low, high):
    rng = np.random.default_rng(2)
    steps = 2e-4 * rng.normal(0.0, 1.0, (FRAMES, 15, 2))
    if power == 1.0:
        steps[:] = steps[0]
    paths = lattice(15) + np.cumsum(steps, axis=0)
    counts = counts_of(tracks_at(k, places) for k, places in enumerate(paths))
    assert low < counts.spread_exponent < high


def test_beads_at_rest_do_not_tell_flight_from_diffusion():
    rng = np.random.default_rng(3)
    counts = counts_of(
        tracks_at(k, lattice(15) + rng.normal(0.0, 5e-6, (15, 2))) for k in range(FRAMES)
    )
    assert math.isnan(counts.spread_exponent)
