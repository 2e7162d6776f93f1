"""Shaking events from the beads and from the plate, numbered once for all."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.records import TrayImage
from nanorocks_ros.stages.preprocess.shake_detection import (
    CycleFollower,
    MotionMeter,
    PlateMeter,
    ShakeCounter,
    noise_power,
)

NS = 1_000_000_000
STEP = NS // 30


def swing(seconds, amplitude=2e-4, frequency=1.5, damping=0.16, shakes=(1.0,)):
    """Speed of a plate from frame to frame, [m/s]."""
    times = np.arange(round(30 * seconds)) / 30
    place = np.zeros(times.size)
    for shake in shakes:
        since = np.maximum(times - shake, 0.0)
        place += amplitude * np.exp(-damping * since) * np.sin(2 * np.pi * frequency * since)
    return np.abs(np.diff(place, prepend=0.0)) * 30


def jumps(speeds, error=2e-5):
    meter = PlateMeter(2.0, 5e-4)
    return [k for k, speed in enumerate(speeds) if meter.push(k * STEP, float(speed), error)]


@pytest.mark.parametrize('frequency', [0.4, 1.5, 6.0])
def test_the_plate_is_shaken_once_however_long_it_swings(frequency):
    jump_frames = jumps(swing(25.0, amplitude=1e-3, frequency=frequency))
    assert len([k for k in jump_frames if k > 60]) == 0
    assert jump_frames[0] in (31, 32)


def test_a_plate_shaken_again_is_found_again():
    jump_frames = jumps(swing(80.0, shakes=(1.0, 61.0)))
    assert [k for k in jump_frames if k > 1800]
    assert not [k for k in jump_frames if 200 < k < 1800]


def test_noise_of_the_registration_is_no_shaking():
    rng = np.random.default_rng(1)
    assert jumps(np.abs(rng.normal(0.0, 2e-4, 3000)), error=2e-4) == []


def test_a_plate_that_is_not_seen_says_nothing():
    assert not PlateMeter(2.0, 1e-3).push(0, math.nan, math.nan)


def test_events_are_counted_once_when_half_of_the_trays_jump():
    counter = ShakeCounter(5.0)
    votes = {10: (True, False, False), 20: (True, True, False), 40: (True, True, True)}
    shaken = [counter.push(k * STEP, votes.get(k, (False,) * 3)) for k in range(60)]
    assert [k for k, jump in enumerate(shaken) if jump] == [20]
    assert counter.cycle == 1
    assert counter.cycle_start_ns == 19 * STEP


def test_the_plate_alone_is_enough_and_nobody_is_none():
    counter = ShakeCounter(0.0)
    assert not counter.push(0, (False,), plate=True)
    assert counter.push(STEP, (False, False), plate=True)
    assert not counter.push(2 * STEP, ())


def images(count=80, shake=40):
    rng = np.random.default_rng(5)
    still = rng.integers(90, 140, (60, 60)).astype(float)
    images = []
    for k in range(count):
        gray = still + rng.normal(0, 2, still.shape)
        if k >= shake:
            gray = np.roll(gray, 3 * k, axis=1)
        images.append(TrayImage(stamp_ns=k * STEP, tray=1, gray=gray.astype(np.uint8)))
    return images


def test_who_is_told_the_cycle_knows_what_the_images_say():
    alone, told = CycleFollower(2.0, 5.0), CycleFollower(2.0, 5.0)
    for image in images():
        shaken = alone.push(image)
        counted = replace(
            image,
            cycle=alone.cycle,
            cycle_start_ns=alone.cycle_start_ns,
            noise_power=alone.noise_power,
        )
        assert told.push(counted) == shaken
        assert (told.cycle, told.cycle_start_ns) == (alone.cycle, alone.cycle_start_ns)
        assert told.noise_power == alone.noise_power
    assert told.cycle == 1


def test_a_recording_joined_in_the_middle_of_a_cycle_is_not_shaken_then():
    follower = CycleFollower(2.0, 5.0)
    (first, *_) = images(2)
    assert not follower.push(replace(first, cycle=7, cycle_start_ns=0, noise_power=8.0))
    assert follower.cycle == 7


def test_the_noise_is_the_lower_quantile_of_what_was_measured():
    rng = np.random.default_rng(2)
    meter = MotionMeter(2.0)
    grays = [
        np.clip(100 + rng.normal(0, 1 + k % 4, (50, 50)), 0, 255).astype(np.uint8)
        for k in range(400)
    ]
    powers = [noise_power(b, a) for a, b in itertools.pairwise(grays)]
    for k, gray in enumerate(grays):
        meter.push(k * STEP, gray)
        if k in (1, 7, 250, 399):
            expected = np.quantile(powers[max(0, k - 300) : k], 0.2)
            assert meter.noise_power == pytest.approx(expected, rel=1e-12)


def moving(times, speed=30.0):
    """Images of a striped pattern that moves evenly, [px/s], at given times."""
    rng = np.random.default_rng(8)
    x = np.arange(80)
    for k, time in enumerate(times):
        stripes = 120 + 60 * np.sin(2 * np.pi * (x - speed * time) / 40)
        gray = np.tile(stripes, (60, 1)) + rng.normal(0, 2, (60, 80))
        yield TrayImage(stamp_ns=round(time * NS), tray=1, gray=gray.astype(np.uint8)), k


def test_frames_that_are_missing_are_no_shaking_event():
    times = [k / 30 for k in range(90) if not 40 <= k < 47 and k not in (60, 70, 71)]
    follower = CycleFollower(2.0, 0.0)
    assert not any(follower.push(image) for image, _ in moving(times))


def test_a_shake_while_frames_are_missing_is_seen_with_the_next():
    before = [image for image, _ in moving([k / 30 for k in range(40)], speed=4.0)]
    after = [image for image, _ in moving([k / 30 for k in range(48, 70)], speed=40.0)]
    follower = CycleFollower(2.0, 0.0)
    shaken = [image.stamp_ns for image in (*before, *after) if follower.push(image)]
    assert shaken == [after[1].stamp_ns]
