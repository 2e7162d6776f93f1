"""What beads look like is learnt from drawn films of every look, by an independent painter."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.drawn_scenes import SCENES, DrawnScene, draw
from benchmarks.recognition import drawn_score
from nanorocks_ros.stages.tracking.scene.bead_looks import BeadLook
from nanorocks_ros.stages.tracking.scene.floor_behind import darken
from nanorocks_ros.stages.tracking.scene.scene_model import scene_model


@pytest.mark.parametrize('name', SCENES)
def test_beads_of_any_look_are_found_and_nothing_else(name):
    score, _, _ = drawn_score(replace(SCENES[name], seed=11), told=True)
    assert score.right >= 0.97 * score.beads
    assert score.right >= 0.97 * score.discs


@pytest.mark.parametrize('name', ['bright on dark', 'radius 3 px', 'stained floor, rail, holes'])
def test_the_size_is_found_when_it_is_not_told(name):
    frames, _ = draw(SCENES[name])
    low, high = scene_model(frames[::3], BeadLook()).radii
    assert low < SCENES[name].radii[0] < high
    assert high / low < 1.7


def test_one_frame_is_enough_where_beads_stand_out():
    frames, truth = draw(SCENES['bright on dark'])
    model = scene_model(frames[:1], BeadLook(radii=(7.5, 10.5)))
    candidates = model.candidates(frames[0])
    assert model.alike(candidates).sum() == len(truth[0])


def test_holes_that_never_move_are_candidates_but_not_alike():
    scene = replace(SCENES['half of them at rest'], colours=((60, 60, 190),), radii=(13.0, 13.0))
    frames, _ = draw(scene)
    model = scene_model(frames[::3], BeadLook(radii=(10.0, 21.0)))
    candidates = model.candidates(frames[0])
    holes = np.array([[400 * (2 * k + 1) // 6, 300 // 7] for k in range(3)])
    alike = candidates.outlines.discs[model.alike(candidates)]
    assert model.sees_motion
    assert np.hypot(*(alike[:, None, :2] - holes).transpose(2, 0, 1)).min() > 8.0


def test_an_empty_film_has_no_disc():
    frames, _ = draw(DrawnScene(count=0, frames=10))
    model = scene_model(frames, BeadLook(radii=(8.0, 12.0)))
    candidates = model.candidates(frames[0])
    assert model.alike(candidates).sum() == 0


@pytest.mark.parametrize('more', [{'count': 10_000}, {'radii': (200.0, 200.0)}])
def test_more_beads_than_fit_are_not_drawn(more):
    with pytest.raises(SystemExit, match='fit in 400 x 300 px; draw fewer'):
        draw(replace(DrawnScene(frames=1), **more))


def faint_beads(count=6, frames=24, *, bolts=0):
    """Frames of bright beads on a gray floor, beside bolts that are far brighter, and radii."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[:240, :360]
    pictures = []
    for k in range(frames):
        picture = np.full((240, 360), 120.0)
        for i in range(count):
            place = 40.0 + 50.0 * i + 1.5 * k, 60.0 + 20.0 * (i % 3) + 2.0 * k
            cover = np.clip(10.5 - np.hypot(x - place[0], y - place[1]), 0.0, 1.0)
            picture += 22.0 * cover
        for i in range(bolts):
            cover = np.clip(10.5 - np.hypot(x - 25.0 - 34.0 * i, y - 215.0), 0.0, 1.0)
            picture += 130.0 * cover
        picture = cv2.GaussianBlur(picture, (0, 0), 0.8) + rng.normal(0.0, 1.0, picture.shape)
        gray = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
        pictures.append(np.repeat(gray[:, :, None], 3, axis=2))
    return pictures


def test_the_usual_edge_is_that_of_beads_beside_bolts_with_far_higher_ones():
    alone = scene_model(faint_beads(), BeadLook(radii=(8.0, 12.0)))
    beside = scene_model(faint_beads(bolts=10), BeadLook(radii=(8.0, 12.0)))
    bright = [view for view in beside.views if not view.moves and view.voting.sign == 1]
    usual = next(view for view in alone.views if not view.moves and view.voting.sign == 1)
    assert bright[0].voting.step == pytest.approx(usual.voting.step, rel=0.3)


def beads_over_shadows(frames=24):
    """Frames of bright beads, each over a shadow that is larger and darker in some, and places."""
    rng = np.random.default_rng(7)
    y, x = np.mgrid[:240, :360]
    pictures, places = [], []
    for k in range(frames):
        picture = np.full((240, 360), 140.0)
        now = [(40.0 + 50.0 * i + 1.5 * k, 50.0 + 22.0 * (i % 3) + 2.0 * k) for i in range(6)]
        for column, row in now:
            away = np.hypot(x - column - 4.5, y - row - 12.6)
            depth, edge = (0.45, 11.5) if k % 4 == 0 else (0.15, 9.5)
            picture *= 1.0 - depth * np.clip(edge - away, 0.0, 1.0)
        for column, row in now:
            cover = np.clip(9.5 - np.hypot(x - column, y - row), 0.0, 1.0)
            picture += cover * (168.0 - picture)
        picture = cv2.GaussianBlur(picture, (0, 0), 0.8) + rng.normal(0.0, 1.0, picture.shape)
        gray = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
        pictures.append(np.repeat(gray[:, :, None], 3, axis=2))
        places.append(np.array(now))
    return pictures, places


def test_shadows_that_are_known_do_not_compete_with_their_beads():
    frames, places = beads_over_shadows()
    model = scene_model(frames, BeadLook(radii=(7.5, 12.5), apart=1.25))
    assert model.shadows is not None
    for frame, now in zip(frames[::3], places[::3], strict=True):
        candidates = model.candidates(frame)
        alike = candidates.outlines.discs[model.alike(candidates)]
        away = np.hypot(*(now[:, None, k] - alike[None, :, k] for k in range(2)))
        assert len(alike) == len(now)
        assert away.min(axis=1).max() < 2.0
        assert not darken(candidates.colours, candidates.floor).any()
