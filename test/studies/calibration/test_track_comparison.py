"""Tracks against a reference that differs in a known way."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.experiment.lens import Camera
from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.experiment.view import View
from nanorocks_ros.records import Tracks
from nanorocks_ros.studies.calibration.manual_tracks import ManualTracks
from nanorocks_ros.studies.calibration.track_comparison import (
    MarkedBeads,
    compare_tracks,
    manual_reference,
)

STEP_NS = 33_333_333


def _tracks(frames, ids=(0, 1, 2), shift=(0.0, 0.0), displacement=(0.0, 0.0)):
    """Three beads side by side that move 0.1 mm in each frame."""
    n = len(ids)
    for k in range(frames):
        start = np.column_stack([np.full(n, 1e-3 + 1e-4 * k), 2e-3 * np.arange(1, n + 1)])
        yield Tracks(
            stamp_ns=k * STEP_NS,
            tray=1,
            ids=np.array(ids, dtype=np.int32),
            species=np.zeros(n, dtype=np.int32),
            displacement=np.array(displacement),
            positions=start + shift,
            position_errors=np.full(n, 1e-6),
            velocities=np.zeros((n, 2)),
            velocity_errors=np.zeros(n),
            radii=np.full(n, 1e-3),
            radius_errors=np.full(n, 1e-6),
            seen=np.ones(n, dtype=bool),
            expected=np.array([n], dtype=np.int32),
        )


def _reference(tracks):
    return {
        record.stamp_ns: MarkedBeads(ids=record.ids.astype(np.int64), positions=record.positions)
        for record in tracks
    }


def test_tracks_agree_with_themselves():
    tracks = list(_tracks(10))
    comparison = compare_tracks(tracks, _reference(tracks), reach=5e-4)
    assert (comparison.beads, comparison.places, comparison.found) == (3, 30, 1.0)
    assert (comparison.links, comparison.links_correct, comparison.switches) == (27, 27, 0)
    assert comparison.rms_distance == 0.0
    assert comparison.speed_ratio == 1.0


def test_an_offset_is_measured_and_does_not_change_the_speed():
    shifted = list(_tracks(10, shift=(3e-5, -4e-5)))
    comparison = compare_tracks(shifted, _reference(_tracks(10)), reach=5e-4)
    assert comparison.offset == pytest.approx((3e-5, -4e-5))
    assert comparison.rms_distance == pytest.approx(5e-5)
    assert comparison.speed_ratio == pytest.approx(1.0)


def test_two_beads_that_swap_numbers_are_two_switches_and_two_wrong_links():
    tracks = [*list(_tracks(5)), *list(_tracks(10, ids=(1, 0, 2)))[5:]]
    comparison = compare_tracks(tracks, _reference(_tracks(10)), reach=5e-4)
    assert comparison.switches == 2
    assert comparison.links - comparison.links_correct == 2
    assert comparison.switches_per_minute == pytest.approx(2 / 3 / (9 * STEP_NS / 60e9))


def test_beads_that_were_not_seen_are_missing():
    fewer = list(_tracks(10, ids=(0, 1)))
    comparison = compare_tracks(fewer, _reference(_tracks(10)), reach=5e-4)
    assert comparison.found == pytest.approx(2 / 3)


def test_a_reference_of_other_pictures_is_refused():
    with pytest.raises(RecordingError, match='first-frame'):
        compare_tracks(list(_tracks(3)), {}, reach=1e-3)


def test_marks_in_a_bent_picture_that_moves_come_to_the_place_in_the_tray():
    camera = Camera(
        width=400, height=300, focal=(300.0, 300.0), centre=(205.0, 148.0),
        distortion=(-0.05, 0.01, 0.0, 0.0),
    )  # fmt: skip
    scale, region = 10_000.0, Region(60, 50, 200, 150)
    moved = (2e-4, -1e-4)
    tracks = list(_tracks(4, displacement=moved))
    marks, frames, ids = [], [], []
    for k, record in enumerate(tracks):
        straight = (record.positions + moved) * scale + (region.x, region.y)
        marks.append(camera.distorted(straight))
        frames.append(np.full(3, k + 1))
        ids.append(np.arange(3))
    manual = ManualTracks(np.concatenate(frames), np.concatenate(ids), np.concatenate(marks))
    reference = manual_reference(
        manual, tracks, range(4), region=region, pixels_per_metre=scale,
        view=View(camera=camera), first_frame=1,
    )  # fmt: skip
    assert len(reference) == 4
    comparison = compare_tracks(tracks, reference, reach=5e-4)
    assert comparison.found == 1.0
    assert comparison.rms_distance * scale < 0.01
