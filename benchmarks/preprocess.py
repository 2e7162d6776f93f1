"""Preprocessing of all eight trays at 1080p by stage, against decoding the same JPEGs.

Frames of the oscillating simulated plate with all effects; one thread; each stage alone, best of
several rounds, in CPU time. Also errors of the stabilisation and of the calibration against the
truth.
"""

from __future__ import annotations

import time
from dataclasses import replace

import cv2
import numpy as np

from nanorocks_ros.experiment.plate import regions_on_plate
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.view import View
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.records import Frame, TrayImage
from nanorocks_ros.settings import (
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm
from nanorocks_ros.stages.preprocess.frame_checks import FrameChecks
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.stages.preprocess.gray_image_checks import picture_quality
from nanorocks_ros.stages.preprocess.plate_search import guess_plate
from nanorocks_ros.stages.preprocess.rectify import mix_weights, nodes_of, resample_color
from nanorocks_ros.stages.preprocess.shaking.shake_detection import MotionMeter
from nanorocks_ros.stages.preprocess.stabilise import TrayRegistration
from nanorocks_ros.studies.calibration.plate_fit import fit_plate

_FRAMES = 75
_ROUNDS = 3
_QUALITY = 90
_SCENE = SceneSettings()


def _filmed():
    # Shaken at the tenth frame: two seconds of the largest oscillation.
    simulation = SimulationSettings(first_shake=0.33)
    film = SceneFilm(simulation, _SCENE)
    moments = []
    for moment in film.moments(_FRAMES):
        _, jpeg = cv2.imencode('.jpg', moment.frame.image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        beads = moment.beads[0]
        moments.append((moment.frame.stamp_ns, jpeg, beads.displacement, beads.tray_velocity))
    return film.camera.geometry.camera, moments


def _milliseconds(work, items) -> float:
    """Time per item, the median of a round, the best of all rounds."""
    best = np.inf
    for _ in range(_ROUNDS):
        steps = []
        for item in items:
            start = time.process_time()
            work(item)
            steps.append(time.process_time() - start)
        best = min(best, float(np.median(steps)))
    return 1e3 * best


def _settings() -> PipelineSettings:
    values = {
        'trays': list(range(1, 9)),
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': _SCENE.pixels_per_metre,
    }
    return with_values(PipelineSettings(), values, 'benchmark')


def _whole(camera, frames) -> float:
    best = np.inf
    for _ in range(_ROUNDS):
        settings = _settings()
        stage = Preprocessor(settings, trays_of(settings), 'camera', View(camera=camera))
        steps = []
        for frame in frames:
            start = time.process_time()
            stage.push(frame)
            steps.append(time.process_time() - start)
        best = min(best, float(np.median(steps)))
    return 1e3 * best


def _stages(camera, frames):
    """Milliseconds per frame of each stage alone."""
    view = View(camera=camera)
    settings = _settings().preprocess
    regions = regions_on_plate(load_trays().values(), (1080, 1920), _SCENE.pixels_per_metre)
    mix = np.array(settings.gray_mix)
    wall = settings.wall_width * settings.pixels_per_metre
    followers = [TrayRegistration(region, view, wall, mix) for region in regions.values()]
    nodes = [nodes_of(region, view) for region in regions.values()]
    crops = [
        (np.empty((region.height, region.width, 3), np.uint8), np.empty(region[:1:-1], np.uint8))
        for region in regions.values()
    ]
    meters = [MotionMeter(2.0) for _ in regions]
    weights = mix_weights(settings.gray_mix)
    checks = FrameChecks('camera')
    stamps = iter(range(10**12))

    def follow(frame):
        hint = None
        for follower in followers:
            hint = follower.push(frame.image, hint) or hint

    def crop(frame):
        for node, (color, gray) in zip(nodes, crops, strict=True):
            resample_color(frame.image, node, (0.3, -0.2), weights, color, gray)

    def meter(frame):
        for motion_meter, (_, gray) in zip(meters, crops, strict=True):
            motion_meter.push(frame.stamp_ns, gray)

    def quality(frame):
        for _, gray in crops:
            picture_quality(gray)

    def check(frame):
        checks.push(replace(frame, stamp_ns=next(stamps) * 33_000_000))

    pixels = sum(region.width * region.height for region in regions.values())
    return {
        'frame checks': _milliseconds(check, frames),
        'following 8 trays': _milliseconds(follow, frames),
        f'straight crops and gray mix ({pixels} px)': _milliseconds(crop, frames),
        'noise and motion': _milliseconds(meter, frames),
        'quality flags': _milliseconds(quality, frames),
    }


def _stabilisation(camera, frames, moments) -> None:
    settings = _settings()
    stage = Preprocessor(settings, trays_of(settings), 'camera', View(camera=camera))
    scale = _SCENE.pixels_per_metre
    errors: dict[int, list[np.ndarray]] = {}
    stated, lost, cycles = [], 0, []
    for frame, (_, _, displacement, _) in zip(frames, moments, strict=True):
        for tray_image in stage.push(frame):
            if not isinstance(tray_image, TrayImage):
                continue
            error = (np.array(tray_image.displacement) - displacement) * scale
            lost += int(np.isnan(error).any())
            errors.setdefault(tray_image.tray, []).append(error)
            stated.append(tray_image.displacement_error * scale)
            cycles.append(tray_image.cycle)
    speed = max(float(np.hypot(*velocity)) for *_, velocity in moments)
    print(
        f'\nstabilisation, swing up to {1e3 * speed:.1f} mm/s: error [px] along x, y; rms, worst'
    )
    for tray, tray_errors in sorted(errors.items()):
        rms = np.sqrt(np.nanmean(np.square(tray_errors), axis=0))
        print(f'tray {tray}  {rms[0]:.3f} {rms[1]:.3f}   {np.nanmax(np.abs(tray_errors)):.3f}')
    print(f'stated error {np.nanmedian(stated):.3f} px; lost {lost}; cycles {sorted(set(cycles))}')


def _calibration(camera, frames) -> None:
    grays = [cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY) for frame in frames[::3]]
    picture = np.median(np.stack(grays), axis=0).astype(np.uint8)
    trays = list(load_trays().values())
    guess = guess_plate(picture, trays)
    fit = None if guess is None else fit_plate(picture.astype(np.float32), trays, guess)
    if fit is None:
        print('\ncalibration: the trays were not found')
        return
    points = []
    for x, y, width, height in fit.calibration.regions.values():
        a, b = np.meshgrid(np.linspace(x, x + width, 9), np.linspace(y, y + height, 9))
        points.append(np.stack([a.ravel(), b.ravel()], axis=-1))
    grid_points = np.concatenate(points)
    true = camera.rectified(fit.calibration.view.source(grid_points))
    ones, zeros = np.ones(len(grid_points)), np.zeros(len(grid_points))
    x, y = grid_points.T
    rows = np.stack([np.stack([x, -y, ones, zeros], -1), np.stack([y, x, zeros, ones], -1)], 1)
    rows = rows.reshape(-1, 4)
    best = np.linalg.lstsq(rows, true.ravel(), rcond=None)[0]
    residual = np.hypot(*((rows @ best).reshape(-1, 2) - true).T)
    bend = np.hypot(*(camera.distorted(true) - true).T)
    print(
        f'\ncalibration without a checkerboard: residual {fit.calibration.residual_px:.3f} px; '
        f'in the trays the lens moves points by up to {bend.max():.1f} px, of which '
        f'{residual.max():.2f} px at most are left'
    )


def report() -> None:
    """Print the tables."""
    cv2.setNumThreads(1)
    camera, moments = _filmed()
    frames = [
        Frame(stamp_ns=stamp, encoding='bgr8', image=cv2.imdecode(jpeg, cv2.IMREAD_COLOR))
        for stamp, jpeg, *_ in moments
    ]
    moving = frames[12:]
    jpegs = [jpeg for _, jpeg, *_ in moments[12:]]
    _whole(camera, frames[:3])
    parts = _stages(camera, moving)
    decode = _milliseconds(lambda jpeg: cv2.imdecode(jpeg, cv2.IMREAD_COLOR), jpegs)
    total = _whole(camera, frames)
    print('| stage | ms per frame | / decoding the JPEG |\n| --- | --- | --- |')
    for name, cost in (*parts.items(), ('whole preprocessor', total), ('decoding a JPEG', decode)):
        print(f'| {name} | {cost:.2f} | {cost / decode:.2f} |')
    _stabilisation(camera, frames, moments)
    _calibration(camera, frames)
