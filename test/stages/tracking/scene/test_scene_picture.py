"""Background, colours and noise are learnt from frames of the film."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.drawn_scenes import DrawnScene, draw
from nanorocks_ros.stages.tracking.scene.scene_picture import scene_colours

SCENE = DrawnScene(floor=(90, 160, 60), colours=((60, 105, 190),), highlight=0, frames=25)


@pytest.fixture(scope='module')
def film():
    return draw(SCENE)


def beads_in(truth, shape):
    y, x = np.mgrid[: shape[0], : shape[1]]
    inside = [np.hypot(x - column, y - row) < radius - 1 for column, row, radius in truth]
    return np.any(inside, axis=0)


def test_the_background_is_the_floor_without_beads(film):
    frames, _ = film
    background = scene_colours(frames).background.astype(float)
    empty = draw(DrawnScene(**{**vars_of(SCENE), 'count': 0, 'frames': 1, 'noise': 0.0}))[0][0]
    assert np.abs(background - empty).mean() < 2.0


def vars_of(scene):
    return {name: getattr(scene, name) for name in scene.__dataclass_fields__}


def test_the_colours_tell_beads_from_floor_of_the_same_lightness(film):
    frames, truth = film
    colours = scene_colours(frames)
    inside = beads_in(truth[-1], frames[-1].shape)
    picture = colours.picture(frames[-1]).astype(float)
    contrast = abs(np.median(picture[inside]) - np.median(picture[~inside]))
    gray = frames[-1].mean(axis=2)
    assert contrast > 2.0 * abs(np.median(gray[inside]) - np.median(gray[~inside]))
    assert contrast > 20.0 * colours.noise


def test_the_noise_is_that_of_a_pixel(film):
    colours = scene_colours(film[0])
    assert colours.noise == pytest.approx(3.0 * np.linalg.norm(colours.weights), rel=0.25)


def test_pixels_that_differ_from_the_background_move(film):
    frames, truth = film
    moving = scene_colours(frames).moving(frames[-1]).astype(bool)
    inside = beads_in(truth[-1], frames[-1].shape)
    assert moving[inside].mean() > 0.95
    assert moving[~inside].mean() < 0.06


def test_the_background_follows_slow_light_and_not_beads(film):
    frames, truth = film
    colours = scene_colours(frames)
    before = colours.background.copy()
    brighter = np.clip(frames[-1].astype(int) + 4, 0, 255).astype(np.uint8)
    for _ in range(6):
        colours.follow(brighter)
    change = colours.background.astype(int) - before
    inside = beads_in(truth[-1], frames[-1].shape)
    assert 2.0 < change[~inside].mean() < 5.0
    assert abs(change[inside].mean()) < 1.0


@pytest.mark.parametrize('count', [1, 2, 3, 24, 300])
def test_the_background_is_the_value_in_the_middle(count):
    rng = np.random.default_rng(count)
    frames = list(rng.integers(0, 256, (count, 30, 40, 3), dtype=np.uint8))
    background = scene_colours(frames).background
    assert np.array_equal(background, np.sort(frames, axis=0)[count // 2])
