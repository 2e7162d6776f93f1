"""Speeds from simulated frames against the truth, and the events in between."""

from __future__ import annotations

import itertools
import weakref
from dataclasses import replace

import cv2
import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.records import (
    Frame,
    MotionMask,
    PairCollision,
    Quality,
    Rebound,
    SpeedEstimate,
    SpeedMethod,
    Tracks,
    TrayImage,
)
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.simulation.tray_camera.tray_film import film
from nanorocks_ros.simulation.tray_camera.tray_renderer import TrayCamera
from nanorocks_ros.stages.preprocess.preprocessor import Preprocessor
from nanorocks_ros.stages.speed.speed_estimator import SpeedEstimator

NS = 1e9
TRAY = load_trays()[1]
SCALE = PipelineSettings().preprocess.pixels_per_metre


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


def pushed(images, method='structure_function', **values):
    settings = with_values(PipelineSettings(), {'speed.method': method, **values}, 'test')
    return list(measured(SpeedEstimator(settings, TRAY), images))


def measured(estimator, images, kinds=(SpeedEstimate, MotionMask)):
    return (one for image in images for one in estimator.push(image) if isinstance(one, kinds))


def ratios(estimates, truth):
    """Estimate over the truth averaged over the estimate's own window."""
    time = np.array([one.stamp_ns for one in truth]) / NS
    true = np.array([one.mean_projected_speed for one in truth])
    found = []
    for estimate in estimates:
        inside = np.abs(time - estimate.stamp_ns / NS) <= 0.5 * estimate.window + 1e-6
        if estimate.cycle > 0:
            measured = (estimate.mean_projected_speed.value, estimate.mean_projected_speed.error)
            found.append((*measured, true[inside].mean()))
    return np.array(found)


@pytest.mark.parametrize('method', ['auto', 'tracking', 'structure_function'])
@pytest.mark.parametrize('mean_speed', [0.0025, 0.007])
def test_it_is_within_ten_per_cent_of_the_truth_and_knows_its_error(mean_speed, method):
    images, truth = filmed(14.0, seed=2, mean_speed=mean_speed)
    speed, error, true = ratios(pushed(images, method), truth).T
    assert speed.size > 100
    assert (speed / true).mean() == pytest.approx(1.0, abs=0.03)
    assert np.quantile(np.abs(speed / true - 1.0), 0.95) < 0.1
    assert 0.5 < ((speed - true) / error).std() < 1.5


@pytest.mark.parametrize('method', ['auto', 'tracking', 'structure_function'])
def test_beads_at_rest_have_no_speed(run, method):
    at_rest = [one for one in pushed(run[0], method) if one.cycle == 0]
    assert len(at_rest) >= 3
    assert all(one.mean_projected_speed.value < 2e-4 for one in at_rest)
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


@pytest.mark.parametrize('method', ['auto', 'tracking', 'structure_function', 'binarised_area'])
def test_estimates_come_in_order_of_time(run, method):
    stamps = [one.stamp_ns for one in pushed(run[0], method)]
    assert all(before < after for before, after in itertools.pairwise(stamps))


def test_nothing_is_said_until_the_beads_are_known(run):
    assert pushed(run[0][:45]) == []


def test_the_number_of_beads_visible_does_not_matter(run):
    images, truth = run
    half = [
        TrayImage(stamp_ns=image.stamp_ns, tray=1, gray=image.gray[:, : image.gray.shape[1] // 2])
        for image in images
    ]
    speed, _, true = ratios(pushed(half), truth).T
    assert (speed / true).mean() == pytest.approx(1.0, abs=0.15)


def test_a_transposed_film_gives_the_same_speeds(run):
    turned = [
        TrayImage(stamp_ns=one.stamp_ns, tray=1, gray=np.ascontiguousarray(one.gray.T))
        for one in run[0]
    ]
    before = [one.mean_projected_speed.value for one in pushed(run[0])]
    after = [one.mean_projected_speed.value for one in pushed(turned)]
    assert after == pytest.approx(before, rel=1e-3, abs=1e-6)


def test_half_the_time_between_frames_is_twice_the_speed(run):
    fast = [TrayImage(stamp_ns=one.stamp_ns // 2, tray=1, gray=one.gray) for one in run[0]]
    before = pushed(run[0])
    after = pushed(fast, **{'speed.interval': 0.05, 'speed.min_cycle_duration': 2.5})
    by_stamp = {one.stamp_ns // 2: one.mean_projected_speed.value for one in before}
    both = [
        (by_stamp[stamp], one.mean_projected_speed.value)
        for one in after
        for stamp in (one.stamp_ns, one.stamp_ns + 1, one.stamp_ns - 1)
        if stamp in by_stamp and by_stamp[stamp] > 1e-3
    ]
    assert len(both) > 20
    single, double = np.array(both).T
    assert np.median(double / single) == pytest.approx(2.0, rel=0.03)


@pytest.mark.parametrize('method', ['tracking', 'structure_function'])
def test_frames_that_are_missing_do_not_change_the_speed(run, method):
    images, truth = run
    rng = np.random.default_rng(3)
    kept = [image for image in images if rng.random() > 0.2]
    speed, _, true = ratios(pushed(kept, method), truth).T
    assert (speed / true).mean() == pytest.approx(1.0, abs=0.05)


def test_time_that_goes_back_starts_all_afresh(run):
    estimator = SpeedEstimator(PipelineSettings(), TRAY)
    passes = [list(measured(estimator, run[0])) for _ in range(2)]
    assert passes[0] == passes[1]


def test_contacts_are_found_where_beads_are_tracked_and_belong_to_their_cycle(run):
    images, _ = run
    kinds = (Rebound, PairCollision)
    found = list(measured(SpeedEstimator(PipelineSettings(), TRAY), images, kinds))
    start_ns = next(image.cycle_start_ns for image in images if image.cycle_start_ns is not None)
    assert {type(one) for one in found} == set(kinds)
    assert all(one.cycle == int(one.stamp_ns >= start_ns) for one in found)
    off = {'cooling.rebounds': False, 'cooling.collisions': False}
    settings = with_values(PipelineSettings(), off, 'test')
    assert not list(measured(SpeedEstimator(settings, TRAY), images, kinds))
    settings = with_values(PipelineSettings(), {'speed.method': 'structure_function'}, 'test')
    assert not list(measured(SpeedEstimator(settings, TRAY), images, kinds))


@pytest.mark.parametrize('averaging', ['none', 'running_mean', 'block_mean'])
@pytest.mark.parametrize('geometry', ['exact', 'taylor'])
def test_the_papers_recipe_can_be_had_in_all_its_readings(run, averaging, geometry):
    images, truth = run
    values = {
        'speed.averaging': averaging,
        'speed.geometry': geometry,
    }
    found = pushed(images, 'binarised_area', **values)
    assert {one.method for one in found} == {SpeedMethod.BINARISED_AREA}
    speed, _, true = ratios(found, truth).T
    known = np.isfinite(speed)
    # Off by the factors that docs/method/speed.md gives, but it follows the motion.
    assert 0.3 < np.median(speed[known] / true[known]) < 6.0


def test_one_frame_as_the_time_step_is_ten_times_too_fast(run):
    recipe = {'method': 'binarised_area', 'speed.geometry': 'taylor'}
    compared = pushed(run[0], **recipe)
    printed = pushed(run[0], **recipe, **{'speed.time_step': 'one_frame'})
    assert len(compared) == len(printed)
    factors = [
        b.mean_projected_speed.value / a.mean_projected_speed.value
        for a, b in zip(compared, printed, strict=True)
        if a.mean_projected_speed.value > 0
    ]
    assert np.median(factors) == pytest.approx(10.0, rel=1e-3)


def test_the_exact_geometry_reads_more_than_its_taylor_form(run):
    recipe = {'method': 'binarised_area', 'speed.averaging': 'none'}
    exact = pushed(run[0], **recipe)
    taylor = pushed(run[0], **recipe, **{'speed.geometry': 'taylor'})
    pairs = [
        (a.mean_projected_speed.value, b.mean_projected_speed.value)
        for a, b in zip(exact, taylor, strict=True)
        if b.mean_projected_speed.value > 2e-3
    ]
    assert len(pairs) > 50
    assert all(a > b for a, b in pairs)


def test_the_mask_shows_where_beads_moved_and_only_while_somebody_looks(run):
    images, truth = run
    estimator = SpeedEstimator(PipelineSettings(), TRAY)
    estimator.emit_mask = True
    masks = [
        record
        for image in images
        for record in estimator.push(image)
        if isinstance(record, MotionMask)
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
    assert not any(isinstance(record, MotionMask) for found in later for record in found)


def test_frozen_frames_after_motion_are_slow_and_no_shake(run):
    images, _ = run
    last = images[-1]
    frozen = [
        TrayImage(stamp_ns=last.stamp_ns + (k + 1) * round(NS / 30), tray=1, gray=last.gray)
        for k in range(90)
    ]
    estimates = [one for one in pushed([*images, *frozen]) if isinstance(one, SpeedEstimate)]
    assert {estimate.cycle for estimate in estimates} == {0, 1}
    assert estimates[-1].mean_projected_speed.value < 1e-4


def test_tracks_are_relied_upon_where_nearly_all_beads_are_followed(run):
    found = pushed(run[0], 'auto')
    assert {one.method for one in found} == {SpeedMethod.TRACKING}
    assert not any(one.quality & Quality.FEW_BEADS for one in found)


def test_images_are_not_kept_for_a_method_that_is_not_used(run):
    estimator = SpeedEstimator(PipelineSettings(), TRAY)
    kept = []
    for image in run[0]:
        fresh = replace(image, gray=image.gray.copy(), color=image.color.copy())
        kept += [weakref.ref(fresh.gray), weakref.ref(fresh.color)]
        estimator.push(fresh)
    del fresh
    # A dozen are the running mean of the mask, and the last one.
    assert sum(one() is not None for one in kept) <= 12


def test_without_colour_the_structure_function_steps_in(run):
    gray = [TrayImage(stamp_ns=one.stamp_ns, tray=1, gray=one.gray) for one in run[0]]
    found = pushed(gray, 'auto')
    assert all(one.quality & Quality.FEW_BEADS for one in found)
    unflagged = [replace(one, quality=one.quality & ~Quality.FEW_BEADS) for one in found]
    assert unflagged == pushed(gray, 'structure_function') != []


@pytest.fixture(scope='module')
def crowd():
    """Images of a tray with too many grains to follow."""
    settings = SimulationSettings(
        tray=6, width_px=210, height_px=210, first_shake=0.2, mean_speed=0.015
    )
    stages = with_values(PipelineSettings(), {'trays': (6,)}, 'test')
    crop = Preprocessor(stages, trays_of(stages), 'test')
    return [
        image for frame, _ in film(settings, load_trays()[6], 120) for image in crop.push(frame)
    ]


def from_crowd(images, method, emit_tracks=False):
    settings = with_values(PipelineSettings(), {'trays': (6,), 'speed.method': method}, 'test')
    estimator = SpeedEstimator(settings, load_trays()[6])
    estimator.emit_tracks = emit_tracks
    return [record for image in images for record in estimator.push(image)]


def test_a_tray_too_crowded_to_follow_is_left_to_the_structure_function_at_once(crowd):
    found = from_crowd(crowd, 'auto')
    assert all(one.quality & Quality.FEW_BEADS for one in found)
    unflagged = [replace(one, quality=one.quality & ~Quality.FEW_BEADS) for one in found]
    assert unflagged == from_crowd(crowd, 'structure_function') != []


def test_who_wants_the_tracks_of_a_crowded_tray_gets_them_beside_the_same_speeds(crowd):
    found = from_crowd(crowd, 'auto', emit_tracks=True)
    tracks = [one for one in found if isinstance(one, Tracks)]
    assert [one.stamp_ns for one in tracks] == [one.stamp_ns for one in crowd]
    assert [one for one in found if isinstance(one, SpeedEstimate)] == from_crowd(crowd, 'auto')


def test_a_lost_frame_is_no_shaking_event(run):
    images, _ = run
    for lost in range(60, 300, 20):
        kept = [image for k, image in enumerate(images) if k != lost]
        assert max(one.cycle for one in pushed(kept)) == 1


def test_the_motion_of_a_swinging_tray_is_taken_off():
    """Images that follow the tray: beads seem to swing, and do not."""
    images, truth = filmed(12.0, mean_speed=0.002)
    away = 3.0
    swung = []
    for k, image in enumerate(images):
        shift = away * np.sin(2.0 * np.pi * 1.5 * k / 30.0)
        matrix = np.float32([[1.0, 0.0, -shift], [0.0, 1.0, 0.0]])
        moved = cv2.warpAffine(
            image.gray, matrix, image.gray.shape[::-1], borderMode=cv2.BORDER_REPLICATE
        )
        swung.append(
            TrayImage(
                stamp_ns=image.stamp_ns,
                tray=1,
                gray=moved,
                cycle=int(k > 15),
                cycle_start_ns=images[15].stamp_ns if k > 15 else None,
                noise_power=image.noise_power,
                displacement=(shift / SCALE, 0.0),
            )
        )
    blind = [replace(image, displacement=(0.0, 0.0)) for image in swung]
    found, wrong = (ratios(pushed(some), truth).T for some in (swung, blind))
    assert (wrong[0] / wrong[2]).mean() > 1.3
    assert (found[0] / found[2]).mean() == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize('method', ['tracking', 'structure_function'])
@pytest.mark.parametrize(('number', 'tolerance'), [(3, 0.05), (5, 0.1)])
def test_species_are_told_apart(number, tolerance, method):
    """Light beads are the faster ones, and both are right."""
    tray = load_trays()[number]
    settings = SimulationSettings(
        width_px=480, height_px=160, restitution=1.0, wall_restitution=1.0, first_shake=0.5,
        mean_speed=0.003, seed=number,
    )  # fmt: skip
    stages = with_values(PipelineSettings(), {'trays': (number,), 'speed.method': method}, 'test')
    crop = Preprocessor(stages, trays_of(stages), 'test')
    shaken = ShakenTray(settings, tray)
    camera = TrayCamera(settings, tray, shaken.radii, shaken.materials)
    estimator = SpeedEstimator(stages, tray)
    first = np.array(shaken.materials) == tray.species[0].material
    found, truth = [], []
    for k, moment in enumerate(shaken.moments(300)):
        frame = Frame(
            stamp_ns=moment.truth.stamp_ns,
            encoding='bgr8',
            image=camera.picture(moment.positions, k),
        )
        for image in crop.push(frame):
            found += measured(estimator, [image])
        speeds = np.hypot(*moment.velocities[:, :2].T)
        truth.append((moment.truth.stamp_ns, speeds[first].mean(), speeds[~first].mean()))
    stamps, *true = np.array(truth).T
    moving = [one for one in found if one.cycle == 1 and one.stamp_ns > 1e9]
    assert len(moving) > 50
    for values, expected in (
        ([one.species_speeds[0].value for one in moving], true[0]),
        ([one.species_speeds[1].value for one in moving], true[1]),
    ):
        ratio = np.array(values) / np.interp([one.stamp_ns for one in moving], stamps, expected)
        assert ratio.mean() == pytest.approx(1.0, abs=tolerance)
