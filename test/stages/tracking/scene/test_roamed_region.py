"""Round things beside the place where beads move, which never move, are no beads."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.drawn_scenes import DrawnScene, draw
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.stages.tracking.scene.scene_detector import SceneDetector

BESIDE = np.array([[450.0, 60.0], [450.0, 220.0]])


def film():
    """Beads of two colours that move in the left part of a picture, and two discs in the right.

    One of these is struck at last.
    """
    scene = DrawnScene(colours=((60, 60, 60), (60, 60, 190)), count=8, size=(380, 300), frames=50)
    frames, truth = draw(scene)
    wide = []
    for k, frame in enumerate(frames):
        picture = cv2.copyMakeBorder(frame, 0, 0, 0, 140, cv2.BORDER_CONSTANT, value=(150,) * 3)
        struck = BESIDE[1] - [0.0, max(0, k - 44) * 20.0]
        for column, row in (BESIDE[0], struck):
            place = round(column), round(row)
            cv2.circle(picture, place, 9, (60, 60, 60), -1, cv2.LINE_AA)
        noise = np.random.default_rng(k).normal(0.0, 2.0, picture.shape)
        wide.append(np.clip(np.rint(picture + noise), 0, 255).astype(np.uint8))
    return wide, truth


@pytest.fixture(scope='module')
def frames_and_truth():
    return film()


def places_found(frames, count='', frame=0):
    text = (
        'trays:\n  1:\n    dimensions_mm: [520, 300]\n    species:\n'
        f'      - {{diameter_mm: 18, look: auto{count}}}\n'
    )
    detector = SceneDetector(load_trays(text)[1], 1000.0)
    detector.learn(frames[::2])
    return detector.detect(frames[frame])[0].positions - 0.5


def distance(places, place):
    return np.hypot(*(places - place).T).min()


def test_what_never_moves_beside_the_beads_is_none(frames_and_truth):
    frames, truth = frames_and_truth
    places = places_found(frames)
    assert distance(places, BESIDE[0]) > 9.0
    assert max(distance(places, bead[:2]) for bead in truth[0]) < 1.0


def test_a_bead_that_is_struck_at_last_is_one_from_the_start(frames_and_truth):
    frames, _ = frames_and_truth
    assert distance(places_found(frames), BESIDE[1]) < 1.0


def test_as_many_as_told_may_lie_beside(frames_and_truth):
    frames, _ = frames_and_truth
    assert distance(places_found(frames, ', count: 10'), BESIDE[0]) < 1.0
    assert distance(places_found(frames, ', count: 9'), BESIDE[0]) > 9.0
