"""Shares of tracked beads, against beads placed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import BeadsTruth, Tracks
from nanorocks_ros.studies.reproduction.campaign_truth import TrackSampler, tracked_shares

TRAY = load_trays()[7]
BEADS = np.array([[2e-3, 2e-3], [6e-3, 2e-3], [10e-3, 2e-3], [14e-3, 2e-3]])


def truth(species=(0, 0, 0, 1)):
    count = len(BEADS)
    return BeadsTruth(
        stamp_ns=0,
        tray=7,
        cycle=1,
        displacement=np.zeros(2),
        tray_velocity=np.zeros(2),
        positions=np.column_stack([BEADS, np.full(count, 1.5e-3)]),
        velocities=np.zeros((count, 3)),
        radii=np.full(count, 1e-3),
        species=np.array(species, dtype=np.int32),
        bodies=np.arange(count, dtype=np.int32),
    )


def tracks(positions, *, species=None, seen=None, stamp_ns=0, cycle=1):
    count = len(positions)
    return Tracks(
        stamp_ns=stamp_ns,
        tray=7,
        ids=np.arange(count, dtype=np.int32),
        species=np.zeros(count, dtype=np.int32) if species is None else species,
        displacement=np.zeros(2),
        positions=np.array(positions),
        position_errors=np.full(count, 1e-5),
        velocities=np.zeros((count, 2)),
        velocity_errors=np.zeros(count),
        radii=np.full(count, 1e-3),
        radius_errors=np.zeros(count),
        seen=np.ones(count, dtype=bool) if seen is None else seen,
        expected=np.array([25, 255], dtype=np.int32),
        cycle=cycle,
    )


def test_spots_of_the_background_raise_the_count_of_the_paper_but_find_no_bead():
    # Two beads found, one twice; a spot far from all; the third bead and the grain are not seen.
    places = [BEADS[0], BEADS[0] + 2e-4, BEADS[1] - 5e-4, (20e-3, 8e-3)]
    shares = tracked_shares(tracks(places), truth(), TRAY)
    assert shares == pytest.approx((4 / 3, 2 / 3, 2 / 3))


def test_grains_and_beads_that_are_only_predicted_do_not_count():
    places = [BEADS[0], BEADS[1], BEADS[3]]
    species = np.array([0, 0, 1], dtype=np.int32)
    seen = np.array([True, False, True])
    shares = tracked_shares(tracks(places, species=species, seen=seen), truth(), TRAY)
    assert shares == pytest.approx((1 / 3, 1 / 3, 0.0))
    assert tracked_shares(tracks(places), truth(), load_trays()[8]) is None


def test_the_sampler_keeps_two_images_a_second_after_the_shaking_event():
    sampler = TrackSampler()
    for k in range(60):
        sampler(tracks(BEADS, stamp_ns=k * 33_333_333, cycle=int(k >= 15)))
        sampler('another result')
    stamps = [stamp for _, stamp in sampler.tracks]
    assert stamps[0] == 15 * 33_333_333
    assert np.diff(stamps) == pytest.approx(0.5e9, abs=34e6)
