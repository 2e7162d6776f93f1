"""Films of drawn trays by drawn cameras: made once, measured once for each state of the code.

One tray in a video file, with light, lens, sensor, codec, scale and frame rate drawn
(``--effects drawn``), and beads, walls, height, diameter, count and start drawn from the priors.
A film with drag, friction, sticking or a law of the restitution has the tray and the camera of the
film without.

Films and results are kept (`kept_results.folder`), results under a key of the source code: an
interrupted run goes on where it was.
"""

from __future__ import annotations

import math
import os
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from benchmarks.drawn import varied
from benchmarks.film_measurement import FilmResult, is_flagged, measure
from benchmarks.film_truth import FilmTruth, read_truth
from benchmarks.kept_results import folder
from benchmarks.rough_gas import SMOOTH, Roughness
from benchmarks.source_key import source_key
from nanorocks_ros.cli.progress_bar import Progress
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.settings import PriorSettings, SimulationSettings, with_values
from nanorocks_ros.studies.synthetic.drawn_film import write_drawn_film

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from nanorocks_ros.experiment.trays import Tray

_Row = TypeVar('_Row')

COUNT = 'NANOROCKS_FILM_COUNT'
"""Environment variable with the number of drawn films of each tray."""
FIRST = 'NANOROCKS_FIRST_FILM'
"""Environment variable with the number of the first film of a row; 0 by default."""

_FILMS = 50
# Modules beside the package that decide what is measured.
_MEASURING = 'film_measurement.py', 'film_truth.py', 'place_errors.py'
# Restitutions of beads that are drawn; those of the walls are drawn from their prior.
_BEADS = (0.5, 1.0)
_SHAKE = 1.0
_SECONDS = 26.0
# Mean speeds after the kick, drawn with uniform logarithm, [m/s].
_SPEEDS = (6e-3, 14e-3)
# Part of the cameras that jitter or sway.
_MOVING = 0.2
_TANGENTIAL = 0.4
# Impact speed at which restitutions that depend on it are as drawn, [m/s].
_AT_SPEED = 5e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnFilm:
    """A film whose tray and camera are drawn.

    Parameters
    ----------
    tray, number : int
        What is drawn depends on these two alone.
    drag : float, [1/s]
    friction : float
        Of beads, floor, lid and walls, with a tangential restitution of 0.4; 0 is smooth.
    sticking : float, [m/s]
        Beads stick below this normal speed, to bodies that turn; 0: never.
    exponent : float
        Of the impact speed with which beads lose; their restitution is that drawn at 5 mm/s.
    """

    tray: int
    number: int
    drag: float = 0.0
    friction: float = 0.0
    sticking: float = 0.0
    exponent: float = 0.0

    @property
    def stem(self) -> Path:
        """The path of the film without its suffix; what was added in thousandths."""
        physics = [
            f'_{name}_{round(1e3 * getattr(self, name))}'
            for name in ('drag', 'friction', 'sticking', 'exponent')
            if getattr(self, name)
        ]
        name = f'tray_{self.tray}_{self.number}{"".join(physics)}'
        return folder() / 'drawn_cameras' / name

    @property
    def video(self) -> Path | None:
        """The film, if it exists with its truth."""
        videos = [self.stem.with_suffix(suffix) for suffix in ('.mp4', '.avi')]
        there = [video for video in videos if video.exists()]
        return there[0] if there and self.stem.with_suffix('.npz').exists() else None


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadFilm:
    """A film and what was measured in it."""

    film: FilmTruth
    result: FilmResult

    @property
    def is_unflagged(self) -> bool:
        """Whether there is one cycle with a final estimate that no flag warns of."""
        return self.result.final is not None and not is_flagged(self.result.final)


def film_count(default: int = _FILMS) -> int:
    """How many films are drawn of each tray."""
    return int(os.environ.get(COUNT, default))


def draw(films: Iterable[DrawnFilm]) -> None:
    """Make the films that do not exist."""
    missing = {film.stem.name: film for film in films if not film.video}
    with Progress('drawing films') as progress:
        run_tasks(_draw, missing, Workers(), progress.count)


def measured(videos: Sequence[Path]) -> list[ReadFilm]:
    """What is measured in each film; results of an earlier run of the same code are used."""
    missing = {video.stem: video for video in videos if not _result_file(video).exists()}
    with Progress('measuring in films') as progress:
        run_tasks(_measure, missing, Workers(), progress.count)
    return [
        ReadFilm(
            film=read_truth(video),
            result=pickle.loads(_result_file(video).read_bytes()),
        )
        for video in videos
    ]


def measured_rows(
    rows: Mapping[_Row, Callable[[int], DrawnFilm]], films: int
) -> Iterator[tuple[_Row, list[ReadFilm]]]:
    """What is measured in the films of each row of a table.

    Missing films are drawn before, number by number, so that an interrupted run has some of each.

    Parameters
    ----------
    rows : mapping
        From the key of a row to the film with a number.
    films : int
        Of a row, where ``NANOROCKS_FILM_COUNT`` does not say it.
    """
    first = int(os.environ.get(FIRST, '0'))
    numbers = range(first, first + film_count(films))
    draw([film(number) for number in numbers for film in rows.values()])
    for row, film in rows.items():
        videos = [video for number in numbers if (video := film(number).video)]
        yield row, measured(videos)


def drawn_gas(
    number: int, run: int, drag: float, friction: float
) -> tuple[Tray, dict[str, float | str]]:
    """A tray and the settings of its gas, drawn from the priors.

    Parameters
    ----------
    number : int
        Of the tray.
    run : int
        What is drawn depends on these two alone.
    drag : float, [1/s]
    friction : float
        As of `DrawnFilm`.
    """
    prior = PriorSettings()
    random = np.random.default_rng([run, number])
    beads = random.uniform(*_BEADS)
    walls = random.uniform(prior.min_wall_restitution, prior.max_wall_restitution)
    tray, values = varied(load_trays()[number], walls, prior, random)
    rough = Roughness(tangential=_TANGENTIAL, friction=friction) if friction else SMOOTH
    values |= {
        'restitution': beads,
        'wall_restitution': walls,
        'mean_speed': math.exp(random.uniform(*np.log(_SPEEDS))),
        'tray': number,
        'drag': drag,
        **rough.settings,
    }
    return tray, values


def _draw(film: DrawnFilm) -> None:
    """Draw the truth of a tray, and film it with a drawn camera."""
    tray, values = drawn_gas(film.tray, film.number, film.drag, film.friction)
    values |= {
        'first_shake': _SHAKE,
        'seed': 5000 + film.number,
        'sticking_speed': film.sticking,
    }
    if film.exponent:
        values |= {
            'restitution_law': 'power',
            'restitution_speed': _AT_SPEED,
            'restitution_exponent': film.exponent,
        }
    simulation = with_values(SimulationSettings(), values, 'benchmark')
    film.stem.parent.mkdir(parents=True, exist_ok=True)
    seed = 10 * film.number + film.tray
    write_drawn_film(film.stem, tray, simulation, _SECONDS, seed, moving=_MOVING)


def _measure(video: Path) -> None:
    path = _result_file(video)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, pickle.dumps(measure(read_truth(video))))


def _result_file(video: Path) -> Path:
    return folder() / f'measured_{source_key(*_MEASURING)}' / f'{video.stem}.pickle'
