"""Shaking events are counted once for all trays; each image gets its own cycle."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from moving_beads import images, pictures, places

from nanorocks_ros.stages.preprocess.shaking.onset_confirmation import Onsets
from nanorocks_ros.stages.preprocess.shaking.shaking_cycles import (
    CycleFollower,
    HeldImages,
    ShakeCounter,
)

NS = 1_000_000_000
STEP = NS // 30
NONE = Onsets()


def confirmed(*frames):
    return Onsets(confirmed=tuple(frame * STEP for frame in frames))


def pending(*frames):
    return Onsets(pending=tuple(frame * STEP for frame in frames))


def test_events_are_counted_once_when_half_of_the_trays_begin_to_move():
    counter = ShakeCounter(5.0)
    assert not counter.push((confirmed(10), NONE, NONE, NONE))
    assert counter.push((confirmed(20), confirmed(20), NONE, NONE))
    assert not counter.push((confirmed(40),) * 4)
    assert counter.starts_ns == [20 * STEP]


def test_trays_whose_motion_is_seen_two_frames_apart_are_shaken_together():
    counter = ShakeCounter(5.0)
    assert not counter.push((confirmed(20), pending(22), NONE, NONE))
    assert counter.push((NONE, confirmed(22), NONE, NONE))
    assert counter.starts_ns == [20 * STEP]


def test_the_plate_alone_is_enough_and_nobody_is_none():
    counter = ShakeCounter(0.0)
    assert not counter.push((NONE,))
    assert counter.push((NONE, NONE), confirmed(1))
    assert not counter.push(())


def test_images_wait_while_an_onset_is_undecided():
    counter = ShakeCounter(5.0)
    held = HeldImages(counter)
    film = images([np.zeros((4, 4), np.uint8)] * 4, [k * STEP / NS for k in range(4)])
    released = []
    for image, onsets in zip(film, (NONE, pending(0), pending(0), confirmed(0)), strict=True):
        counter.push((onsets,))
        held.add((image,))
        released.append([(record.stamp_ns // STEP, record.cycle) for record in held.known()])
    assert released == [[(0, 0)], [], [], [(1, 1), (2, 1), (3, 1)]]
    assert held.first_ns == math.inf


def film(shake=1.0):
    times = np.arange(60) / 30
    return images(pictures(places(times, np.where(times <= shake, 0.0, 100.0))), times)


def followed(follower, records):
    return [*(image for record in records for image in follower.push(record)), *follower.flush()]


def test_every_image_has_the_cycle_that_it_is_in():
    counted = followed(CycleFollower(2.0, 5.0), film())
    assert [image.cycle for image in counted] == [0] * 31 + [1] * 29
    assert [image.stamp_ns for image in counted] == [image.stamp_ns for image in film()]
    assert {image.cycle_start_ns for image in counted[31:]} == {counted[30].stamp_ns}


def test_who_is_told_the_cycle_knows_what_the_images_say():
    counted = followed(CycleFollower(2.0, 5.0), film())
    told = CycleFollower(2.0, 5.0)
    assert [told.push(image) for image in counted] == [(image,) for image in counted]


def test_the_noise_is_measured_where_it_is_not_told():
    (*_, last) = followed(
        CycleFollower(2.0, 5.0), [replace(image, cycle=7, cycle_start_ns=0) for image in film()]
    )
    assert last.cycle == 7
    # Twice the variance of the noise and of its rounding.
    assert abs(last.noise_power / (2 * (1.5**2 + 1 / 12)) - 1) < 0.2
