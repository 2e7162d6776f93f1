"""Cycles of trays filmed with all effects of the camera, and the results of the stages.

Films are costly, so the results of each are kept in a file; a second call makes only missing
films.
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
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor

FOLDER = 'NANOROCKS_FILMS'
"""Environment variable with the folder of the films; default: in the temporary directory."""

# Positions of the eight cells of the plate, four of tray 1 and four of tray 3, [mm]: one film
# gives eight cycles.
PLACES = {
    1: ((4.0, 5.0), (23.0, 5.0), (42.0, 5.0), (61.0, 5.0)),
    3: ((42.0, 25.0), (42.0, 41.0), (4.0, 60.0), (42.0, 60.0)),
}
_MILLIMETRE = 1e-3
_RATE = 30.0
_SPEED = 0.010
_SHAKE = 0.5
# The plate oscillates for some 13 s before the window, which ends some 32 s after the shake.
_SECONDS = 33.5
_SCALE = 12500.0
_QUALITY = 85
DRAWN_PAIRS = (0.7, 0.95)
"""Range of drawn restitutions of beads."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """Parameters of a film.

    Parameters
    ----------
    pairs, walls : float
        Restitutions; NaN: drawn for each tray, with all other values of the priors.
    number : int
    """

    pairs: float = math.nan
    walls: float = math.nan
    number: int

    @property
    def name(self) -> str:
        """Name of its file."""
        truth = 'drawn' if math.isnan(self.pairs) else f'{self.pairs:g}_{self.walls:g}'
        return f'{truth}_{self.number}.pickle'


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """One cycle of one tray.

    Parameters
    ----------
    tray : int
        Tray with the same beads and sides.
    speeds : tuple of SpeedEstimate
    contacts : tuple of Rebound or PairCollision
    time : ndarray (n,), [s]
        Times of the frames.
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
    """Folder of the films."""
    default = Path(tempfile.gettempdir()) / 'nanorocks_films'
    path = Path(os.environ.get(FOLDER, default))
    path.mkdir(parents=True, exist_ok=True)
    return path


def make(films: list[Film], workers: Workers) -> None:
    """Make missing films."""
    missing = {film.name: film for film in films if not (folder() / film.name).exists()}
    run_tasks(_make, missing, workers)


def load(films: list[Film]) -> dict[int, list[Cycle]]:
    """The cycles of each tray, from the films that exist."""
    cycles: dict[int, list[Cycle]] = {number: [] for number in PLACES}
    for film in films:
        path = folder() / film.name
        if path.exists():
            for cycle in pickle.loads(path.read_bytes()):
                cycles[cycle.tray].append(cycle)
    return cycles


def _cells() -> tuple[dict[int, Tray], dict[int, int]]:
    """The cells of the plate by number, and the tray of each cell."""
    flown = load_trays()
    cells, tray_of_cell = {}, {}
    for tray, places in PLACES.items():
        for x, y in places:
            number = len(cells) + 1
            place = (x * _MILLIMETRE, y * _MILLIMETRE)
            cells[number] = replace(flown[tray], number=number, place=place)
            tray_of_cell[number] = tray
    return cells, tray_of_cell


def _filled(
    cells: dict[int, Tray], film: Film
) -> tuple[dict[int, Tray], dict[int, SimulationSettings]]:
    """The true trays and gases of the cells; the stages use the nominal cells."""
    common = SimulationSettings(
        seed=1000 + film.number, mean_speed=_SPEED, first_shake=_SHAKE, frame_rate=_RATE
    )
    if not math.isnan(film.pairs):
        values = {'restitution': film.pairs, 'wall_restitution': film.walls}
        return cells, dict.fromkeys(cells, with_values(common, values, 'benchmark'))
    prior = PriorSettings(min_wall_restitution=0.8)
    varied_cells, gases = {}, {}
    for number, cell in cells.items():
        random = np.random.default_rng([film.number, number])
        pairs = random.uniform(*DRAWN_PAIRS)
        walls = random.uniform(prior.min_wall_restitution, prior.max_wall_restitution)
        varied_cells[number], values = varied(cell, walls, prior, random)
        values |= {'restitution': pairs, 'wall_restitution': walls}
        gases[number] = with_values(common, values, 'benchmark')
    return varied_cells, gases


def _make(film: Film) -> None:
    cv2.setNumThreads(1)
    cells, tray_of_cell = _cells()
    varied_cells, gases = _filled(cells, film)
    plate = SceneSettings(trays=tuple(cells))
    scene = SceneFilm(gases[1], plate, varied_cells, gases)
    names = {
        'trays': list(cells),
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': _SCALE,
    }
    settings = with_values(PipelineSettings(), names, 'benchmark')
    stage = Preprocessor(settings, cells, 'film', View(camera=scene.camera.geometry.camera))
    pipelines = {number: _Follower(settings, cell) for number, cell in cells.items()}
    for moment in scene.moments(round(_SECONDS * _RATE)):
        for beads in moment.beads:
            speed = np.hypot(beads.velocities[:, 0], beads.velocities[:, 1]).mean()
            pipelines[beads.tray].truth.append((beads.stamp_ns * 1e-9, float(speed)))
        quality = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
        jpeg = cv2.imencode('.jpg', moment.frame.image, quality)[1]
        image = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
        frame = Frame(stamp_ns=moment.frame.stamp_ns, encoding='bgr8', image=image)
        for record in stage.push(frame):
            if isinstance(record, TrayImage):
                pipelines[record.tray].push(record)
    cycles = [
        pipeline.cycle(tray_of_cell[number], gases[number])
        for number, pipeline in pipelines.items()
    ]
    path = folder() / film.name
    write_bytes(path, pickle.dumps(cycles))


class _Follower:
    """Results of the stages for the images of one cell."""

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
