"""Motion of the tray and of the camera, told apart by the beads, against the true motion."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.tracking.camera_motion import CameraMotion

FRAME_RATE = 30.0
FRAMES = 240
# Error of registration and of the place of a bead, [px].
REGISTRATION, PLACES = 0.02, 0.05
TIMES = np.arange(FRAMES) / FRAME_RATE
# Small, so that few touch.
RADIUS = 4.0

# [px]
SWING = 2.7 * np.exp(-0.16 * TIMES)[:, None] * np.sin(9.42 * TIMES)[:, None] * [0.8, 0.6]
SWAY = 2.0 * np.sin(4.4 * TIMES)[:, None] * [0.8, 0.6]
DRIFT = 0.5 * TIMES[:, None] * [0.8, 0.6]
REST = np.zeros((FRAMES, 2))


def jitter(seed=0):
    return np.random.default_rng(seed).normal(0.0, 2.0, (FRAMES, 2))


def knock():
    motion = np.zeros((FRAMES, 2))
    motion[FRAMES // 2 :] = [3.3, -2.1]
    return motion


def motions(tray, camera, beads=15, speed=30.0, seed=1, registration=REGISTRATION):
    """What is said of each frame; beads fly straight and turn round at the walls."""
    rng = np.random.default_rng(seed)
    start, velocity = rng.uniform(0.0, 200.0, (beads, 2)), rng.normal(0.0, speed, (beads, 2))
    judge = CameraMotion()
    said = []
    for time, moved, shaken in zip(TIMES, tray, camera, strict=True):
        path = (start + velocity * time) % 400.0
        wrong = rng.normal(0.0, registration, 2)
        places = np.minimum(path, 400.0 - path) - moved - wrong
        places += rng.normal(0.0, PLACES, (beads, 2))
        in_picture = moved + shaken + wrong
        said.append(
            judge.push(
                time, rng.permutation(places), np.full(beads, RADIUS), in_picture, REGISTRATION
            )
        )
    return said


def settled(said):
    """The second half: the decision takes up to a second."""
    return said[FRAMES // 2 :]


@pytest.mark.parametrize('speed', [1.0, 30.0, 130.0])
def test_a_swing_of_the_tray_is_kept(speed):
    said = motions(SWING, REST, speed=speed)
    assert not any(motion.camera_moves or motion.changed or motion.uncertain for motion in said)
    displacements = np.array([motion.displacement for motion in said])
    assert np.abs(displacements - SWING).max() < 6.0 * REGISTRATION


@pytest.mark.parametrize('camera', [jitter(), SWAY], ids=['jitter', 'sway'])
@pytest.mark.parametrize('speed', [1.0, 30.0, 130.0])
def test_motion_of_the_camera_is_not_that_of_the_tray(camera, speed):
    said = settled(motions(REST, camera, speed=speed))
    assert all(motion.camera_moves for motion in said)
    assert not any(motion.uncertain or motion.changed for motion in said)
    assert not np.any([motion.displacement for motion in said])


@pytest.mark.parametrize('speed', [1.0, 30.0])
def test_an_error_of_registration_larger_than_stated_is_no_doubt(speed):
    wrong = 5.0 * REGISTRATION
    said = settled(motions(REST, jitter(), beads=60, speed=speed, registration=wrong))
    assert all(motion.camera_moves and not motion.uncertain for motion in said)


def test_a_lens_that_enlarges_the_motion_at_the_walls_is_no_doubt():
    beads, rng, judge = 60, np.random.default_rng(3), CameraMotion()
    start = rng.uniform(0.0, 200.0, (beads, 2))
    said = []
    for time, shaken in zip(TIMES, 4.0 * SWAY, strict=True):
        places = start - 0.03 * shaken + rng.normal(0.0, PLACES, (beads, 2))
        in_picture = 1.03 * shaken + rng.normal(0.0, REGISTRATION, 2)
        said.append(judge.push(time, places, np.full(beads, RADIUS), in_picture, REGISTRATION))
    assert all(motion.camera_moves and not motion.uncertain for motion in settled(said))


def test_a_knock_of_the_camera_is_noticed_within_four_frames():
    said = motions(REST, knock())
    changes = [k for k, motion in enumerate(said) if motion.changed]
    assert len(changes) == 1
    assert 0 <= changes[0] - FRAMES // 2 < 4


def test_a_slow_drift_alone_decides_nothing():
    assert not any(motion.changed for motion in motions(REST, DRIFT))


@pytest.mark.parametrize('camera', [jitter(), SWAY], ids=['jitter', 'sway'])
def test_a_swing_seen_by_a_moving_camera_is_called_uncertain(camera):
    said = settled(motions(SWING, camera))
    assert np.mean([motion.uncertain for motion in said]) > 0.9


def test_the_tray_is_believed_again_when_the_camera_stops():
    half = FRAMES // 4
    camera, tray = jitter(), np.zeros((FRAMES, 2))
    camera[half:] = 0.0
    tray[half:] = SWING[: FRAMES - half]
    said = motions(tray, camera)
    assert said[half - 1].camera_moves
    assert not any(motion.camera_moves for motion in settled(said))


def test_too_few_beads_leave_jitter_to_the_camera():
    said = motions(REST, jitter(), beads=1)
    assert all(motion.camera_moves for motion in settled(said))


def test_smooth_motion_with_too_few_beads_is_called_uncertain():
    said = settled(motions(SWING, REST, beads=1))
    assert all(motion.uncertain and not motion.camera_moves for motion in said)


def test_beads_that_touch_count_as_one_body():
    rng = np.random.default_rng(4)
    offsets = RADIUS * np.stack([2.0 * np.arange(15), np.zeros(15)], axis=-1)
    judge = CameraMotion()
    for time, moved in zip(TIMES, SWAY, strict=True):
        places = 100.0 + offsets + rng.normal(0.0, PLACES, (15, 2))
        motion = judge.push(time, places, np.full(15, RADIUS), moved, REGISTRATION)
    assert motion.uncertain


def test_motion_across_gaps_decides_nothing():
    judge = CameraMotion()
    rng = np.random.default_rng(2)
    places = rng.uniform(0.0, 200.0, (15, 2))
    times = np.cumsum(np.tile([1.0, 9.0], 60)) / FRAME_RATE
    said = [
        judge.push(time, places, np.full(15, RADIUS), rng.normal(0.0, 2.0, 2), REGISTRATION)
        for time in times
    ]
    assert not any(motion.camera_moves or motion.uncertain for motion in said)
