"""Frames that are missing between even time stamps are counted from the steps of the beads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bead_paths import PIXEL, RATE, tracks_of

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Quality, TrayImage
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.speed.skipped_frames import SkippedFrames
from nanorocks_ros.stages.speed.track_speed import TrackSpeed

BEADS, BOX = 12, 13e-3
JITTER = 0.07 * PIXEL


def flights(frames, speed=5e-3, seed=3):
    """Places of beads that fly between two pairs of walls, (frames, beads, 2), [m]."""
    rng = np.random.default_rng(seed)
    angles = rng.uniform(0.0, 2.0 * np.pi, BEADS)
    velocities = speed * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    starts = rng.uniform(0.0, 2.0 * BOX, (BEADS, 2))
    way = starts + velocities * np.arange(frames)[:, np.newaxis, np.newaxis] / RATE
    return 1e-3 + np.abs(way % (2.0 * BOX) - BOX)


def counted(places, **values):
    skipped = SkippedFrames(1.0 / PIXEL)
    for tracks in tracks_of(places, jitter=JITTER, **values):
        skipped.push(tracks)
    return skipped


def without_every(every, places):
    return places[np.arange(len(places)) % every != every - 1]


def test_every_tenth_frame_that_is_lost_between_even_stamps_is_counted():
    skipped = counted(without_every(10, flights(400)))
    assert skipped.skipped == pytest.approx(39, abs=3)
    assert skipped.steps == pytest.approx(356, abs=5)
    assert skipped.matters


def test_two_frames_lost_at_once_are_two():
    places = flights(400)
    kept = (np.arange(400) % 20) < 18
    assert counted(places[kept]).skipped == pytest.approx(38, abs=4)


def test_a_complete_film_lacks_none():
    assert counted(flights(400)).skipped == 0


def test_frames_whose_stamps_show_that_some_are_missing_lack_none():
    skipped = SkippedFrames(1.0 / PIXEL)
    for number, tracks in enumerate(tracks_of(flights(400), jitter=JITTER)):
        if number % 10 != 9:
            skipped.push(tracks)
    assert skipped.steps > 300
    assert skipped.skipped == 0


def test_a_kick_and_a_stop_are_no_missing_frames():
    moving = flights(60)
    places = np.concatenate([np.repeat(moving[:1], 30, axis=0), moving, moving[-1:], moving[::-1]])
    assert counted(places).skipped == 0


def test_a_camera_that_jumps_from_frame_to_frame_hides_none():
    jumps = np.random.default_rng(5).normal(0.0, 2.0 * PIXEL, (400, 1, 2))
    assert counted(flights(400) + jumps).skipped == 0


def test_beads_that_move_less_than_half_a_pixel_tell_nothing():
    skipped = counted(without_every(10, flights(400, speed=0.8e-3)))
    assert skipped.steps < 50
    assert not skipped.matters


def test_few_missing_frames_do_not_matter():
    skipped = counted(without_every(37, flights(400)))
    assert skipped.skipped > 0
    assert not skipped.matters


def test_hidden_beads_are_left_out():
    skipped = SkippedFrames(1.0 / PIXEL)
    for tracks in tracks_of(without_every(10, flights(100)), jitter=JITTER):
        seen = np.arange(BEADS) < 3
        skipped.push(replace(tracks, seen=seen))
    assert skipped.steps == 0


@pytest.mark.parametrize(('every', 'flagged'), [(10, True), (400, False)])
def test_speeds_from_tracks_that_lack_frames_are_flagged(every, flagged):
    stage = TrackSpeed(PipelineSettings(), load_trays()[1], crowded=False)
    speeds = [
        speed
        for tracks in tracks_of(without_every(every, flights(400)), jitter=JITTER)
        for speed in stage.push(tracks)
    ]
    assert (Quality.SKIPPED_FRAMES in speeds[-1].quality) == flagged


def test_frames_that_one_cycle_lacks_do_not_flag_the_next():
    stage = TrackSpeed(PipelineSettings(), load_trays()[1], crowded=False)
    places = flights(800)
    kept = np.flatnonzero((np.arange(800) % 10 != 9) | (np.arange(800) >= 400))
    image = TrayImage(stamp_ns=0, tray=1, gray=np.zeros((4, 4), np.uint8), cycle_start_ns=0)
    cycles = {1: [], 2: []}
    for number, tracks in zip(kept, tracks_of(places[kept], jitter=JITTER), strict=True):
        cycle = 1 if number < 400 else 2
        color = np.zeros((4, 4, 3), np.uint8)
        stage.push(replace(image, stamp_ns=tracks.stamp_ns, cycle=cycle, color=color))
        cycles[cycle] += stage.push(tracks)
    assert Quality.SKIPPED_FRAMES in cycles[1][-1].quality
    assert not any(Quality.SKIPPED_FRAMES in speed.quality for speed in cycles[2])
