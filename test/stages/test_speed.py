"""Speeds from simulated frames against the truth, and the events in between."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from nanorocks_ros.experiment.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import MotionMask, SpeedEstimate, SpeedMethod, TrayImage
from nanorocks_ros.simulation.film import film
from nanorocks_ros.stages.pipeline import trays_of
from nanorocks_ros.stages.preprocess import Preprocessor
from nanorocks_ros.stages.speed import SpeedEstimator

NS = 1e9
TRAY = load_trays()[1]


def filmed(seconds, **values):
    """Tray images and truth of a simulated run."""
    small = {'width_px': 210, 'height_px': 210, 'first_shake': 0.5}
    settings = with_values(SimulationSettings(), {**small, **values}, 'test')
    stages = PipelineSettings()
    crop = Preprocessor(stages, trays_of(stages), 'test')
    images, truth = [], []
    for frame, true in film(settings, TRAY, round(30 * seconds)):
        images += crop.push(frame)
        truth.append(true)
    return images, truth


@pytest.fixture(scope='module')
def run():
    return filmed(12.0, seed=5)


def pushed(images, **values):
    estimator = SpeedEstimator(with_values(PipelineSettings(), values, 'test'), TRAY)
    return [one for image in images for one in estimator.push(image)]


def ratios(estimates, truth):
    """Estimate over the truth averaged over the estimate's own window."""
    time = np.array([one.stamp_ns for one in truth]) / NS
    true = np.array([one.mean_projected_speed for one in truth])
    found = []
    for one in estimates:
        inside = np.abs(time - one.stamp_ns / NS) <= 0.5 * one.window + 1e-6
        if one.cycle > 0:
            measured = (one.mean_projected_speed, one.mean_projected_speed_error)
            found.append((*measured, true[inside].mean()))
    return np.array(found)


@pytest.mark.parametrize('mean_speed', [0.0025, 0.007])
def test_the_default_is_within_ten_per_cent_of_the_truth_and_knows_its_error(mean_speed):
    images, truth = filmed(14.0, seed=2, mean_speed=mean_speed)
    speed, error, true = ratios(pushed(images), truth).T
    assert speed.size > 100
    assert (speed / true).mean() == pytest.approx(1.0, abs=0.03)
    assert np.quantile(np.abs(speed / true - 1.0), 0.95) < 0.1
    assert 0.5 < ((speed - true) / error).std() < 1.5


def test_beads_at_rest_have_no_speed(run):
    at_rest = [one for one in pushed(run[0]) if one.cycle == 0]
    assert len(at_rest) >= 3
    assert all(one.mean_projected_speed < 2e-4 for one in at_rest)
    assert all(one.cycle_start_ns is None for one in at_rest)


def test_the_shaking_event_is_found_to_the_frame(run):
    images, truth = run
    shaken = next(true.stamp_ns for true in truth if true.cycle == 1)
    starts = {one.cycle_start_ns for one in pushed(images) if one.cycle == 1}
    assert len(starts) == 1
    assert abs(starts.pop() - shaken) <= NS / 30


def test_every_shaking_event_is_counted_once():
    images, _ = filmed(20.0, seed=4, shake_period=7.0, restitution=0.6, wall_restitution=0.8)
    cycles = [one.cycle for one in pushed(images)]
    assert sorted(set(cycles)) == [0, 1, 2, 3]
    assert cycles == sorted(cycles)


def test_estimates_come_in_order_of_time(run):
    stamps = [one.stamp_ns for one in pushed(run[0])]
    assert all(before < after for before, after in itertools.pairwise(stamps))


def test_nothing_is_said_until_the_beads_are_known(run):
    assert pushed(run[0][:45]) == []


def test_the_number_of_beads_visible_does_not_matter(run):
    images, truth = run
    half = [
        TrayImage(stamp_ns=one.stamp_ns, tray=1, gray=one.gray[:, : one.gray.shape[1] // 2])
        for one in images
    ]
    speed, _, true = ratios(pushed(half), truth).T
    assert (speed / true).mean() == pytest.approx(1.0, abs=0.15)


def test_a_transposed_film_gives_the_same_speeds(run):
    turned = [
        TrayImage(stamp_ns=one.stamp_ns, tray=1, gray=np.ascontiguousarray(one.gray.T))
        for one in run[0]
    ]
    before = [one.mean_projected_speed for one in pushed(run[0])]
    after = [one.mean_projected_speed for one in pushed(turned)]
    assert after == pytest.approx(before, rel=1e-3, abs=1e-6)


def test_half_the_time_between_frames_is_twice_the_speed(run):
    fast = [TrayImage(stamp_ns=one.stamp_ns // 2, tray=1, gray=one.gray) for one in run[0]]
    before = pushed(run[0])
    after = pushed(fast, **{'speed.interval': 0.05, 'speed.shortest_cycle': 2.5})
    by_stamp = {one.stamp_ns // 2: one.mean_projected_speed for one in before}
    both = [
        (by_stamp[stamp], one.mean_projected_speed)
        for one in after
        for stamp in (one.stamp_ns, one.stamp_ns + 1, one.stamp_ns - 1)
        if stamp in by_stamp and by_stamp[stamp] > 1e-3
    ]
    assert len(both) > 20
    single, double = np.array(both).T
    assert np.median(double / single) == pytest.approx(2.0, rel=0.03)


def test_frames_that_are_missing_do_not_change_the_speed(run):
    images, truth = run
    rng = np.random.default_rng(3)
    kept = [one for one in images if rng.random() > 0.2]
    speed, _, true = ratios(pushed(kept), truth).T
    assert (speed / true).mean() == pytest.approx(1.0, abs=0.05)


def test_time_that_goes_back_starts_all_afresh(run):
    estimator = SpeedEstimator(PipelineSettings(), TRAY)
    passes = [[one for image in run[0] for one in estimator.push(image)] for _ in range(2)]
    assert passes[0] == passes[1]


@pytest.mark.parametrize('averaging', ['none', 'running_mean', 'block_mean'])
@pytest.mark.parametrize('geometry', ['exact', 'taylor'])
def test_the_papers_recipe_can_be_had_in_all_its_readings(run, averaging, geometry):
    images, truth = run
    values = {
        'speed.method': 'binarised_area',
        'speed.averaging': averaging,
        'speed.geometry': geometry,
    }
    found = pushed(images, **values)
    assert {one.method for one in found} == {SpeedMethod.BINARISED_AREA}
    speed, _, true = ratios(found, truth).T
    known = np.isfinite(speed)
    # Off by the factors that docs/physics.md tells, but it follows the motion.
    assert 0.3 < np.median(speed[known] / true[known]) < 6.0


def test_one_frame_as_the_time_step_is_ten_times_too_fast(run):
    recipe = {'speed.method': 'binarised_area', 'speed.geometry': 'taylor'}
    compared = pushed(run[0], **recipe)
    printed = pushed(run[0], **recipe, **{'speed.time_step': 'one_frame'})
    assert len(compared) == len(printed)
    factors = [
        b.mean_projected_speed / a.mean_projected_speed
        for a, b in zip(compared, printed, strict=True)
        if a.mean_projected_speed > 0
    ]
    assert np.median(factors) == pytest.approx(10.0, rel=1e-3)


def test_the_exact_geometry_reads_more_than_its_taylor_form(run):
    recipe = {'speed.method': 'binarised_area', 'speed.averaging': 'none'}
    exact = pushed(run[0], **recipe)
    taylor = pushed(run[0], **recipe, **{'speed.geometry': 'taylor'})
    pairs = [
        (a.mean_projected_speed, b.mean_projected_speed)
        for a, b in zip(exact, taylor, strict=True)
        if b.mean_projected_speed > 2e-3
    ]
    assert len(pairs) > 50
    assert all(a > b for a, b in pairs)


def test_the_mask_shows_where_beads_moved_and_only_while_somebody_looks(run):
    images, truth = run
    estimator = SpeedEstimator(PipelineSettings(), TRAY)
    estimator.emit_mask = True
    masks = [
        one for image in images for one in estimator.push(image) if isinstance(one, MotionMask)
    ]
    moving = {one.stamp_ns: (one.mask > 0).mean() for one in masks}
    assert all(set(np.unique(one.mask)) <= {0, 255} for one in masks)
    at_rest = [moving[t.stamp_ns] for t in truth if t.cycle == 0 and t.stamp_ns in moving]
    shaken = [moving[t.stamp_ns] for t in truth if t.cycle == 1 and t.stamp_ns in moving]
    assert max(at_rest) < 0.002
    # The frame at the event itself still shows the beads where they lay.
    assert min(shaken[1:]) > 0.01
    estimator.emit_mask = False
    later = [estimator.push(image) for image in images]
    assert not any(isinstance(one, MotionMask) for found in later for one in found)


def test_frozen_frames_after_motion_are_slow_and_no_shake(run):
    images, _ = run
    last = images[-1]
    frozen = [
        TrayImage(stamp_ns=last.stamp_ns + (k + 1) * round(NS / 30), tray=1, gray=last.gray)
        for k in range(90)
    ]
    found = [one for one in pushed([*images, *frozen]) if isinstance(one, SpeedEstimate)]
    assert {one.cycle for one in found} == {0, 1}
    assert found[-1].mean_projected_speed < 1e-4
