"""Speeds that may be wrong carry a flag; and pictures that turn gray, or hide a species."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import Frame, Quality, SpeedEstimate, SpeedMethod, TrayImage
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.simulation.tray_camera.tray_renderer import TrayCamera
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.stages.preprocess.shaking.difference_noise import NoiseMeter

NS = 1e9
SCALE = 12500.0


def settings_of(number, method, **values):
    names = {
        'trays': (number,),
        'preprocess.pixels_per_metre': SCALE,
        'speed.method': method,
        **values,
    }
    return with_values(PipelineSettings(), names, 'test')


def filmed(number, mean_speed, frames, noise=2.0):
    """Tray images, and stamps with the true mean speed past the camera."""
    tray = load_trays()[number]
    width, height = (round(side * SCALE) + 40 for side in tray.dimensions[:2])
    settings = SimulationSettings(
        tray=number, seed=3, mean_speed=mean_speed * 4.0 / np.pi, first_shake=0.5,
        width_px=width, height_px=height, pixels_per_metre=SCALE, noise=noise,
        restitution=1.0, wall_restitution=1.0,
    )  # fmt: skip
    stages = settings_of(number, 'auto')
    crop = Preprocessor(stages, trays_of(stages), 'test')
    shaken = ShakenTray(settings, tray)
    camera = TrayCamera(settings, tray, shaken.radii, shaken.materials)
    images, truth = [], []
    for k, moment in enumerate(shaken.moments(frames)):
        picture = camera.picture(moment.positions, k)
        frame = Frame(stamp_ns=moment.truth.stamp_ns, encoding='bgr8', image=picture)
        images += [record for record in crop.push(frame) if isinstance(record, TrayImage)]
        truth.append((moment.truth.stamp_ns, moment.truth.mean_projected_speed))
    return images, np.array(truth)


@pytest.fixture(scope='module')
def grains():
    """Tray 7 at 18 mm/s, where a grain comes as far between two pictures as the next one is."""
    return filmed(7, 18e-3, 120)


@pytest.fixture(scope='module')
def mixture():
    return filmed(3, 4e-3, 200)


def pushed(images, number, method, **values):
    estimator = TrayMeasurement(settings_of(number, method, **values), load_trays()[number])
    return [
        record
        for image in images
        for record in estimator.push(image)
        if isinstance(record, SpeedEstimate)
    ]


def ratios(estimates, truth):
    moving = [
        estimate for estimate in estimates if estimate.cycle > 0 and estimate.stamp_ns > 1.0 * NS
    ]
    true = np.interp([speed.stamp_ns for speed in moving], *truth.T)
    return np.array([speed.mean_projected_speed.value for speed in moving]) / true, moving


def test_speeds_from_tracks_of_grains_that_come_as_far_as_the_next_one_are_flagged(grains):
    images, _ = grains
    moving = [speed for speed in pushed(images, 7, 'tracking') if speed.stamp_ns > 1.0 * NS]
    assert moving
    assert all(speed.quality & Quality.UNCERTAIN for speed in moving)


def test_speeds_from_tracks_of_beads_that_are_well_apart_are_not_flagged(mixture):
    images, truth = mixture
    ratio, speeds = ratios(pushed(images, 3, 'tracking'), truth)
    assert ratio.mean() == pytest.approx(1.0, abs=0.05)
    assert not any(record.quality for record in speeds)


def test_the_structure_function_is_chosen_for_crowded_fast_grains_and_is_right(grains):
    images, truth = grains
    ratio, speeds = ratios(pushed(images, 7, 'auto'), truth)
    assert {record.method for record in speeds} == {SpeedMethod.STRUCTURE_FUNCTION}
    assert ratio.mean() == pytest.approx(1.0, abs=0.1)


def test_the_noise_of_grains_in_motion_is_that_of_grains_at_rest(grains):
    images, _ = grains
    meter = NoiseMeter()
    noise = [meter.push(image.gray) for image in images]
    assert max(noise[20:]) <= max(noise[5:14])


def test_the_papers_recipe_is_flagged_until_it_is_calibrated(mixture):
    images, _ = mixture
    plain = pushed(images, 3, 'binarised_area')
    assert all(speed.quality & Quality.UNCALIBRATED for speed in plain)
    known = pushed(images, 3, 'binarised_area', **{'speed.area_factor': 0.7})
    assert not any(speed.quality & Quality.UNCALIBRATED for speed in known)


def test_the_papers_recipe_is_flagged_where_the_area_is_saturated():
    images, _ = filmed(1, 15e-3, 60)
    known = {'speed.area_factor': 0.7}
    fast = [speed for speed in pushed(images, 1, 'binarised_area', **known) if speed.stamp_ns > NS]
    assert fast
    assert all(speed.quality & Quality.UNCERTAIN for speed in fast)


def test_a_picture_without_colour_in_between_is_left_out_and_flagged(mixture):
    images, truth = mixture
    some = [
        replace(image, color=None) if k in (90, 91, 120) else image
        for k, image in enumerate(images)
    ]
    ratio, speeds = ratios(pushed(some, 3, 'structure_function'), truth)
    assert ratio.mean() == pytest.approx(1.0, abs=0.1)
    assert any(record.quality & Quality.GRAY_CAMERA for record in speeds)
    assert not all(record.quality & Quality.GRAY_CAMERA for record in speeds)


def test_when_colour_is_gone_for_good_all_beads_are_seen_as_one_and_the_error_flags_it(mixture):
    images, _ = mixture
    gone = [replace(image, color=None) if k >= 60 else image for k, image in enumerate(images)]
    speeds = pushed(gone, 3, 'structure_function')
    last = speeds[-1]
    assert not last.species_speeds
    assert last.quality & Quality.UNCERTAIN
    assert last.stamp_ns > 5.0 * NS


def test_a_species_that_never_shows_does_not_silence_the_structure_function(mixture):
    images, truth = mixture
    # A gray camera whose driver says that it gives colour.
    dull = [replace(image, color=np.repeat(image.gray[:, :, None], 3, axis=2)) for image in images]
    speeds = pushed(dull, 3, 'structure_function')
    assert speeds
    assert not any(record.species_speeds for record in speeds)
    ratio, _ = ratios(speeds, truth)
    assert ratio.mean() == pytest.approx(1.0, abs=0.35)
