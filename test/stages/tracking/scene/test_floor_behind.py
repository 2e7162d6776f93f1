"""The floor behind discs: where a bead has left, and shadows that beads cast."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.drawn_scenes import DrawnScene, draw
from nanorocks_ros.stages.tracking.scene.bead_looks import BeadLook
from nanorocks_ros.stages.tracking.scene.floor_behind import CastShadows, darken, left_behind
from nanorocks_ros.stages.tracking.scene.scene_model import scene_model

FLOOR = np.array([70.0, 215.0, 200.0])
AWAY = np.array([0.4, 1.4])


def beads_with(offsets, rng, frames=8):
    """Discs: in each frame one bead somewhere, and a dark one beside it; frames of both."""
    beads = np.column_stack([rng.uniform(50, 350, (frames, 2)), np.full(frames, 6.0)])
    others = beads.copy()
    others[:, :2] += 6.0 * offsets
    numbers = np.arange(frames)
    discs = np.concatenate([beads, others])
    return discs, np.repeat([False, True], frames), np.tile(numbers, 2)


def test_the_floor_in_less_light_is_dark_and_another_colour_is_not():
    colours = np.array([0.8 * FLOOR, 1.2 * FLOOR, FLOOR, [60.0, 100.0, 190.0], 0.1 * FLOOR])
    dark = darken(colours, np.tile(FLOOR, (5, 1)))
    assert dark.tolist() == [True, False, False, False, False]
    assert not darken(colours, np.full((5, 3), np.nan)).any()


def test_dark_discs_at_one_place_beside_beads_are_shadows():
    rng = np.random.default_rng(1)
    discs, dark, frames = beads_with(AWAY + rng.normal(0.0, 0.1, (8, 2)), rng)
    shadows = CastShadows.of(discs, dark, frames)
    assert shadows.offset == pytest.approx(AWAY, abs=0.15)
    assert shadows.among(discs, np.ones(16, dtype=bool), dark)[8:].all()
    # Half on the bead, a disc is no longer dark, and is the shadow all the same.
    bead, shadow = discs[:1], discs[8:9]
    both = np.concatenate([bead, shadow])
    none = np.zeros(2, dtype=bool)
    assert shadows.among(both, ~none, none).tolist() == [False, True]


def test_dark_beads_around_others_are_not_shadows():
    rng = np.random.default_rng(2)
    turns = rng.uniform(0.0, 2.0 * np.pi, 8)
    around = 1.5 * np.column_stack([np.cos(turns), np.sin(turns)])
    assert CastShadows.of(*beads_with(around, rng)) is None


def test_a_dark_bead_that_rests_beside_another_is_no_shadow():
    rng = np.random.default_rng(3)
    discs, dark, frames = beads_with(np.tile(AWAY, (8, 1)), rng)
    discs[:8] = discs[0]
    discs[8:] = discs[8]
    assert CastShadows.of(discs, dark, frames) is None


def test_a_disc_that_shows_less_in_the_frame_than_in_the_background_was_left():
    gray, bright = np.full((2, 3), 100.0), np.array([[200.0] * 3, [100.0] * 3])
    left = left_behind((gray, gray), (bright, gray), None, np.full(2, 6.0))
    assert left.tolist() == [True, False]


def test_a_ball_near_a_wall_is_found_without_its_shadow():
    scene = DrawnScene(
        floor=(70, 190, 170),
        colours=((110, 250, 220),),
        radii=(6.0, 6.0),
        count=1,
        speed=7.0,
        light=0.0,
        noise=1.5,
        highlight=10.0,
    )
    frames, truth = draw(scene)
    # A disc in less light, below and beside the ball, and under it.
    shaded = []
    for frame, ((x, y, _),) in zip(frames, truth, strict=True):
        rows, columns = np.mgrid[: frame.shape[0], : frame.shape[1]]
        shadow = np.hypot(columns - x - 5.0, rows - y - 8.0) < 6.0
        shadow &= np.hypot(columns - x, rows - y) > 6.5
        shaded.append(np.where(shadow[:, :, None], 0.75 * frame, frame).astype(np.uint8))
    model = scene_model(shaded[::2], BeadLook(radii=(5.0, 7.2)))
    assert model.shadows is not None
    for frame, places in zip(shaded[::5], truth[::5], strict=True):
        candidates = model.candidates(frame)
        discs = candidates.outlines.discs[model.alike(candidates)]
        assert len(discs) == 1
        assert np.hypot(*(discs[0] - places[0])[:2]) < 2.0


def test_dark_beads_among_bright_ones_are_all_found():
    scene = DrawnScene(colours=((60, 60, 60), (230, 230, 230)), count=20, light=0.0)
    frames, truth = draw(replace(scene, seed=4))
    model = scene_model(frames[::3], BeadLook(radii=(7.5, 10.8)))
    assert model.shadows is None
    candidates = model.candidates(frames[5])
    assert model.alike(candidates).sum() == len(truth[5])
