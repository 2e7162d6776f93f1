"""Lens and regions from the simulated plate, against the lens that it was filmed with."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.experiment.calibration_file import load_calibration
from nanorocks_ros.experiment.plate import regions_on_plate
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline.composition import Pipeline
from nanorocks_ros.records import TrayImage
from nanorocks_ros.settings import (
    CompressionSettings,
    SceneSettings,
    SimulationSettings,
)
from nanorocks_ros.simulation.plate_scene.scene_geometry import scene_camera
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.synthetic.film_scene import SceneRecorder

SAMPLE = Path(__file__).parents[3] / 'bags' / 'tray_1_sample'
# Few frames, far apart: beads have gone elsewhere in between.
SIMULATION = SimulationSettings(first_shake=0.5, frame_rate=2.0)
SCENE = SceneSettings(trays=(1, 2, 3, 4))
SHAPE = (1080, 1920)


@pytest.fixture(scope='module')
def filmed(tmp_path_factory):
    path = tmp_path_factory.mktemp('scene') / 'plate'
    recorder = SceneRecorder(SIMULATION, SCENE, 8.0)
    recorder.into_bag(path, CompressionSettings(rate=0.0), 90, lambda *_: None)
    return path


@pytest.fixture(scope='module')
def made(filmed, tmp_path_factory):
    """The calibration, its file, and what the command printed with --json."""
    folder = tmp_path_factory.mktemp('calibration')
    file, picture = folder / 'lens.yaml', folder / 'lens.png'
    arguments = ['calibrate', str(filmed), '-o', str(file), '--picture', str(picture)]
    assert main(arguments) == 0
    return load_calibration(file), file, picture


def places_in(calibration):
    """Points all over the trays, in the rectified picture of the calibration."""
    shares = np.linspace(0.0, 1.0, 7)
    places = []
    for x, y, width, height in calibration.regions.values():
        a, b = np.meshgrid(x + width * shares, y + height * shares)
        places.append(np.stack([a.ravel(), b.ravel()], axis=-1))
    return np.concatenate(places)


def aligned(points, target):
    """Points moved, turned and scaled to lie on the target as well as they can."""
    x, y = points.T
    ones, zeros = np.ones_like(x), np.zeros_like(x)
    rows = np.stack(
        [np.stack([x, -y, ones, zeros], -1), np.stack([y, x, zeros, ones], -1)], axis=1
    ).reshape(-1, 4)
    return (rows @ np.linalg.lstsq(rows, target.ravel(), rcond=None)[0]).reshape(-1, 2)


def test_the_lens_is_recovered_to_half_a_pixel_anywhere_in_the_trays(made):
    calibration, _, _ = made
    camera = scene_camera(SIMULATION, SCENE)
    points = places_in(calibration)
    true = camera.rectified(calibration.view.source(points))
    away = np.hypot(*(aligned(points, true) - true).T)
    bend = np.hypot(*(camera.distorted(true) - true).T)
    assert bend.max() > 30.0
    assert away.max() < 0.5


def test_the_regions_are_the_floors_to_a_pixel(made):
    calibration, _, _ = made
    expected = regions_on_plate(load_trays().values(), SHAPE, SCENE.pixels_per_metre)
    assert set(calibration.regions) == set(expected)
    for number, region in expected.items():
        assert np.abs(np.array(calibration.regions[number]) - region).max() <= 1
    assert calibration.pixels_per_metre == pytest.approx(SCENE.pixels_per_metre, rel=2e-3)
    assert calibration.residual_px < 0.3


def test_the_picture_shows_the_regions_on_the_straightened_scene(made):
    calibration, _, file = made
    picture = cv2.imread(str(file))
    assert picture.shape == (*SHAPE, 3)
    x, y, width, height = calibration.regions[3]
    for row in (y, y + height - 1):
        line = picture[row, x : x + width].astype(int)
        assert (line[:, 1] - line[:, 2] > 100).all()


def test_an_existing_calibration_can_be_shown(filmed, made, tmp_path, capsys):
    calibration, file, before = made
    picture = tmp_path / 'shown.png'
    arguments = ['calibrate', str(filmed), '--show', str(file), '--picture', str(picture)]
    assert main([*arguments, '--json']) == 0
    values = json.loads(capsys.readouterr().out)
    assert values['pixels_per_metre'] == calibration.pixels_per_metre
    assert values['trays']['3'] == list(calibration.regions[3])
    assert values['largest_bend_px'] > 30.0
    assert np.array_equal(cv2.imread(str(picture)), cv2.imread(str(before)))


def test_the_pipeline_takes_the_calibration_and_follows_the_swing(filmed, made):
    from nanorocks_ros.settings import PipelineSettings, with_values

    calibration, file, _ = made
    values = {'trays': [1, 3, 7], 'preprocess.calibration': str(file)}
    pipeline = Pipeline(with_values(PipelineSettings(), values, 'test'), 'cam')
    motions = {}
    for frame in BagFrames(filmed).frames():
        for record in pipeline.push(frame):
            if isinstance(record, TrayImage):
                assert record.gray.shape == calibration.regions[record.tray][:1:-1]
                motions.setdefault(record.tray, []).append(record.displacement)
    moved = np.array([motions[number] for number in (1, 3, 7)])
    assert np.abs(moved).max() > 3e-5
    # All trays are on one plate: a twentieth of a pixel is 4 micrometres.
    assert np.abs(moved - moved.mean(axis=0)).max() < 8e-6


def test_the_bag_says_what_its_lens_is(filmed):
    assert BagFrames(filmed).view().camera == scene_camera(SIMULATION, SCENE)
    assert BagFrames(SAMPLE).view() is None


def error_of(capsys):
    lines = capsys.readouterr().err.strip().splitlines()
    assert not any('Traceback' in line for line in lines)
    return lines[-1]


def test_a_recording_of_something_else_is_refused(capsys, tmp_path):
    assert main(['calibrate', str(SAMPLE), '-o', str(tmp_path / 'lens.yaml')]) == 1
    line = error_of(capsys)
    assert str(SAMPLE) in line
    assert 'trays' in line
    assert not (tmp_path / 'lens.yaml').exists()


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (('--scale', '2', '1'), '--scale: 2 to 1'),
        (('--show', '/no/such.yaml'), '/no/such.yaml: No such file'),
        (('--show', 'x.yaml', '-o', 'y.yaml'), '--show: cannot be used with --output'),
        (('--trays', '9'), 'tray 9: does not exist'),
    ],
)
def test_a_wrong_call_is_exit_code_2_and_one_line(capsys, arguments, message):
    assert main(['calibrate', str(SAMPLE), *arguments]) == 2
    assert message in error_of(capsys)


def test_a_calibration_of_another_size_is_not_shown(capsys, made):
    _, file, _ = made
    assert main(['calibrate', str(SAMPLE), '--show', str(file)]) == 2
    assert 'is for 1920x1080 px, the recording has' in error_of(capsys)
