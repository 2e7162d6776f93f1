"""Films by drawn cameras: files that decode, and the truth beside them."""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import CompressionSettings, SimulationSettings
from nanorocks_ros.simulation.plate_scene.drawn_camera import CameraRanges, drawn_camera
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm
from nanorocks_ros.studies.synthetic.drawn_film import write_drawn_film, write_film

TRAY = load_trays()[1]
GAS = SimulationSettings(seed=5, first_shake=0.2, mean_speed=0.01)
SMALL = CameraRanges(scale=(7000.0, 9000.0), frame_rate=(25.0, 30.0))


def decoded(path):
    video = cv2.VideoCapture(str(path))
    images = []
    while (frame := video.read())[0]:
        images.append(frame[1])
    return images


@pytest.mark.parametrize('codec', ['jpeg', 'h264_crf'])
def test_a_film_decodes_and_has_its_truth_beside_it(tmp_path, codec):
    if codec == 'h264_crf':
        pytest.importorskip('av')
    gas = replace(GAS, drag={'jpeg': 0.0, 'h264_crf': 0.5}[codec])
    drawn = drawn_camera(2, TRAY, gas, ranges=SMALL, moving=1.0)
    camera = drawn._replace(
        compression=replace(drawn.compression, codec=codec),
        scene=replace(drawn.scene, swing=0.0002),
    )
    film = write_film(tmp_path / 'film', TRAY, camera, 1.2)
    assert film.video.suffix == {'jpeg': '.avi', 'h264_crf': '.mp4'}[codec]
    images = decoded(film.video)
    assert len(images) == len(film.time) == round(1.2 * film.frame_rate)
    assert images[0].shape == (camera.simulation.height_px, camera.simulation.width_px, 3)
    truth = np.load(film.truth)
    assert truth['P'].shape == truth['V'].shape == (len(images), TRAY.count, 3)
    assert truth['fps'] == film.frame_rate
    assert truth['pre'] == 0.2
    assert np.array_equal(truth['drag'], np.full(15, gas.drag))
    assert json.loads(str(truth['settings']))['scene']['close_up'] is True
    assert truth['merges'].shape == (0, 3)
    for name, values in (('D', film.displacement), ('C', film.shift_px), ('speed', film.speed)):
        assert np.array_equal(truth[name], values)
    # Free flight between two frames late in the film; the tray swings under the beads.
    steps = np.diff(truth['P'], axis=0) * film.frame_rate
    left = np.exp(-gas.drag / film.frame_rate)
    straight = np.abs(truth['V'][1:] - left * truth['V'][:-1]).max(axis=2) < 1e-9
    assert straight.mean() > 0.5
    # Half of what drag takes in a frame: 10 mm/s of 25 frames/s and 0.5 /s.
    assert np.abs(steps - truth['V'][1:])[straight].max() < 2e-5 + 1e-4 * gas.drag * 4.0
    assert np.ptp(film.displacement[:, 0]) > 0.0
    assert film.speed[0] == 0.0
    relative = np.diff(truth['P'][..., :2] - truth['D'][:, np.newaxis], axis=0) * film.frame_rate
    after = film.time[1:] > 0.3
    measured = np.hypot(relative[..., 0], relative[..., 1]).mean(axis=1)[after]
    assert measured.mean() == pytest.approx(film.speed[1:][after].mean(), rel=0.03)


def test_beads_in_the_video_are_where_the_truth_says(tmp_path):
    """Red beads of a sharp film by their colour, whatever camera and tray do."""
    ranges = replace(SMALL, camera_height=(50.0, 50.0), scale=(13000.0, 14000.0))
    camera = drawn_camera(3, TRAY, GAS, ranges=ranges, moving=1.0)
    scene = replace(camera.scene, camera_height=0.0, swing=0.0002, exposure=0.8)
    camera = camera._replace(
        scene=replace(scene, highlights=0.0, shadows=0.0),
        compression=CompressionSettings(codec='jpeg'),
        quality=95,
    )
    film = write_film(tmp_path / 'film', TRAY, camera, 0.6)
    left, top, width, height = film.region
    assert (width, height) == pytest.approx([side * film.scale for side in TRAY.dimensions[:2]])
    errors = []
    for number, image in enumerate(decoded(film.video)):
        blue, green, red = (image[..., k].astype(float) for k in range(3))
        excess = np.maximum(red - 0.5 * (blue + green) - 25.0, 0.0)
        middles = film.positions[number, :, :2] * film.scale + film.shift_px[number]
        middles = middles + np.array([left, top])
        apart = np.hypot(*(middles[:, None] - middles[None]).transpose(2, 0, 1))
        apart[np.diag_indices(len(apart))] = np.inf
        radius = 0.001 * film.scale
        y, x = np.mgrid[0.5 : excess.shape[0], 0.5 : excess.shape[1]]
        for column, row in middles[apart.min(axis=1) > 2.6 * radius]:
            weight = np.where(np.hypot(x - column, y - row) < 1.25 * radius, excess, 0.0)
            errors.append(
                (
                    (weight * x).sum() / weight.sum() - column,
                    (weight * y).sum() / weight.sum() - row,
                )
            )
    assert len(errors) > 60
    # Shaded beads are brighter towards the lamp: a shift that all have in common.
    assert np.abs(np.mean(errors, axis=0)).max() < 0.035 * radius
    assert np.std(errors, axis=0).max() < 0.25


def test_merges_are_those_of_the_bodies(tmp_path):
    sticky = replace(GAS, first_shake=0.0, sticking_speed=0.01)
    film = write_film(tmp_path / 'film', TRAY, drawn_camera(4, TRAY, sticky, ranges=SMALL), 2.0)
    merges = np.load(film.truth)['merges']
    bodies = [len(np.unique(row)) for row in film.bodies]
    assert len(merges) == bodies[0] - bodies[-1] > 0
    assert (np.diff(merges[:, 0]) >= 0.0).all()
    assert (merges[:, 1] < merges[:, 2]).all()


def test_films_are_made_from_two_seeds(tmp_path):
    first, again, other = (
        write_drawn_film(tmp_path / name, TRAY, replace(GAS, first_shake=0.0), 0.1, seed)
        for name, seed in (('a', 7), ('b', 7), ('c', 8))
    )
    assert first.camera == again.camera != other.camera
    # The pictures are the same; the encoder may give another stream for them.
    assert np.array_equal(first.positions, again.positions)
    assert _pictures_of(first) == _pictures_of(again) != _pictures_of(other)
    assert not first.shift_px.any()
    # Another camera, the same beads.
    assert np.array_equal(first.positions[0], other.positions[0])


def _pictures_of(film):
    """Pictures of the film before the codec, as bytes."""
    camera = film.camera
    scene = SceneFilm(camera.simulation, camera.scene, {TRAY.number: TRAY})
    return [moment.frame.image.tobytes() for moment in scene.moments(3)]
