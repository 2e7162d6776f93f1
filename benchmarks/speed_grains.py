"""Speeds of the grains of trays 6 and 8 over the truth, by camera and speed, while they cool.

Both trays are filmed with each camera for a cycle: shaken once to 15 mm/s, then cooling.
Restitutions and seeds differ. A cell is estimate over truth, its standard deviation, and in
brackets the stated error over the truth; `!`: more than half carry a flag other than `few_beads`,
which all speeds of such trays carry. The last column is the restitution of the cycle, with its
truth. A second table holds the path that grains of a simulated gas lose by collisions, over that
of elastic theory.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.view import View
from nanorocks_ros.physics.crowded_grains import displacement_of_path, persistence_length
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import CorEstimate, CorStatus, Quality, SpeedEstimate, TrayImage
from nanorocks_ros.settings import (
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm, without_effects
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator

if TYPE_CHECKING:
    from collections.abc import Iterator

    from nanorocks_ros.records import BeadsTruth, Frame

_TRAYS = (6, 8)
_SCALE, _SHAPE = 12500.0, (1920, 1080)
_SHAKE, _SECONDS, _SPEED = 0.5, 11.0, 0.015
_BINS = (0.1e-3, 0.3e-3, 1e-3, 3e-3, 10e-3)
_NS, _MM = 1e9, 1e3
# Paths compared with elastic theory: their length [m], in so many steps, from these ages [s].
_PATH, _STEPS, _AGES = 0.18e-3, 9, (0.5, 1.5, 5.0)
_RESTITUTIONS = (0.7, 0.8, 0.9, 1.0)


@dataclass(frozen=True, kw_only=True)
class _Camera:
    """One camera and one gas: what differs from the default scene."""

    scale: float = _SCALE
    rate: float = 30.0
    jpeg: int = 85
    effects: bool = True
    restitution: float = 0.89
    seed: int = 101
    scene: dict[str, Any] = field(default_factory=dict)


_CALM = {'swing': 0.0}
_CAMERAS = {
    'no effects': _Camera(effects=False, scene={'noise': 2.0}),
    'all effects': _Camera(restitution=0.8, seed=102),
    '8 px/mm': _Camera(scale=8000.0, restitution=0.85, seed=103, scene=_CALM),
    '20 px/mm': _Camera(scale=20000.0, restitution=0.9, seed=104, scene=_CALM),
    '60 frames/s': _Camera(rate=60.0, restitution=0.75, seed=105, scene=_CALM),
    'blur 1.5 px, noise 6': _Camera(
        restitution=0.93, seed=106, scene={**_CALM, 'defocus_px': 1.5, 'noise': 6.0}
    ),
    'turning 5 rad/s': _Camera(seed=107, scene={**_CALM, 'turning': 5.0, 'irregularity': 0.25}),
    'shadows 0.6, JPEG 60': _Camera(
        jpeg=60, restitution=0.7, seed=108, scene={**_CALM, 'shadows': 0.6, 'highlights': 2.0}
    ),
}


def report(*cameras: str) -> None:
    """Print the table, of some cameras or of all."""
    cv2.setNumThreads(1)
    titles = ' | '.join(f'{_MM * low:g}-{_MM * high:g}' for low, high in pairwise(_BINS))
    print(f'| camera | tray | {titles} mm/s | restitution (truth) |')
    print('| --- | --- |' + ' --- |' * len(_BINS))
    for name in cameras or _CAMERAS:
        camera = _CAMERAS[name]
        estimates, truth = _film(camera)
        for tray in _TRAYS:
            cells = ' | '.join(_cells(estimates[tray], *np.array(truth[tray]).T))
            print(f'| {name} | {tray} | {cells} | {_restitution(estimates[tray])} '
                  f'({camera.restitution:g}) |', flush=True)  # fmt: skip
    if not cameras:
        _print_losses()


def _print_losses() -> None:
    ages = ' | '.join(f'{age:g} s' for age in _AGES)
    print(f'\npath lost over that of elastic theory, over {_MM * _PATH:g} mm\n')
    print(f'| tray | restitution | {ages} |\n| --- | --- |' + ' --- |' * len(_AGES))
    for tray in _TRAYS:
        for restitution in _RESTITUTIONS:
            losses = ' | '.join(f'{loss:.2f}' for loss in _losses(tray, restitution))
            print(f'| {tray} | {restitution:g} | {losses} |', flush=True)


def _losses(number: int, restitution: float) -> Iterator[float]:
    """Loss of path at each age after shaking, over that of elastic theory."""
    tray = load_trays()[number]
    walls = 0.97 if restitution < 1.0 else 1.0
    shaken = ShakenTray(
        SimulationSettings(
            first_shake=0.0, restitution=restitution, wall_restitution=walls, mean_speed=_SPEED
        ),
        tray,
    )
    for age in _AGES:
        step = _PATH / _STEPS / _projected(shaken.at(age)[1])
        states = [shaken.at(age + k * step) for k in range(_STEPS + 1)]
        path = float(np.mean([_projected(velocities) for _, velocities in states])) * _STEPS * step
        away = _projected(states[-1][0] - states[0][0])
        yield (path - away) / (path - displacement_of_path(path, persistence_length(tray)))


def _projected(vectors: np.ndarray) -> float:
    """Mean length in the image plane."""
    return float(np.linalg.norm(vectors[:, :2], axis=1).mean())


def _film(
    camera: _Camera,
) -> tuple[dict[int, list[SpeedEstimate]], dict[int, list[tuple[float, float]]]]:
    """Speeds of both trays, and time [s] and true mean projected speed [m/s] of each frame."""
    film, stage, estimators = _stages(camera)
    estimates: dict[int, list[SpeedEstimate]] = {tray: [] for tray in _TRAYS}
    truth: dict[int, list[tuple[float, float]]] = {tray: [] for tray in _TRAYS}
    for frame, beads in _pictures(film, camera):
        for bead in beads:
            truth[bead.tray].append((bead.stamp_ns / _NS, float(bead.projected_speeds.mean())))
        for image in stage.push(frame):
            if isinstance(image, TrayImage):
                estimates[image.tray] += _speeds(estimators[image.tray].push(image))
    for tray in _TRAYS:
        estimates[tray] += _speeds(estimators[tray].flush())
    return estimates, truth


def _speeds(records: tuple[Any, ...]) -> list[SpeedEstimate]:
    return [record for record in records if isinstance(record, SpeedEstimate)]


def _stages(camera: _Camera) -> tuple[SceneFilm, Preprocessor, dict[int, TrayMeasurement]]:
    drawn = with_values(SceneSettings(trays=_TRAYS), {'pixels_per_metre': camera.scale}, 'scene')
    drawn = drawn if camera.effects else without_effects(drawn)
    columns, rows = (2 * round(0.5 * side * camera.scale / _SCALE) for side in _SHAPE)
    film = SceneFilm(
        SimulationSettings(
            mean_speed=_SPEED,
            first_shake=_SHAKE,
            frame_rate=camera.rate,
            restitution=camera.restitution,
            wall_restitution=0.97,
            seed=camera.seed,
            width_px=columns,
            height_px=rows,
        ),
        with_values(drawn, camera.scene, 'scene'),
    )
    settings = with_values(
        PipelineSettings(),
        {
            'trays': list(_TRAYS),
            'preprocess.layout': 'plate',
            'preprocess.pixels_per_metre': camera.scale,
        },
        'benchmark',
    )
    trays = {number: load_trays()[number] for number in _TRAYS}
    stage = Preprocessor(settings, trays, 'film', View(camera=film.camera.geometry.camera))
    return film, stage, {n: TrayMeasurement(settings, tray) for n, tray in trays.items()}


def _pictures(film: SceneFilm, camera: _Camera) -> Iterator[tuple[Frame, tuple[BeadsTruth, ...]]]:
    for moment in film.moments(round(_SECONDS * camera.rate)):
        quality = [cv2.IMWRITE_JPEG_QUALITY, camera.jpeg]
        jpeg = cv2.imencode('.jpg', moment.frame.image, quality)[1]
        yield replace(moment.frame, image=cv2.imdecode(jpeg, cv2.IMREAD_COLOR)), moment.beads


def _cells(estimates: list[SpeedEstimate], time: np.ndarray, speed: np.ndarray) -> Iterator[str]:
    rows = []
    for estimate in estimates:
        middle = estimate.stamp_ns / _NS
        if middle < _SHAKE + 0.2:
            continue
        true = speed[np.abs(time - middle) <= 0.5 * estimate.window + 1e-6].mean()
        measured = estimate.mean_projected_speed
        flagged = bool(estimate.quality & ~Quality.FEW_BEADS)
        rows.append((true, measured.value / true, measured.error / true, flagged))
    table = np.array(rows).reshape(-1, 4)
    for low, high in pairwise(_BINS):
        _, ratio, error, flagged = table[(low <= table[:, 0]) & (table[:, 0] < high)].T
        if not ratio.size:
            yield '-'
            continue
        mark = '!' if 2 * flagged.sum() > flagged.size else ''
        yield f'{ratio.mean():.2f} ± {ratio.std():.2f} ({error.mean():.2f}){mark}'


def _restitution(estimates: list[SpeedEstimate]) -> str:
    stage = RestitutionEstimator(PipelineSettings(), load_trays()[estimates[0].tray])
    records = [record for estimate in estimates for record in stage.push(estimate)]
    cor = [record for record in (*records, *stage.flush()) if isinstance(record, CorEstimate)]
    if not cor or cor[-1].status is not CorStatus.FINAL:
        return cor[-1].status.name.lower().replace('_', ' ') if cor else 'nothing'
    interval = cor[-1].restitution
    return f'{interval.value:.2f} [{interval.lower:.2f}, {interval.upper:.2f}]'
