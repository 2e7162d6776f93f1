"""Rate of deflections of beads, in the gas and in tracks.

Elastic gases of 7 mm/s in trays 1, 3 and 5, filmed without effects. A kink is a position more than
0.75 px from the middle of its neighbours in time, in true positions and in tracks. The lost share
of the path is 1 - distance / path, over the distance in diameters, after the time in which a bead
at the mean speed moves by one diameter;
`stages/structure_function.py` takes 0.25 for all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from benchmarks.scene_bag import SCALE, settings
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.view import View
from nanorocks_ros.records import BeadsTruth, Frame, Tracks, TrayImage
from nanorocks_ros.settings import SceneSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm, without_effects
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.stages.tracking.tracker import Tracker

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nanorocks_ros.experiment.trays import Species

_TRAYS = (1, 3, 5)
_SPEED = 7e-3
_RATE = 30.0
_FRAMES = 360
_WARM_UP = 45
# Mean speed in the image plane over that in space, of an isotropic gas.
_PROJECTED = np.pi / 4.0
_KINK = 0.75 / SCALE
# Smallest change of the velocity in the image plane at a collision, over the mean speed.
_CHANGE = 0.02


def report() -> None:
    """Print the table."""
    shots = _shots()
    print(
        '| tray, species | collisions per diameter of path | velocity jumps: true, tracks | '
        'path lost per diameter: true, tracks |\n| --- | --- | --- | --- |'
    )
    trays = load_trays()
    for number in _TRAYS:
        truth = [beads for beads, _ in shots[number]]
        tracks = [record for _, record in shots[number]]
        for index, species in enumerate(trays[number].species):
            true_runs, runs = _true_runs(truth, index), _runs(tracks, index)
            lag = max(1, round(species.diameter / _SPEED * _RATE))
            d = species.diameter
            print(
                f'| {number}, {species.material} | {_collisions(truth, index, species):.2f} | '
                f'{_kinks(true_runs, d):.2f}, {_kinks(runs, d):.2f} | '
                f'{_lost(true_runs, lag, d):.2f}, {_lost(runs, lag, d):.2f} |'
            )


def _shots() -> dict[int, list[tuple[BeadsTruth, Tracks]]]:
    scene = with_values(SceneSettings(trays=_TRAYS), {'swing_knocks': False}, 'benchmark')
    film = SceneFilm(
        SimulationSettings(
            mean_speed=_SPEED / _PROJECTED,
            first_shake=0.3,
            frame_rate=_RATE,
            restitution=1.0,
            wall_restitution=1.0,
        ),
        without_effects(scene),
    )
    flown = load_trays()
    stage = Preprocessor(
        settings(_TRAYS),
        {number: flown[number] for number in _TRAYS},
        'film',
        View(camera=film.camera.geometry.camera),
    )
    trackers = {number: Tracker(settings(_TRAYS), flown[number]) for number in _TRAYS}
    shots: dict[int, list[tuple[BeadsTruth, Tracks]]] = {number: [] for number in _TRAYS}
    for count, moment in enumerate(film.moments(_FRAMES)):
        frame = Frame(stamp_ns=moment.frame.stamp_ns, encoding='bgr8', image=moment.frame.image)
        truth = {bead.tray: bead for bead in moment.beads}
        for image in stage.push(frame):
            if isinstance(image, TrayImage):
                for tracks in trackers[image.tray].push(image):
                    if count >= _WARM_UP:
                        shots[image.tray].append((truth[image.tray], tracks))
    return shots


def _true_runs(truth: list[BeadsTruth], index: int) -> list[np.ndarray]:
    """Positions of each bead, (n, 2), relative to the camera."""
    selected = truth[0].species == index
    places = np.array([beads.positions[selected, :2] + beads.displacement for beads in truth])
    return list(places.transpose(1, 0, 2))


def _runs(tracks: list[Tracks], index: int) -> list[np.ndarray]:
    """Positions of each track, split where the bead is not seen in a frame."""
    positions_by_track: dict[int, list[tuple[int, np.ndarray]]] = {}
    for frame, record in enumerate(tracks):
        selected = record.seen & (record.species == index)
        for number, place in zip(
            record.ids[selected].tolist(), record.positions[selected], strict=True
        ):
            positions_by_track.setdefault(number, []).append((frame, place + record.displacement))
    runs = []
    for samples in positions_by_track.values():
        frames = np.array([frame for frame, _ in samples])
        places = np.array([place for _, place in samples])
        runs += np.split(places, np.flatnonzero(np.diff(frames) > 1) + 1)
    return runs


def _collisions(truth: list[BeadsTruth], index: int, species: Species) -> float:
    """Changes of the velocity in the image plane, per diameter of path."""
    selected = truth[0].species == index
    velocities = np.array([beads.free_velocities[selected, :2] for beads in truth])
    changes = np.hypot(*np.moveaxis(np.diff(velocities, axis=0), 2, 0)) > _CHANGE * _SPEED
    path = sum(_path(run) for run in _true_runs(truth, index))
    return float(changes.sum()) / (path / species.diameter)


def _path(run: np.ndarray) -> float:
    return float(np.hypot(*np.diff(run, axis=0).T).sum())


def _kinks(runs: Iterable[np.ndarray], diameter: float) -> float:
    """Kinks per diameter of path. A collision between two frames can bend both positions."""
    kinks, path = 0, 0.0
    for run in runs:
        if len(run) < 3:
            continue
        bent = np.hypot(*(run[2:] - 2.0 * run[1:-1] + run[:-2]).T) > _KINK
        edges = np.flatnonzero(np.diff(np.concatenate([[0], bent, [0]])))
        kinks += int(np.ceil(0.5 * (edges[1::2] - edges[::2])).sum())
        path += _path(run)
    return kinks / (path / diameter)


def _lost(runs: Iterable[np.ndarray], lag: int, diameter: float) -> float:
    """Lost share of the path, per diameter of the distance."""
    distances, paths = [np.empty(0)], [np.empty(0)]
    for run in runs:
        if len(run) > lag:
            path_length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(run, axis=0).T))])
            distances.append(np.hypot(*(run[lag:] - run[:-lag]).T))
            paths.append(path_length[lag:] - path_length[:-lag])
    distance = float(np.concatenate(distances).mean())
    return (1.0 - distance / float(np.concatenate(paths).mean())) * diameter / distance
