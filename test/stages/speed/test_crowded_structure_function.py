"""Speeds of grains that cover the floor in layers, from drawn films against the truth."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.view import View
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import Quality, SpeedEstimate
from nanorocks_ros.settings import (
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.stages.speed.crowded_structure_function import least_difference

NS = 1e9
TRAY = 8


def textured(size=60, seed=2):
    rng = np.random.default_rng(seed)
    return rng.integers(0, 255, (size, size)).astype(np.uint8)


def test_grains_that_stay_while_the_tray_moves_are_compared_where_they_are():
    scene = textured(70)
    # The tray moved by 3 columns and -2 rows; pictures that follow it show the grains moved back.
    earlier, later = scene[5:65, 5:65], scene[3:63, 8:68]
    power, left = least_difference(later, earlier, (3.2, -2.0))
    assert power == 0.0
    assert left == pytest.approx(0.2)


def test_grains_that_move_with_the_tray_are_compared_in_its_frame():
    image = textured()
    assert least_difference(image, image, (3.2, -2.0)) == (0.0, 0.0)


def test_the_difference_is_that_of_a_picture_of_full_size():
    rng = np.random.default_rng(3)
    later, earlier = (rng.integers(0, 20, (80, 80)).astype(np.uint8) for _ in range(2))
    at_rest, moved = (least_difference(later, earlier, (shift, 0.0))[0] for shift in (0.0, 7.0))
    assert moved == pytest.approx(at_rest, rel=0.1)


@pytest.fixture(scope='module')
def swinging():
    """Estimates and truth of tray 8 on a plate that swings as fast as the grains fly."""
    scale = 10000.0
    scene = with_values(
        SceneSettings(trays=(TRAY,)), {'pixels_per_metre': scale, 'swing_knocks': False}, 'test'
    )
    film = SceneFilm(
        SimulationSettings(
            mean_speed=0.004, first_shake=0.5, restitution=1.0, wall_restitution=1.0,
            width_px=1536, height_px=864,
        ),
        scene,
    )  # fmt: skip
    names = {
        'trays': [TRAY],
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': scale,
    }
    settings = with_values(PipelineSettings(), names, 'test')
    trays = {TRAY: load_trays()[TRAY]}
    crop = Preprocessor(settings, trays, 'test', View(camera=film.camera.geometry.camera))
    estimator = TrayMeasurement(settings, trays[TRAY])
    estimates, truth = [], []
    for moment in film.moments(150):
        truth.append((moment.frame.stamp_ns / NS, moment.beads[0].projected_speeds.mean()))
        for image in crop.push(moment.frame):
            estimates += estimator.push(image)
    estimates += estimator.flush()
    return [record for record in estimates if isinstance(record, SpeedEstimate)], np.array(truth).T


def test_speeds_on_a_swinging_plate_are_within_ten_per_cent_and_know_their_error(swinging):
    estimates, (time, speed) = swinging
    ratios, errors = [], []
    for estimate in estimates:
        middle = estimate.stamp_ns / NS
        if middle < 0.7:
            continue
        assert not estimate.quality & ~(Quality.FEW_BEADS | Quality.UNCERTAIN)
        true = speed[np.abs(time - middle) <= 0.5 * estimate.window + 1e-6].mean()
        measured = estimate.mean_projected_speed
        ratios.append(measured.value / true)
        errors.append(measured.error / true)
    assert len(ratios) > 20
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.1)
    assert np.mean(errors) < 0.15
    assert np.mean(np.abs(np.array(ratios) - 1.0) < 2.0 * np.array(errors)) > 0.9
