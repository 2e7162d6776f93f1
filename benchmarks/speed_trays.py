"""Mean projected speed from frames over the truth, trays 1 to 7, by method, effects on and off.

The whole plate is filmed through the lens, with all effects and JPEG 85 or with none, in gases of
constant speed. Each estimate is compared with the true mean projected speed of all beads over its
window, and estimates without a quality flag are averaged; `!`: more than half have a flag, and the
average is over all. Brackets give the stated error over the truth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.view import View
from nanorocks_ros.jobs.worker_processes import run_in_processes
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import Frame, Quality, SpeedEstimate, SpeedMethod, TrayImage
from nanorocks_ros.settings import (
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm, without_effects
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.wire.flat_records import flat_value

if TYPE_CHECKING:
    from collections.abc import Iterator

    from nanorocks_ros.records import BeadsTruth

_SCALE = 12500.0
_TRAYS = (1, 2, 3, 4, 5, 6, 7)
_SPECIES_OF = (3, 4, 5, 7)
_SPEEDS = (0.1e-3, 0.5e-3, 2e-3, 7e-3, 15e-3)
# Slow beads need time to leave their positions.
_SECONDS = (15.0, 12.0, 12.0, 8.0, 8.0)
_METHODS = {
    'auto': {},
    'tracking': {'speed.method': 'tracking'},
    'structure function': {'speed.method': 'structure_function'},
    'binarised area': {'speed.method': 'binarised_area'},
}
_RATE = 30.0
_SHAKE = 0.5
_PROCESSES = 2
# Mean speed in the image plane over that in space, of an isotropic gas.
_PROJECTED = np.pi / 4.0
_OFF = 0.2
_NS = 1e9


@dataclass(frozen=True)
class _Task:
    """One film: a mean projected speed [m/s], its length [s], and whether effects are on."""

    speed: float
    seconds: float
    effects: bool


@dataclass(frozen=True)
class _Compared:
    """Ratios of an estimate to the truth: speed of all beads, stated error, speed by species.

    `trusted`: without a quality flag.
    """

    ratio: float
    error: float
    species: tuple[float, ...]
    trusted: bool
    quality: Quality
    method: SpeedMethod


_Found = dict[tuple[int, str], list[_Compared]]


def report() -> None:
    """Print the tables."""
    tasks = [
        _Task(speed, seconds, effects)
        for effects in (False, True)
        for speed, seconds in zip(_SPEEDS, _SECONDS, strict=True)
    ]
    # Longest tasks first, for balanced processes.
    longest_first = sorted(tasks, key=lambda task: -task.seconds * (1 + task.effects))
    named = {str(task): task for task in longest_first}
    results = dict(run_in_processes(_compared, named, _PROCESSES))
    for effects in (False, True):
        _print(effects, [results[str(task)] for task in tasks if task.effects is effects])


def _print(effects: bool, columns: list[_Found]) -> None:
    titles = ' | '.join(f'{1e3 * speed:g} mm/s' for speed in _SPEEDS)
    rule = ' --- |' * len(_SPEEDS)
    print(f'all effects, JPEG 85: {"yes" if effects else "no"}\n')
    print(f'| tray | method | {titles} |\n| --- | --- |{rule}')
    for key in product(_TRAYS, _METHODS):
        cells = ' | '.join(_cell(column[key]) for column in columns)
        print(f'| {key[0]} | {key[1]} | {cells} |')
    print(f'\nby species, `auto`\n\n| tray | species | {titles} |\n| --- | --- |{rule}')
    for tray in _SPECIES_OF:
        for k, species in enumerate(load_trays()[tray].species):
            cells = ' | '.join(_species_cell(column[tray, 'auto'], k) for column in columns)
            print(f'| {tray} | {species.material} | {cells} |')
    print(f'\nwhat `auto` chose, and the flags of more than half of its estimates\n\n'
          f'| tray | {titles} |\n| --- |{rule}')  # fmt: skip
    for tray in _TRAYS:
        cells = ' | '.join(_choice(column[tray, 'auto']) for column in columns)
        print(f'| {tray} | {cells} |')
    print('\nestimates off by more than 20 %: share of all, and of those without a flag\n')
    print('| method | all | without a flag |\n| --- | --- | --- |')
    for method in _METHODS:
        all_estimates = [
            estimate for column in columns for tray in _TRAYS for estimate in column[tray, method]
        ]
        trusted = [estimate for estimate in all_estimates if estimate.trusted]
        print(f'| {method} | {_share_off(all_estimates)} | {_share_off(trusted)} |')
    print(flush=True)


def _compared(task: _Task) -> _Found:
    """All estimates of all trays by each method, from the same frames."""
    cv2.setNumThreads(1)
    film, stage, estimators = _stages(task)
    estimates: dict[tuple[int, str], list[SpeedEstimate]] = {key: [] for key in estimators}
    truth: dict[int, list[np.ndarray]] = {tray: [] for tray in _TRAYS}
    for frame, beads in _pictures(film, round(task.seconds * _RATE), task.effects):
        for bead in beads:
            truth[bead.tray].append(_true_speeds(bead))
        for image in stage.push(frame):
            if not isinstance(image, TrayImage):
                continue
            for method in _METHODS:
                records = estimators[image.tray, method].push(image)
                estimates[image.tray, method] += [
                    record for record in records if isinstance(record, SpeedEstimate)
                ]
    return {key: _ratios(speeds, np.array(truth[key[0]]).T) for key, speeds in estimates.items()}


def _stages(task: _Task) -> tuple[SceneFilm, Preprocessor, dict[tuple[int, str], TrayMeasurement]]:
    scene = with_values(SceneSettings(trays=_TRAYS), {'swing_knocks': False}, 'benchmark')
    film = SceneFilm(
        SimulationSettings(
            mean_speed=task.speed / _PROJECTED,
            first_shake=_SHAKE,
            frame_rate=_RATE,
            restitution=1.0,
            wall_restitution=1.0,
        ),
        scene if task.effects else without_effects(scene),
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
        (tray, method): TrayMeasurement(with_values(settings, values, 'benchmark'), flown[tray])
        for tray in _TRAYS
        for method, values in _METHODS.items()
    }
    return film, stage, estimators


def _pictures(
    film: SceneFilm, frames: int, effects: bool
) -> Iterator[tuple[Frame, tuple[BeadsTruth, ...]]]:
    for moment in film.moments(frames):
        frame = moment.frame
        if effects:
            jpeg = cv2.imencode('.jpg', frame.image, [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
            frame = replace(frame, image=cv2.imdecode(jpeg, cv2.IMREAD_COLOR))
        yield frame, moment.beads


def _true_speeds(beads: BeadsTruth) -> np.ndarray:
    """Time, mean speed of all beads relative to the camera, and of each species."""
    speeds = beads.projected_speeds
    species = [speeds[beads.species == k].mean() for k in range(int(beads.species.max()) + 1)]
    return np.array([beads.stamp_ns / _NS, speeds.mean(), *species])


def _ratios(estimates: list[SpeedEstimate], truth: np.ndarray) -> list[_Compared]:
    time, *speeds = truth
    compared = []
    for estimate in estimates:
        middle = estimate.stamp_ns / _NS
        if middle < _SHAKE + 0.2:
            continue
        inside = np.abs(time - middle) <= 0.5 * estimate.window + 1e-6
        true, *species = (float(speed[inside].mean()) for speed in speeds)
        species_estimates = tuple(
            flat_value(estimate, f'{name}_species_speed') for name in ('first', 'second')
        )
        compared.append(
            _Compared(
                ratio=estimate.mean_projected_speed.value / true,
                error=estimate.mean_projected_speed.error / true,
                species=tuple(a / b for a, b in zip(species_estimates, species, strict=False)),
                trusted=not estimate.quality,
                quality=estimate.quality,
                method=estimate.method,
            )
        )
    return compared


def _cell(estimates: list[_Compared]) -> str:
    trusted = _trusted(estimates)
    finite = [estimate for estimate in trusted or estimates if np.isfinite(estimate.ratio)]
    if not finite:
        return 'nothing' if not estimates else 'unknown!'
    mark = '' if trusted else '!'
    ratio, error = (
        np.mean([getattr(estimate, name) for estimate in finite]) for name in ('ratio', 'error')
    )
    return f'{ratio:.2f} ({error:.2f}){mark}'


def _species_cell(estimates: list[_Compared], k: int) -> str:
    trusted = _trusted(estimates)
    finite = [
        estimate.species[k]
        for estimate in trusted or estimates
        if np.isfinite(estimate.species[k])
    ]
    return f'{np.mean(finite):.2f}{"" if trusted else "!"}' if finite else 'unknown'


def _trusted(estimates: list[_Compared]) -> list[_Compared]:
    """Those without a flag, when they are half of all at least."""
    trusted = [estimate for estimate in estimates if estimate.trusted]
    return trusted if 2 * len(trusted) >= len(estimates) else []


def _choice(estimates: list[_Compared]) -> str:
    if not estimates:
        return 'nothing'
    methods = sorted({estimate.method.name.lower().replace('_', ' ') for estimate in estimates})
    flags = [
        flag.name.lower()
        for flag in Quality
        if flag.name
        and 2 * sum(flag in estimate.quality for estimate in estimates) > len(estimates)
    ]
    return ' and '.join(methods) + (f': {", ".join(flags)}' if flags else '')


def _share_off(estimates: list[_Compared]) -> str:
    if not estimates:
        return 'none'
    off = sum(not abs(estimate.ratio - 1.0) <= _OFF for estimate in estimates)
    return f'{off / len(estimates):.1%} of {len(estimates)}'
