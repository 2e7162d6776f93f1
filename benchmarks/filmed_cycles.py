"""Cycles of trays filmed with all effects of the camera, and what the stages made of them.

A film is costly and what is worked out from it is not, so each is kept in a file of its own:
run again, only the films that are missing are made.
"""

from __future__ import annotations

import math
import os
import pickle
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from benchmarks.drawn import varied
from nanorocks_ros.experiment.trays import Tray, load_trays
from nanorocks_ros.experiment.view import View
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import (
    Frame,
    PairCollision,
    Rebound,
    SpeedEstimate,
    Tracks,
    TrayImage,
)
from nanorocks_ros.settings import (
    PipelineSettings,
    PriorSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm
from nanorocks_ros.stages.contacts.contact_finder import ContactFinder
from nanorocks_ros.stages.preprocess.preprocessor import Preprocessor

FOLDER = 'NANOROCKS_FILMS'
"""Environment variable: where films are kept; without it, below the temporary directory."""

# The plate holds eight cells: four of tray 1 and four of tray 3, [mm], give as many cycles for
# the price of one picture.
PLACES = {
    1: ((4.0, 5.0), (23.0, 5.0), (42.0, 5.0), (61.0, 5.0)),
    3: ((42.0, 25.0), (42.0, 41.0), (4.0, 60.0), (42.0, 60.0)),
}
_MILLIMETRE = 1e-3
_RATE = 30.0
_SPEED = 0.010
_SHAKE = 0.5
# The plate swings on for some 13 s before the window, which ends some 32 s after the shake.
_SECONDS = 33.5
_SCALE = 12500.0
_QUALITY = 85
DRAWN_PAIRS = (0.7, 0.95)
"""Range of the restitutions of beads that are drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """What is to be filmed.

    Parameters
    ----------
    pairs, walls : float
        Restitutions; NaN: drawn for each tray, with all else that the priors are about.
    number : int
    """

    pairs: float = math.nan
    walls: float = math.nan
    number: int

    @property
    def name(self) -> str:
        """Of its file."""
        truth = 'drawn' if math.isnan(self.pairs) else f'{self.pairs:g}_{self.walls:g}'
        return f'{truth}_{self.number}.pickle'


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
    pairs, walls : float
        True restitutions.
    """

    tray: int
    speeds: tuple[SpeedEstimate, ...]
    contacts: tuple[Rebound | PairCollision, ...]
    time: np.ndarray
    true_speed: np.ndarray
    pairs: float
    walls: float


def folder() -> Path:
    """Where films are kept."""
    default = Path(tempfile.gettempdir()) / 'nanorocks_films'
    path = Path(os.environ.get(FOLDER, default))
    path.mkdir(parents=True, exist_ok=True)
    return path


def make(films: list[Film], workers: Workers) -> None:
    """Make the films that are missing."""
    missing = {film.name: film for film in films if not (folder() / film.name).exists()}
    run_tasks(_make, missing, workers)


def load(films: list[Film]) -> dict[int, list[Cycle]]:
    """The cycles of each tray, of the films that were made."""
    found: dict[int, list[Cycle]] = {number: [] for number in PLACES}
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
    for tray, places in PLACES.items():
        for x, y in places:
            number = len(cells) + 1
            place = (x * _MILLIMETRE, y * _MILLIMETRE)
            cells[number] = replace(flown[tray], number=number, place=place)
            like[number] = tray
    return cells, like


def _filled(
    cells: dict[int, Tray], film: Film
) -> tuple[dict[int, Tray], dict[int, SimulationSettings]]:
    """What really is in the cells, of which the stages know no more than the cells."""
    common = SimulationSettings(
        seed=1000 + film.number, mean_speed=_SPEED, first_shake=_SHAKE, frame_rate=_RATE
    )
    if not math.isnan(film.pairs):
        values = {'restitution': film.pairs, 'wall_restitution': film.walls}
        return cells, dict.fromkeys(cells, with_values(common, values, 'benchmark'))
    prior = PriorSettings()
    there, gases = {}, {}
    for number, cell in cells.items():
        random = np.random.default_rng([film.number, number])
        pairs = random.uniform(*DRAWN_PAIRS)
        walls = random.uniform(prior.min_wall_restitution, prior.max_wall_restitution)
        there[number], values = varied(cell, walls, prior, random)
        values |= {'restitution': pairs, 'wall_restitution': walls}
        gases[number] = with_values(common, values, 'benchmark')
    return there, gases


def _make(film: Film) -> None:
    cv2.setNumThreads(1)
    cells, like = _cells()
    there, gases = _filled(cells, film)
    plate = SceneSettings(trays=tuple(cells))
    scene = SceneFilm(gases[1], plate, there, gases)
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
    cycles = [follower.cycle(like[number], gases[number]) for number, follower in follow.items()]
    path = folder() / film.name
    write_bytes(path, pickle.dumps(cycles))


class _Follower:
    """What the stages make of the images of one cell."""

    def __init__(self, settings: PipelineSettings, cell: Tray) -> None:
        self._speed = TrayMeasurement(settings, cell)
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

    def cycle(self, tray: int, gas: SimulationSettings) -> Cycle:
        time, speed = np.array(self.truth).T
        return Cycle(
            tray=tray,
            speeds=tuple(self._speeds),
            contacts=(*self._contacts, *self._finder.flush()),
            time=time,
            true_speed=speed,
            pairs=gas.restitution,
            walls=gas.wall_restitution,
        )
