"""Pictures that a film holds twice are left out, but not those that are alike as it swings."""

from __future__ import annotations

import math
from itertools import pairwise

import cv2
import numpy as np
import pytest

from nanorocks_ros.recordings.film.duplicate_frames import Repeats
from nanorocks_ros.recordings.film.film_source import Shot, StoredPicture
from nanorocks_ros.recordings.film.timestamp_repair import Stamped

STEP_NS = 40_000_000
SCENE = cv2.GaussianBlur(
    np.random.default_rng(1).integers(0, 255, (200, 300)).astype(np.uint8), (0, 0), 3
)
SCENE = cv2.normalize(SCENE, None, 0, 255, cv2.NORM_MINMAX)


class Drawn:
    """What a camera sees of the scene from here, with its noise and that of a codec."""

    def __init__(self, place, noise):
        self.image = cv2.warpAffine(SCENE, np.float32([[1, 0, -place], [0, 1, -30]]), (160, 120))
        self.image = np.clip(self.image + noise, 0, 255).astype(np.uint8)

    def gray(self):
        return self.image


def film(places, *, sensor=0.0, codec=0.3):
    """Pictures from places, each of which is one moment that may be stored more than once."""
    rng, moments = np.random.default_rng(2), {}
    for number, (moment, place) in enumerate(places):
        if moment not in moments:
            moments[moment] = sensor * rng.standard_normal((120, 160))
        noise = moments[moment] + codec * rng.standard_normal((120, 160))
        yield Stamped(number * STEP_NS, Shot(None, Drawn(place, noise), 0.0))


def moments_kept(places, **noise):
    kept = list(Repeats().without(film(places, **noise)))
    assert all(one.stamp_ns < other.stamp_ns for one, other in pairwise(kept))
    return [places[one.stamp_ns // STEP_NS][0] for one in kept]


def swinging(count, period, phase=0.5):
    return [
        (k, 60 + 4 * math.cos(2 * math.pi * (k + phase) / period)) for k in range(1, count + 1)
    ]


def twice(places, where=lambda k: True):
    return [place for k, place in enumerate(places) for _ in range(2 if where(k) else 1)]


@pytest.mark.parametrize('sensor', [1.0, 3.0])
@pytest.mark.parametrize(('period', 'phase'), [(6, 0.5), (4, 0.5), (6, 0.35), (8, 0.5)])
def test_pictures_at_the_turning_points_of_a_swing_are_kept(period, phase, sensor):
    places = swinging(60, period, phase)
    # Nothing goes before the first that tells whether the second is one more of it.
    assert set(range(1, 61)) - set(moments_kept(places, sensor=sensor)) <= {2}


@pytest.mark.parametrize('where', [lambda k: True, lambda k: k % 4 == 3, lambda k: k in (9, 23)])
def test_repeats_of_what_moves_are_left_out(where):
    places = [(k, 20 + 2 * k) for k in range(50)]
    assert moments_kept(twice(places, where), sensor=1.0) == list(range(50))


def test_repeats_of_what_swings_are_left_out_as_well():
    places = swinging(60, 9)
    kept = moments_kept(twice(places), sensor=1.0)
    assert len(kept) == len(set(kept)) >= 52


def test_pictures_that_are_no_longer_compared_do_not_overtake_one_that_waits():
    """Of JPEGs the first 64 are compared; the last of them may be held back as a repeat."""
    images = [Drawn(20 + 2 * k, 0.0).image for k in range(70)]
    again = np.clip(images[63].astype(int) + 1, 0, 255).astype(np.uint8)
    images.insert(64, again)
    stored = [StoredPicture('png', cv2.imencode('.png', image)[1].tobytes()) for image in images]
    shots = [Stamped(k * STEP_NS, Shot(None, picture, 0.0)) for k, picture in enumerate(stored)]
    kept = list(Repeats().without(shots))
    assert all(one.stamp_ns < other.stamp_ns for one, other in pairwise(kept))
