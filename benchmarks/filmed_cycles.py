"""Cycles of trays filmed with all effects of the camera, and what the stages made of them.

A film is costly and what is worked out from it is not, so each is kept in a file of its own:
run again, only the films that are missing are made.
"""

from __future__ import annotations

import os
import pickle
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from nanorocks_ros.experiment.settings import (
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.experiment.trays import Tray, load_trays
from nanorocks_ros.experiment.view import View
from nanorocks_ros.records import (
    Frame,
    PairCollision,
    Rebound,
    SpeedEstimate,
    Tracks,
    TrayImage,
)
from nanorocks_ros.simulation.scene.film import SceneFilm
from nanorocks_ros.stages.contacts.find import ContactFinder
from nanorocks_ros.stages.preprocess import Preprocessor
from nanorocks_ros.stages.speed import SpeedEstimator
from nanorocks_ros.study.tasks import Workers, run_tasks

FOLDER = 'NANOROCKS_FILMS'
"""Environment variable: where films are kept; without it, below the temporary directory."""

# The plate holds eight cells: four of tray 1 and four of tray 3, [mm], give as many cycles for
# the price of one picture.
_PLACES = {
    1: ((4.0, 5.0), (23.0, 5.0), (42.0, 5.0), (61.0, 5.0)),
    3: ((42.0, 25.0), (42.0, 41.0), (4.0, 60.0), (42.0, 60.0)),
}
_MILLIMETRE = 1e-3
_RATE = 30.0
_SPEED = 0.010
_SHAKE = 0.5
# The plate swings on for some 16 s until the window begins, which is 20 s long.
_SECONDS = 38.5
_SCALE = 12500.0
_QUALITY = 85


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """What is to be filmed: restitutions of beads and walls, and a number."""

    pairs: float
    walls: float
    number: int

    @property
    def name(self) -> str:
        """Of its file."""
        return f'{self.pairs:g}_{self.walls:g}_{self.number}.pickle'


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """One cycle of one tray.

    Parameters
    ----------
    tray : int
        Whose beads and sides they were.
    speeds : tuple of SpeedEstimate
    contacts : tuple of Rebound or PairCollision
    time : ndarray (n,), [s]
        Of the frames.
    true_speed : ndarray (n,), [m/s]
        Mean projected speed of all beads relative to their tray.
    """

    tray: int
    speeds: tuple[SpeedEstimate, ...]
    contacts: tuple[Rebound | PairCollision, ...]
    time: np.ndarray
    true_speed: np.ndarray


def folder() -> Path:
    """Where films are kept."""
    default = Path(tempfile.gettempdir()) / 'nanorocks_films'
    found = Path(os.environ.get(FOLDER, default))
    found.mkdir(parents=True, exist_ok=True)
    return found


def make(films: list[Film], workers: Workers) -> None:
    """Make the films that are missing."""
    missing = {one.name: one for one in films if not (folder() / one.name).exists()}
    run_tasks(_make, missing, workers)


def load(films: list[Film]) -> dict[int, list[Cycle]]:
    """The cycles of each tray, of the films that were made."""
    found: dict[int, list[Cycle]] = {number: [] for number in _PLACES}
    for film in films:
        path = folder() / film.name
        if path.exists():
            for cycle in pickle.loads(path.read_bytes()):
                found[cycle.tray].append(cycle)
    return found


def _cells() -> tuple[dict[int, Tray], dict[int, int]]:
    """The cells of the plate by number, and which tray each of them is like."""
    flown = load_trays()
    cells, like = {}, {}
    for tray, places in _PLACES.items():
        for x, y in places:
            number = len(cells) + 1
            place = (x * _MILLIMETRE, y * _MILLIMETRE)
            cells[number] = replace(flown[tray], number=number, place=place)
            like[number] = tray
    return cells, like


def _make(film: Film) -> None:
    cv2.setNumThreads(1)
    cells, like = _cells()
    simulation = SimulationSettings(
        restitution=film.pairs,
        wall_restitution=film.walls,
        seed=1000 + film.number,
        mean_speed=_SPEED,
        first_shake=_SHAKE,
        frame_rate=_RATE,
    )
    scene = SceneFilm(simulation, SceneSettings(trays=tuple(cells)), cells)
    names = {
        'trays': list(cells),
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': _SCALE,
    }
    settings = with_values(PipelineSettings(), names, 'benchmark')
    stage = Preprocessor(settings, cells, 'film', View(camera=scene.camera.geometry.camera))
    follow = {number: _Follower(settings, cell) for number, cell in cells.items()}
    for moment in scene.moments(round(_SECONDS * _RATE)):
        for beads in moment.beads:
            speed = np.hypot(beads.velocities[:, 0], beads.velocities[:, 1]).mean()
            follow[beads.tray].truth.append((beads.stamp_ns * 1e-9, float(speed)))
        quality = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
        jpeg = cv2.imencode('.jpg', moment.frame.image, quality)[1]
        image = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
        frame = Frame(stamp_ns=moment.frame.stamp_ns, encoding='bgr8', image=image)
        for record in stage.push(frame):
            if isinstance(record, TrayImage):
                follow[record.tray].push(record)
    path = folder() / film.name
    unfinished = path.with_suffix('.part')
    unfinished.write_bytes(pickle.dumps([one.cycle(like[n]) for n, one in follow.items()]))
    unfinished.replace(path)


class _Follower:
    """What the stages make of the images of one cell."""

    def __init__(self, settings: PipelineSettings, cell: Tray) -> None:
        self._speed = SpeedEstimator(settings, cell)
        self._speed.emit_tracks = True
        self._finder = ContactFinder(cell)
        self._speeds: list[SpeedEstimate] = []
        self._contacts: list[Rebound | PairCollision] = []
        self.truth: list[tuple[float, float]] = []

    def push(self, image: TrayImage) -> None:
        for record in self._speed.push(image):
            if isinstance(record, Tracks):
                self._contacts += self._finder.push(record)
            elif isinstance(record, SpeedEstimate):
                self._speeds.append(record)

    def cycle(self, tray: int) -> Cycle:
        time, speed = np.array(self.truth).T
        return Cycle(
            tray=tray,
            speeds=tuple(self._speeds),
            contacts=(*self._contacts, *self._finder.flush()),
            time=time,
            true_speed=speed,
        )
