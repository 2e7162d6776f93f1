"""The motion of trays, against what it is known to be."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from plates import GROWING_FLOOR, SCALE, Plate

from nanorocks_ros.experiment.lens import Camera
from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.experiment.view import IdentityLens, View
from nanorocks_ros.stages.preprocess.image_registration import update_reference
from nanorocks_ros.stages.preprocess.stabilise import Shift, TrayRegistration

MIX = np.array([0.3, 0.4, 0.3])


def follower(plate, tray=3, camera=None):
    straight = IdentityLens(width=plate.shape[1], height=plate.shape[0])
    view = View(camera=camera or straight)
    return TrayRegistration(plate.regions[tray], view, 0.002 * SCALE, MIX)


def swing(count, amplitude=2.0):
    steps = np.arange(count)
    decay = amplitude * np.exp(-steps / 40.0)
    return np.stack([decay * np.sin(0.45 * steps), 0.6 * decay * np.sin(0.3 * steps)], axis=-1)


def errors(plate, tracker, shifts, **values):
    measured = [
        tracker.push(plate.picture(d, seed=k, **values), None) for k, d in enumerate(shifts)
    ]
    return np.array(
        [[shift.x - d[0], shift.y - d[1]] for shift, d in zip(measured, shifts, strict=True)]
    )


@pytest.mark.parametrize('tray', [1, 3, 7])
def test_a_swinging_tray_is_followed_to_a_twentieth_of_a_pixel(plate, tray):
    off = errors(plate, follower(plate, tray), swing(30))
    assert np.sqrt((off**2).mean(axis=0)).max() < 0.05


def test_the_same_holds_through_a_fisheye_lens():
    lens = Camera(width=640, height=420, focal=(560.0, 560.0), centre=(324.0, 208.0))
    plate = Plate(lens)
    off = errors(plate, follower(plate, 2, lens), swing(20))
    assert np.sqrt((off**2).mean(axis=0)).max() < 0.05


def test_beads_that_fly_past_the_tray_do_not_carry_it_along(plate):
    tracker = follower(plate, 3)
    x, y, width, height = plate.regions[3]
    rng = np.random.default_rng(1)
    beads = rng.uniform((x + 8, y + 8), (x + width - 8, y + height - 8), (40, 2))
    worst = 0.0
    for k in range(20):
        moved = [(a + 1.5 * k % 20, b, 5.0) for a, b in beads]
        inside = [bead for bead in moved if bead[0] < x + width - 6]
        shift = tracker.push(plate.picture(seed=k, beads=inside), None)
        worst = max(worst, abs(shift.x), abs(shift.y))
    assert worst < 0.05


def test_light_that_changes_is_no_motion(plate):
    tracker = follower(plate)
    tracker.push(plate.picture(seed=1), None)
    shift = tracker.push(plate.picture(seed=2, light=0.8), None)
    assert max(abs(shift.x), abs(shift.y)) < 0.05


def test_a_tray_at_rest_is_registered_as_well_in_half_of_the_light(plate):
    tracker = follower(plate)
    picture = plate.picture(seed=1)
    tracker.push(picture, None)
    same = tracker.push(picture, None)
    darker = tracker.push((0.5 * picture).round().astype(np.uint8), None)
    assert darker is not None
    assert max(abs(darker.x), abs(darker.y)) < 0.02
    assert darker.error < 1.5 * same.error


def test_a_jump_of_many_pixels_between_two_frames_is_found(plate):
    tracker = follower(plate)
    tracker.push(plate.picture(seed=1), None)
    shift = tracker.push(plate.picture((11.3, -7.6), seed=2), None)
    assert shift.x == pytest.approx(11.3, abs=0.1)
    assert shift.y == pytest.approx(-7.6, abs=0.1)


@pytest.mark.parametrize('corners', [('top',), ('top', 'bottom')])
def test_writing_over_the_walls_that_does_not_move_does_not_hold_the_tray(plate, corners):
    tracker = follower(plate)
    x, y, width, height = plate.regions[3]
    places = {'top': (x - 8, y - 2), 'bottom': (x + width - 60, y + height + 10)}
    off = []
    for k, (dx, dy) in enumerate(swing(30)):
        picture = plate.picture((dx, dy), seed=k)
        for corner in corners:
            style = cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 2, cv2.LINE_4
            cv2.putText(picture, f'0{k % 10}:1{k}', places[corner], *style)
        shift = tracker.push(picture, None)
        off.append((shift.x - dx, shift.y - dy))
    assert np.sqrt(np.square(off).mean(axis=0)).max() < 0.1


@pytest.mark.parametrize('rate', [0.0, 0.0002, -0.0002])
def test_a_tray_that_grows_in_the_picture_is_noticed(rate):
    height, width = GROWING_FLOOR.shape
    view = View(camera=IdentityLens(width=width, height=height))
    tracker = TrayRegistration(Region(*GROWING_FLOOR.floor), view, 12.0, MIX)
    for number, shift in enumerate(swing(200)):
        tracker.push(GROWING_FLOOR.picture(number, rate, shift), None)
    assert tracker.grows == bool(rate)


def test_a_picture_without_the_tray_is_a_loss_and_the_next_with_it_is_not(plate):
    tracker = follower(plate)
    tracker.push(plate.picture(seed=1), None)
    rng = np.random.default_rng(3)
    assert tracker.push(rng.integers(0, 256, (*plate.shape, 3), dtype=np.uint8), None) is None
    shift = tracker.push(plate.picture((1.0, 0.0), seed=2), None)
    assert shift.x == pytest.approx(1.0, abs=0.05)


def test_what_a_neighbour_says_helps_after_a_jump(plate):
    tracker = follower(plate)
    tracker.push(plate.picture(seed=1), None)
    shift = tracker.push(plate.picture((25.0, 0.0), seed=2), Shift(24.5, 0.2, 0.02))
    assert shift.x == pytest.approx(25.0, abs=0.1)


def test_without_walls_there_is_nothing_to_follow():
    view = View(camera=IdentityLens(width=120, height=100))
    tracker = TrayRegistration(Region(20, 20, 60, 50), view, 8.0, np.ones(1))
    flat = np.full((100, 120, 1), 120, np.uint8)
    assert tracker.push(flat, None) is None
    assert tracker.push(flat, None) is None


def test_the_error_that_is_stated_covers_what_is_seen(plate):
    tracker = follower(plate, 5)
    pulls = []
    for k, d in enumerate(swing(25)):
        shift = tracker.push(plate.picture(d, seed=k), None)
        pulls += [(shift.x - d[0]) / shift.error, (shift.y - d[1]) / shift.error]
    assert 0.2 < np.std(pulls) < 1.5


def test_a_point_that_changes_is_doubted_soon_in_a_reference_of_many_pictures():
    rng = np.random.default_rng(0)
    reference, powers, trust = np.full(50, 100.0), np.ones(50), np.ones(50)
    for seen in range(1, 1001):
        values = 100.0 + rng.normal(0.0, 2.0, 50)
        if seen > 990:
            values[7] = 130.0
        update_reference(values, seen, reference, powers, trust)
    assert trust[7] < 0.05
    assert np.median(trust) > 0.8
    assert reference[7] - 100.0 < 0.1 * 30.0
