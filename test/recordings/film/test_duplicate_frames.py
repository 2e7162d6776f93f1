"""Removal of duplicate frames, without removing frames at the turning points of a swing."""

from __future__ import annotations

import math
from itertools import pairwise

import cv2
import numpy as np
import pytest
from moving_beads import encoded, jittered, pictures, places

from nanorocks_ros.recordings.film.duplicate_frames import DuplicateFilter
from nanorocks_ros.recordings.film.film_source import EncodedImage, FilmFrame
from nanorocks_ros.recordings.film.timestamp_repair import Stamped

STEP_NS = 40_000_000
SCENE = cv2.GaussianBlur(
    np.random.default_rng(1).integers(0, 255, (200, 300)).astype(np.uint8), (0, 0), 3
)
SCENE = cv2.normalize(SCENE, None, 0, 255, cv2.NORM_MINMAX)


class View:
    """View of the scene from a position, with sensor and codec noise."""

    def __init__(self, position, noise):
        self.image = cv2.warpAffine(
            SCENE, np.float32([[1, 0, -position], [0, 1, -30]]), (160, 120)
        )
        self.image = np.clip(self.image + noise, 0, 255).astype(np.uint8)

    def gray(self):
        return self.image


def film(positions, *, sensor=0.0, codec=0.3):
    """Frames at positions; frames of the same moment share the sensor noise."""
    rng, moments = np.random.default_rng(2), {}
    for number, (moment, position) in enumerate(positions):
        if moment not in moments:
            moments[moment] = sensor * rng.standard_normal((120, 160))
        noise = moments[moment] + codec * rng.standard_normal((120, 160))
        yield Stamped(number * STEP_NS, FilmFrame(None, View(position, noise), 0.0))


def moments_kept(positions, **noise):
    kept = list(DuplicateFilter().filter(film(positions, **noise)))
    assert all(before.stamp_ns < after.stamp_ns for before, after in pairwise(kept))
    return [positions[frame.stamp_ns // STEP_NS][0] for frame in kept]


def swinging(count, period, phase=0.5):
    return [
        (k, 60 + 4 * math.cos(2 * math.pi * (k + phase) / period)) for k in range(1, count + 1)
    ]


def duplicated(positions, where=lambda k: True):
    return [position for k, position in enumerate(positions) for _ in range(2 if where(k) else 1)]


@pytest.mark.parametrize('sensor', [1.0, 3.0])
@pytest.mark.parametrize(('period', 'phase'), [(6, 0.5), (4, 0.5), (6, 0.35), (8, 0.5)])
def test_frames_at_the_turning_points_of_a_swing_are_kept(period, phase, sensor):
    positions = swinging(60, period, phase)
    # The second frame may be dropped, because no frame before the first shows the motion.
    assert set(range(1, 61)) - set(moments_kept(positions, sensor=sensor)) <= {2}


@pytest.mark.parametrize('where', [lambda k: True, lambda k: k % 4 == 3, lambda k: k in (9, 23)])
def test_duplicates_of_moving_scenes_are_dropped(where):
    positions = [(k, 20 + 2 * k) for k in range(50)]
    assert moments_kept(duplicated(positions, where), sensor=1.0) == list(range(50))


def test_duplicates_of_swinging_scenes_are_dropped():
    positions = swinging(60, 9)
    kept = moments_kept(duplicated(positions), sensor=1.0)
    assert len(kept) == len(set(kept)) >= 52


class Still:
    """A frame whose gray levels are known."""

    def __init__(self, image):
        self.image = image

    def gray(self):
        return self.image


def test_a_camera_that_jitters_loses_no_frame():
    """Now and then it returns to where it was; meanwhile the beads have moved."""
    rng = np.random.default_rng(3)
    times = np.arange(300) / 30
    frames = []
    for k, gray in enumerate(pictures(places(times, [25.0] * 300))):
        across, down = rng.normal(0, 2, 2)
        shift = np.float32([[1, 0, across], [0, 1, down]])
        moved = cv2.warpAffine(gray, shift, gray.shape[::-1], borderMode=cv2.BORDER_REFLECT)
        frames.append(Stamped(k * STEP_NS, FilmFrame(None, Still(moved), 0.0)))
    assert len(list(DuplicateFilter().filter(frames))) == 300


@pytest.mark.parametrize(('copies', 'rate'), [(1, 120), (2, 60)])
def test_blocks_that_a_codec_skips_where_a_camera_jitters_are_no_duplicates(copies, rate):
    """Rarely the camera is where it was a frame before, and the beads moved by 0.1 px."""
    times = np.arange(300) / rate
    grays = jittered(pictures(places(times, [10.0] * 300)), 2.0, (100, 150, 220, 261))
    copied = [gray for gray in grays for _ in range(copies)]
    frames = [
        Stamped(k * STEP_NS, FilmFrame(None, Still(gray), 0.0))
        for k, gray in enumerate(encoded(copied, 'libx264', rate=rate * copies, crf='28'))
    ]
    kept = list(DuplicateFilter().filter(frames))
    moments = {frame.stamp_ns // STEP_NS // copies for frame in kept}
    # Without a look at the motion a dozen frames are lost. The encoder does not give the same
    # stream each time; what a camera sees twice cannot be told from what such a file repeats.
    assert len(moments) >= (298 if copies == 1 else 294)
    # Of repeats, four in five are dropped.
    assert len(kept) - len(moments) <= 60 * (copies - 1)


@pytest.mark.parametrize(
    ('codec', 'options'),
    [
        ('libx264', {'crf': '18'}),
        ('libx264', {'crf': '28'}),
        ('mpeg4', {'qmin': '5', 'qmax': '5'}),
    ],
)
def test_frames_that_a_codec_stored_twice_are_dropped(codec, options):
    times = np.arange(40) / 30
    grays = [gray for gray in pictures(places(times, [60.0] * 40)) for _ in range(2)]
    frames = [
        Stamped(k * STEP_NS, FilmFrame(None, Still(gray), 0.0))
        for k, gray in enumerate(encoded(grays, codec, **options))
    ]
    kept = [frame.stamp_ns // STEP_NS // 2 for frame in DuplicateFilter().filter(frames)]
    assert sorted(set(kept)) == list(range(40))
    assert len(kept) <= 42


def test_frames_that_are_no_longer_compared_stay_in_order():
    """The first 64 stored images are compared; the last of them may be held back."""
    images = [View(20 + 2 * k, 0.0).image for k in range(70)]
    again = np.clip(images[63].astype(int) + 1, 0, 255).astype(np.uint8)
    images.insert(64, again)
    stored = [EncodedImage('png', cv2.imencode('.png', image)[1].tobytes()) for image in images]
    frames = [
        Stamped(k * STEP_NS, FilmFrame(None, picture, 0.0)) for k, picture in enumerate(stored)
    ]
    kept = list(DuplicateFilter().filter(frames))
    assert all(before.stamp_ns < after.stamp_ns for before, after in pairwise(kept))
