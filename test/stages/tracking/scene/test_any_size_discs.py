"""Discs of any size: each bead once, without highlights, holes and what never moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.drawn_scenes import SCENES, draw
from nanorocks_ros.stages.tracking.scene.any_size_discs import any_size_discs

SIZES = 6.0, 12.0


@pytest.mark.parametrize('name', ['dark on gray', 'stained floor, rail, holes', 'crowded'])
def test_discs_have_the_sizes_of_the_beads(name):
    scene = replace(SCENES[name], sizes=SIZES, count=20, frames=24)
    frames, _ = draw(scene)
    radii = any_size_discs(frames[::3]).discs[:, 2]
    off = np.abs(radii[:, None] / np.array(SIZES) - 1.0)
    assert (off.min(axis=1) < 0.05).mean() > 0.95
    # Not those that stay where they are.
    assert 0.85 * 8 * scene.count < len(radii) < 1.05 * 8 * scene.count


def test_a_single_frame_shows_all_discs_and_their_colours():
    scene = replace(SCENES['dark on gray'], sizes=SIZES, count=16, frames=1)
    frames, truth = draw(scene)
    found = any_size_discs(frames)
    assert len(found.discs) == scene.count
    places = found.discs[:, None, :2] - truth[0][None, :, :2]
    assert np.hypot(*places.transpose(2, 0, 1)).min(axis=1).max() < 0.5
    assert (found.colours.mean(axis=1) < found.around.mean(axis=1)).all()


def test_an_empty_picture_shows_none():
    assert len(any_size_discs([np.full((80, 90, 3), 120, dtype=np.uint8)]).discs) == 0
