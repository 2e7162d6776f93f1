"""Detection for the tracker: species, masks, at most as many as told, learning on the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.drawn_scenes import DrawnScene, draw
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import TrayImage
from nanorocks_ros.settings import PipelineSettings, PreprocessSettings
from nanorocks_ros.stages.tracking.scene.scene_detector import SceneDetector
from nanorocks_ros.stages.tracking.tracker import Tracker

SCENE = DrawnScene(floor=(60, 120, 50), colours=((210, 210, 215),), frames=40, clutter=True)
SCALE = 1000.0


def tray_of(species, more=''):
    rows = ''.join(f'      - {{{row}}}\n' for row in species)
    text = f'trays:\n  1:\n    dimensions_mm: [400, 300]\n{more}    species:\n{rows}'
    return load_trays(text)[1]


@pytest.fixture(scope='module')
def film():
    return draw(SCENE)


def detected(tray, frames, number=0):
    detector = SceneDetector(tray, SCALE)
    detector.learn(frames[::3])
    return detector.detect(frames[number])


def distances(positions, truth):
    """Distance of each bead to the nearest detection, [px]."""
    places = positions - 0.5
    return np.hypot(*(truth[:, None, :2] - places[None]).transpose(2, 0, 1)).min(axis=1)


def test_all_beads_are_detected_where_they_are(film):
    frames, truth = film
    beads = detected(tray_of(['diameter_mm: 18, look: auto']), frames)[0]
    assert len(beads.radii) == SCENE.count
    assert distances(beads.positions, truth[0]).max() < 0.5
    assert np.abs(beads.radii - 9.0).max() < 0.6
    assert (beads.position_errors > 0.0).all()


def test_at_most_as_many_as_told_are_detected(film):
    frames, _ = film
    tray = tray_of(['diameter_mm: 18, look: auto, count: 10'])
    assert len(detected(tray, frames)[0].radii) == 10


def test_masks_and_the_inside_keep_detections_out(film):
    frames, truth = film
    more = (
        '    inside_mm: [[0, 0], [200, 0], [200, 300], [0, 300]]\n'
        '    masks_mm: [[[0, 0], [400, 0], [400, 100], [0, 100]]]\n'
    )
    beads = detected(tray_of(['diameter_mm: 18, look: auto'], more), frames)[0]
    allowed = (truth[0][:, 0] < 200.0) & (truth[0][:, 1] > 100.0)
    assert len(beads.radii) == allowed.sum()
    assert distances(beads.positions, truth[0][allowed]).max() < 0.5


def test_species_are_told_apart_by_their_colour():
    scene = replace(SCENE, colours=((40, 40, 200), (200, 90, 40)), seed=5)
    frames, truth = draw(scene)
    tray = tray_of(['diameter_mm: 18, colour: red', 'diameter_mm: 18, colour: blue'])
    red, blue = detected(tray, frames)
    assert len(red.radii) + len(blue.radii) == scene.count
    assert min(len(red.radii), len(blue.radii)) >= 3
    for beads, channel in ((red, 2), (blue, 0)):
        columns, rows = np.floor(beads.positions).astype(int).T
        assert (frames[0][rows, columns].argmax(axis=1) == channel).all()
    both = np.concatenate([red.positions, blue.positions])
    assert distances(both, truth[0]).max() < 0.5


@pytest.mark.parametrize('told', [0, 1])
def test_a_species_of_any_colour_beside_one_whose_colour_is_told(told):
    scene = replace(SCENE, colours=((40, 40, 200), (60, 60, 60)), sizes=(9.0, 9.0), count=24)
    frames, truth = draw(scene)
    rows = ['diameter_mm: 18, look: auto', 'diameter_mm: 18, look: auto']
    rows[told] = 'diameter_mm: 18, colour: red'
    found = detected(tray_of(rows), frames)
    red, dark = found[told], found[1 - told]
    # Colours are drawn in turn.
    for beads, places in ((red, truth[0][::2]), (dark, truth[0][1::2])):
        assert len(beads.radii) == len(places)
        assert distances(beads.positions, places).max() < 0.5


def test_without_a_lesson_the_look_is_learnt_on_the_way(film):
    frames, truth = film
    detector = SceneDetector(tray_of(['diameter_mm: 18, look: auto']), SCALE)
    found = [detector.detect(frame)[0] for frame in frames]
    assert len(found[0].radii) >= 0.9 * SCENE.count
    assert all(len(beads.radii) == SCENE.count for beads in found[12:])
    assert distances(found[-1].positions, truth[-1]).max() < 0.5


def test_dark_beads_are_not_looked_for_when_bright_ones_are_told():
    scene = replace(SCENE, colours=((20, 30, 20), (210, 210, 215)), clutter=False, seed=3)
    frames, truth = draw(scene)
    beads = detected(tray_of(['diameter_mm: 18, colour: white, look: bright']), frames)[0]
    columns, rows = np.floor(beads.positions).astype(int).T
    assert 0 < len(beads.radii) < len(truth[0])
    assert (frames[0][rows, columns].mean(axis=1) > 120.0).all()


def test_a_gray_camera_is_enough(film):
    frames, truth = film
    settings = PipelineSettings(preprocess=PreprocessSettings(pixels_per_metre=SCALE))
    tracker = Tracker(settings, tray_of(['diameter_mm: 18, look: auto']))
    for number, frame in enumerate(frames):
        gray = np.rint(frame.mean(axis=2)).astype(np.uint8)
        image = TrayImage(stamp_ns=number * 33_000_000, tray=1, gray=gray)
        tracks = tracker.push(image)[0]
    assert tracks.seen.sum() == SCENE.count
    assert distances(SCALE * tracks.positions[tracks.seen], truth[-1]).max() < 0.5


def test_species_that_look_alike_are_told_apart_by_their_size():
    scene = replace(SCENE, sizes=(7.0, 9.0), seed=5)
    frames, truth = draw(scene)
    # The larger one first: the order tells nothing.
    large, small = detected(
        tray_of(['diameter_mm: 18, look: auto', 'diameter_mm: 14, look: auto']), frames
    )
    assert len(large.radii) + len(small.radii) == scene.count
    for beads, radius in ((large, 9.0), (small, 7.0)):
        of_size = truth[0][truth[0][:, 2] == radius]
        assert len(beads.radii) == len(of_size)
        assert distances(beads.positions, of_size).max() < 0.5


def test_of_species_with_one_look_and_one_size_the_first_has_all(film):
    frames, _ = film
    kind = 'diameter_mm: 18, look: auto'
    first, second = detected(tray_of([kind, kind]), frames)
    assert (len(first.radii), len(second.radii)) == (SCENE.count, 0)
