"""Mean projected speed from frames over the truth, trays 1 to 7, by method, effects on and off.

The whole plate is filmed through the lens, with all effects and JPEG 85 or with none, in gases
that do not cool, so that each speed holds throughout. Each estimate is compared with the true mean
projected speed of all beads over its own window. In brackets: the error that the estimates give
for themselves, over the truth; `!`: more than half of the estimates carry a quality flag.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.experiment.settings import (
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.view import View
from nanorocks_ros.records import Frame, SpeedEstimate, SpeedMethod, TrayImage
from nanorocks_ros.simulation.scene.film import SceneFilm, without_effects
from nanorocks_ros.stages.preprocess import Preprocessor
from nanorocks_ros.stages.speed import SpeedEstimator

if TYPE_CHECKING:
    from collections.abc import Iterator

_SCALE = 12500.0
_TRAYS = (1, 2, 3, 4, 5, 6, 7)
_SPEEDS = (0.1e-3, 0.5e-3, 2e-3, 7e-3, 15e-3)
# Slow beads need time to leave their places.
_SECONDS = (40.0, 25.0, 12.0, 8.0, 8.0)
_METHODS = {
    'auto': {},
    'tracking': {'speed.method': 'tracking'},
    'structure function': {'speed.method': 'structure_function'},
    'binarised area': {'speed.method': 'binarised_area'},
}
_RATE = 30.0
_SHAKE = 0.5
# Mean speed in the image plane over that in space, of an isotropic gas.
_PROJECTED = np.pi / 4.0
_NS = 1e9


def report() -> None:
    """Print the tables."""
    for effects in (False, True):
        print(f'all effects, JPEG 85: {"yes" if effects else "no"}\n')
        found = {
            speed: _ratios(speed, seconds, effects)
            for speed, seconds in zip(_SPEEDS, _SECONDS, strict=True)
        }
        titles = ' | '.join(f'{1e3 * speed:g} mm/s' for speed in _SPEEDS)
        print(f'| tray | method | {titles} |\n| --- | --- |' + ' --- |' * len(_SPEEDS))
        for tray in _TRAYS:
            for method in _METHODS:
                cells = ' | '.join(found[speed][tray, method] for speed in _SPEEDS)
                print(f'| {tray} | {method} | {cells} |')
        print(flush=True)


def _ratios(speed: float, seconds: float, effects: bool) -> dict[tuple[int, str], str]:
    scene = with_values(SceneSettings(trays=_TRAYS), {'swing_knocks': False}, 'benchmark')
    film = SceneFilm(
        SimulationSettings(
            mean_speed=speed / _PROJECTED,
            first_shake=_SHAKE,
            frame_rate=_RATE,
            restitution=1.0,
            wall_restitution=1.0,
        ),
        scene if effects else without_effects(scene),
    )
    names = {
        'trays': list(_TRAYS),
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': _SCALE,
    }
    settings = with_values(PipelineSettings(), names, 'benchmark')
    flown = load_trays()
    stage = Preprocessor(
        settings, {n: flown[n] for n in _TRAYS}, 'film', View(camera=film.camera.geometry.camera)
    )
    estimators = {
        (tray, method): SpeedEstimator(with_values(settings, values, 'benchmark'), flown[tray])
        for tray in _TRAYS
        for method, values in _METHODS.items()
    }
    estimates: dict[tuple[int, str], list[SpeedEstimate]] = {key: [] for key in estimators}
    truth: dict[int, list[tuple[float, float]]] = {tray: [] for tray in _TRAYS}
    for frame, true in _pictures(film, round(seconds * _RATE), effects):
        for tray, value in true.items():
            truth[tray].append((frame.stamp_ns / _NS, value))
        for image in stage.push(frame):
            if not isinstance(image, TrayImage):
                continue
            for method in _METHODS:
                records = estimators[image.tray, method].push(image)
                estimates[image.tray, method] += [
                    one for one in records if isinstance(one, SpeedEstimate)
                ]
    return {key: _cell(found, np.array(truth[key[0]]).T) for key, found in estimates.items()}


def _pictures(
    film: SceneFilm, frames: int, effects: bool
) -> Iterator[tuple[Frame, dict[int, float]]]:
    for moment in film.moments(frames):
        image = moment.frame.image
        if effects:
            jpeg = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
            image = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
        frame = Frame(stamp_ns=moment.frame.stamp_ns, encoding='bgr8', image=image)
        yield (
            frame,
            {one.tray: float(np.hypot(*one.velocities[:, :2].T).mean()) for one in moment.beads},
        )


def _cell(found: list[SpeedEstimate], truth: np.ndarray) -> str:
    time, speed = truth
    ratios, errors, flagged, tracked = [], [], 0, 0
    for one in found:
        middle = one.stamp_ns / _NS
        if middle < _SHAKE + 0.2:
            continue
        inside = np.abs(time - middle) <= 0.5 * one.window + 1e-6
        true = speed[inside].mean()
        ratios.append(one.mean_projected_speed / true)
        errors.append(one.mean_projected_speed_error / true)
        flagged += bool(one.quality)
        tracked += one.method is SpeedMethod.TRACKING
    if not ratios:
        return 'nothing'
    mark = '!' if 2 * flagged > len(ratios) else ''
    return f'{np.mean(ratios):.2f} ({np.mean(errors):.2f}){mark}'
