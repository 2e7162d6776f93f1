"""Which speeds are given out: by the setting, and by how reliable the tracks are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Measured, Quality, SpeedEstimate, SpeedMethod, Tracks
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.stages.speed.speed_selector import SpeedSelector
from nanorocks_ros.stages.speed.track_reliability import TrackReliability

NS = 1_000_000_000
TRAY = load_trays()[1]


def speed(time, method, value=1e-3, error=1e-5):
    return SpeedEstimate(
        stamp_ns=round(time * NS),
        tray=1,
        cycle=1,
        cycle_start_ns=0,
        mean_projected_speed=Measured(value, error),
        window=0.1,
        method=method,
    )


def by_tracks(time, **values):
    return speed(time, SpeedMethod.TRACKING, **values)


def by_structure(time, **values):
    return speed(time, SpeedMethod.STRUCTURE_FUNCTION, **values)


def selector(method='auto', crowded=False):
    settings = with_values(PipelineSettings(), {'speed.method': method}, 'test')
    tracks = TrackReliability(TRAY, crowded=crowded)
    return SpeedSelector(settings.speed, tracks), tracks


def seen_tracks(count):
    """Tracks of so many beads, all of them seen."""
    return Tracks(
        stamp_ns=0,
        tray=1,
        ids=np.arange(count, dtype=np.int32),
        species=np.zeros(count, dtype=np.int32),
        displacement=np.zeros(2),
        positions=np.zeros((count, 2)),
        position_errors=np.full(count, 2e-6),
        velocities=np.zeros((count, 2)),
        velocity_errors=np.full(count, 1e-5),
        radii=np.full(count, 1e-3),
        radius_errors=np.full(count, 1e-6),
        seen=np.ones(count, dtype=bool),
        expected=np.array([TRAY.count], dtype=np.int32),
    )


def test_speeds_from_tracks_wait_until_the_tracks_are_judged():
    stage, tracks = selector()
    assert stage.push([by_tracks(1.0)]) == ()
    assert stage.push([by_tracks(1.1)]) == ()
    tracks.judged = tracks.reliable = True
    assert stage.push([by_tracks(1.2)]) == (by_tracks(1.0), by_tracks(1.1), by_tracks(1.2))


def test_speeds_from_tracks_that_turn_out_unreliable_are_dropped():
    stage, tracks = selector()
    stage.push([by_tracks(1.0)])
    tracks.without_colour()
    assert stage.uses_structure
    assert stage.push([by_tracks(1.1), by_structure(1.1)]) == (by_structure(1.1),)


def test_a_recording_that_ends_gives_out_what_was_held():
    stage, tracks = selector()
    stage.push([by_tracks(1.0)])
    tracks.judged = tracks.reliable = True
    assert stage.flush() == (by_tracks(1.0),)
    assert stage.flush() == ()


def unreliable(estimate):
    return replace(estimate, quality=Quality.FEW_BEADS | Quality.UNCERTAIN)


def test_unreliable_tracks_speak_flagged_at_the_end_where_no_other_method_does():
    stage, tracks = selector()
    tracks.judged = True
    assert stage.push([by_tracks(1.0)]) == ()
    tracks.reliable = True
    assert stage.push([by_tracks(1.1)]) == (by_tracks(1.1),)
    tracks.reliable = False
    assert stage.push([by_tracks(1.2)]) == ()
    assert stage.flush() == (unreliable(by_tracks(1.2)),)
    assert stage.flush() == ()


def test_unreliable_tracks_are_silent_where_the_structure_function_speaks():
    stage, tracks = selector()
    tracks.judged = True
    stage.push([by_tracks(1.0), by_tracks(1.1)])
    assert stage.push([by_structure(1.05)]) == (by_structure(1.05),)
    assert stage.flush([by_structure(1.2)]) == (by_structure(1.2),)


def test_no_speed_is_earlier_than_the_one_before_by_another_method():
    stage, tracks = selector()
    tracks.judged = tracks.reliable = True
    assert stage.push([by_tracks(2.0)]) == (by_tracks(2.0),)
    tracks.reliable = False
    assert stage.push([by_structure(1.9), by_structure(2.1)]) == (by_structure(2.1),)


@pytest.mark.parametrize(
    ('method', 'chosen'), [('tracking', by_tracks(1.0)), ('structure_function', by_structure(1.0))]
)
def test_a_method_that_is_set_is_the_only_one(method, chosen):
    stage, _ = selector(method)
    assert stage.push([by_tracks(1.0), by_structure(1.0)]) == (chosen,)
    assert stage.uses_tracks == stage.uses_contacts == (method == 'tracking')
    assert stage.uses_structure == (method == 'structure_function')


def test_a_crowded_tray_is_not_tracked():
    stage, _ = selector(crowded=True)
    assert not stage.uses_tracks
    assert stage.uses_structure


def test_a_speed_known_to_less_than_20_per_cent_is_flagged_unless_the_beads_rest():
    stage, _ = selector('tracking')
    vague = by_tracks(1.0, value=1e-3, error=3e-4)
    at_rest = by_tracks(2.0, value=1e-5, error=3e-5)
    assert stage.push([vague]) == (replace(vague, quality=Quality.UNCERTAIN),)
    assert stage.push([at_rest]) == (at_rest,)


def test_speeds_from_images_have_the_error_of_the_beads_that_lie_under_others():
    stage, tracks = selector()
    for _ in range(20):
        tracks.push_speeds(0.5, 0.2, np.array([1e-3]), np.array([NS // 30]))
    tracks.without_colour()
    (crowded,) = stage.push([by_structure(1.0)])
    error = crowded.mean_projected_speed.error
    assert error > 0.1 * crowded.mean_projected_speed.value
    by_set_method, _ = selector('structure_function')
    assert by_set_method.push([by_structure(1.0)]) == (by_structure(1.0),)


def test_beads_that_lie_under_others_do_not_make_tracks_unreliable():
    usual, crowded = TrackReliability(TRAY, crowded=False), TrackReliability(TRAY, crowded=False)
    seen = seen_tracks(round(0.72 * TRAY.count))
    for tracks, hidden in ((usual, 0.0), (crowded, 0.2)):
        for _ in range(60):
            share = 0.72 / (1.0 - hidden)
            tracks.push_speeds(share, hidden, np.array([1e-3]), np.array([NS // 30]))
            tracks.push(seen)
    assert not usual.reliable
    assert crowded.reliable
