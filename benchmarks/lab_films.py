"""Films of other labs, drawn by other code and measured as a user does, against the truth.

Spheres, container, restitutions, colours, light and camera are drawn; the engines
(`benchmarks.soft_spheres`, and `benchmarks.turning_gas` where spheres stick) and the camera
(`benchmarks.shaded_film`) share nothing with the package; the camera of the last films reads its
rows one after the other, within nine tenths of the time between pictures. Each film is measured by
`nanorocks_ros.measure`, told what can be read off a picture or a ruler. ``NANOROCKS_FILM_COUNT``
is the number of films of each row, 4 by default. Films and results are kept in
`kept_results.folder`, so that an interrupted run goes on.
``python -m benchmarks.lab_films PICTURE`` shows a frame of the first films.
"""

from __future__ import annotations

import json
import math
import sys
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

import nanorocks_ros as nr
from benchmarks.drawn_films import film_count
from benchmarks.kept_results import folder
from benchmarks.rolling_shutter import rolled_run
from benchmarks.shaded_film import (
    EXPOSURES,
    LabCamera,
    beads_seen_px,
    floor_px,
    write_shaded_film,
)
from benchmarks.soft_spheres import SoftBox, SoftRun, shaken, soft_run
from benchmarks.source_key import source_key
from benchmarks.turning_gas import Gas, states
from nanorocks_ros.cli.progress_bar import Progress
from nanorocks_ros.errors import NanorocksError
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.outputs.atomic_files import write_bytes

_FILMS = 4
_SECONDS = 24.0
# Rows of the table: friction, drag [1/s], sticking speed [m/s], and whether the shutter rolls.
_ROWS = (
    (0.0, 0.0, 0.0, False),
    (0.05, 0.0, 0.0, False),
    (0.0, 0.05, 0.0, False),
    (0.0, 0.0, 3e-3, False),
    (0.0, 0.03, 3e-3, False),
    (0.03, 0.03, 3e-3, False),
    (0.0, 0.0, 0.0, True),
)
# States of a rolling shutter for each exposure, and parts of the readout at those of a picture.
_STATES = 5
_PARTS = np.linspace(0.0, 1.0, 10)
# Colours of floor and of beads of two species, bgr.
_COLOURS = (
    ((70.0, 40.0, 30.0), ((225.0, 232.0, 235.0), (60.0, 190.0, 230.0))),
    ((205.0, 213.0, 215.0), ((78.0, 72.0, 70.0), (60.0, 60.0, 190.0))),
    ((70.0, 110.0, 150.0), ((170.0, 60.0, 40.0), (50.0, 50.0, 60.0))),
    ((190.0, 185.0, 175.0), ((40.0, 50.0, 170.0), (70.0, 110.0, 40.0))),
)
# Mean of the projected speed over the standard deviation of a component.
_PROJECTED = math.sqrt(0.5 * math.pi)
# Margin around the floor, [px].
_MARGIN = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class LabFilm:
    """A film that is drawn.

    Parameters
    ----------
    number : int
        What is drawn depends on it alone.
    friction : float
    drag : float, [1/s]
    sticking : float, [m/s]
        Spheres stick below this normal speed, to bodies that turn; 0: never.
    rolling : bool
        Whether the camera reads its rows one after the other.
    """

    number: int
    friction: float
    drag: float
    sticking: float = 0.0
    rolling: bool = False

    @property
    def video(self) -> Path:
        """Where the film is, or will be."""
        physics = f'{round(1e3 * self.friction)}_{round(1e3 * self.drag)}'
        if self.sticking:
            physics += f'_{round(1e3 * self.sticking)}'
        if self.rolling:
            physics += '_rolling'
        return folder() / 'lab_films' / f'film_{self.number}_{physics}.mp4'

    @property
    def results(self) -> Path:
        """The file with what this state of the code measures."""
        return (
            folder() / f'lab_films_{source_key(Path(__file__).name)}' / f'{self.video.stem}.json'
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class LabTruth:
    """Box, species of each sphere, and camera of a film."""

    box: SoftBox
    diameters: tuple[float, ...]
    counts: tuple[int, ...]
    densities: tuple[float, ...]
    camera: LabCamera

    @property
    def species(self) -> np.ndarray:
        """Species of each sphere, (count,)."""
        return np.repeat(np.arange(len(self.counts)), self.counts)


def report() -> None:
    """Draw and measure the films, and print a row for each."""
    films = [
        LabFilm(number=number, friction=friction, drag=drag, sticking=sticking, rolling=rolling)
        for friction, drag, sticking, rolling in _ROWS
        for number in range(film_count(_FILMS))
    ]
    _run('drawing films', _draw, [film for film in films if not film.video.exists()])
    _run('measuring in films', _measure, [film for film in films if not film.results.exists()])
    print(
        '| film | beads | friction | drag [1/s] | found | beads: true | collisions | alone '
        '| headline | walls: true | rebounds | alone | headline | sticking [mm/s] | flags |'
    )
    print(f'{"| --- " * 15}|')
    held: dict[str, list[bool]] = {}
    for film in films:
        print(_row(film, held))
    print()
    for name, holds in held.items():
        print(f'{name}: {sum(holds)} of {len(holds)} intervals of 95 % hold the truth')


def drawn_truth(film: LabFilm) -> LabTruth:
    """Draw what a film shows."""
    random = np.random.default_rng([film.number, 11])
    diameter = random.uniform(2e-3, 5e-3)
    first = int(random.integers(12, 25))
    second = int(random.integers(6, 13)) if random.random() < 0.4 else 0
    diameters = (diameter, 0.8 * diameter)[: 1 + bool(second)]
    counts = (first, second)[: len(diameters)]
    densities = tuple(random.choice([1180.0, 2500.0, 3900.0, 7800.0], len(counts)).tolist())
    radii = np.repeat(0.5 * np.array(diameters), counts)
    area = math.pi * (radii**2).sum() / random.uniform(0.08, 0.2)
    long = random.uniform(1.0, 1.4)
    # A ruler tells whole millimetres.
    width, length = (round(1e3 * math.sqrt(area * part)) / 1e3 for part in (long, 1.0 / long))
    height = round(1e4 * diameter * random.uniform(1.4, 2.2)) / 1e4
    box = SoftBox(
        sides=(width, length, height),
        radii=tuple(radii.tolist()),
        masses=tuple((np.repeat(densities, counts) * 4.0 / 3.0 * math.pi * radii**3).tolist()),
        restitution=random.uniform(0.6, 0.95),
        wall_restitution=random.uniform(0.7, 0.97),
        friction=film.friction,
        drag=film.drag,
        speed=3.5 * diameter,
    )
    scale = random.uniform(22.0, 36.0) / diameter
    size = tuple(2 * round(0.5 * scale * side) + 2 * _MARGIN for side in (width, length))
    floor, beads = _COLOURS[int(random.integers(len(_COLOURS)))]
    turn = random.uniform(0.0, 2.0 * math.pi)
    camera = LabCamera(
        size=size,
        scale=scale,
        centre=(0.5 * size[0] + random.uniform(-5, 5), 0.5 * size[1] + random.uniform(-5, 5)),
        distance=random.uniform(0.2, 0.6),
        rate=float(random.choice([30.0, 60.0])),
        light=(0.5 * math.cos(turn), 0.5 * math.sin(turn), 0.8),
        ambient=random.uniform(0.25, 0.5),
        highlight=random.uniform(0.2, 0.9),
        shine=random.uniform(15.0, 80.0),
        shadow=random.uniform(0.1, 0.5),
        floor=floor,
        beads=beads[: len(counts)],
        texture=random.uniform(0.02, 0.12),
        grain=random.uniform(1.0, 2.5),
        blur=random.uniform(0.6, 1.4),
        noise=random.uniform(1.0, 5.0),
        crf=random.uniform(18.0, 26.0),
        seed=film.number,
    )
    return LabTruth(
        box=box, diameters=diameters, counts=counts, densities=densities, camera=camera
    )


def _run(label: str, task, films: list[LabFilm]) -> None:
    with Progress(label) as progress:
        run_tasks(task, {film.video.stem: film for film in films}, Workers(), progress.count)


def _draw(film: LabFilm) -> None:
    truth = drawn_truth(film)
    rate = EXPOSURES * truth.camera.rate
    if film.sticking:
        run = _sticking_run(film, truth.box, rate)
    elif film.rolling:
        dense = soft_run(truth.box, _SECONDS, rate=_STATES * rate, seed=film.number)
        rows = truth.camera.size[1] / truth.camera.scale
        run = rolled_run(dense, _STATES, _PARTS, rows)
    else:
        run = soft_run(truth.box, _SECONDS, rate=rate, seed=film.number)
    film.video.parent.mkdir(parents=True, exist_ok=True)
    write_shaded_film(film.video, run, truth.box, truth.species, truth.camera)


def _sticking_run(film: LabFilm, box: SoftBox, rate: float) -> SoftRun:
    """At rest, shaken with the box, and then left alone: spheres fly and stick from the start."""
    gas = Gas(
        eps=box.restitution,
        walls=box.wall_restitution,
        sticking=film.sticking,
        speed=_PROJECTED * box.speed,
        drag=film.drag,
        friction=film.friction,
    )
    rest, total = round(box.rest * rate), round(_SECONDS * rate)
    random = np.random.default_rng(film.number)
    masses, radii, sides = np.array(box.masses), np.array(box.radii), np.array(box.sides)
    moving = list(islice(states(masses, radii, sides, gas, random, rate=rate), total - rest))
    places = np.array([state.places for state in moving])
    velocities = np.array([state.velocities for state in moving])
    displacement, _ = shaken(box, total - rest, 1.0 / rate)
    places[..., :2] += displacement[:, None]
    still = np.repeat(places[:1], rest, axis=0)
    return SoftRun(
        positions=np.concatenate([still, places]),
        velocities=np.concatenate([np.zeros_like(still), velocities]),
        displacement=np.concatenate([np.zeros((rest, 2)), displacement]),
        collisions=0,
    )


def _measure(film: LabFilm) -> None:
    """Tell what a user knows, and keep what is measured."""
    truth = drawn_truth(film)
    box = truth.box
    told = {
        'diameter_px': [round(size) for size in beads_seen_px(box, truth.camera)],
        'diameter_mm': [round(1e3 * diameter, 3) for diameter in truth.diameters],
        'count': list(truth.counts),
        'density_g_cm3': [1e-3 * density for density in truth.densities],
        'corners': floor_px(box, truth.camera),
        'sides_mm': tuple(1e3 * side for side in box.sides[:2]),
        'height_mm': 1e3 * box.sides[2],
    }
    try:
        measured = nr.measure(
            film.video, folder=film.results.with_suffix(''), workers=1, progress=False, **told
        )
        found = _found(measured)
    except NanorocksError as error:
        found = {'refusal': str(error)}
    film.results.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(film.results, json.dumps(found).encode())


def _found(measured) -> dict[str, object]:
    tables = measured.cor
    found: dict[str, object] = {'alone': {}}
    for _, row in tables.iterrows():
        if row['partner'] in ('beads', 'walls'):
            found['alone'][row['partner']] = {
                name: float(row[name])
                for name in ('contacts', 'restitution', 'restitution_lower', 'restitution_upper')
            }
    if measured.decay is not None:
        final = measured.decay.cor.iloc[-1]
        found['final'] = {
            name: float(final[name])
            for kind in ('restitution', 'wall_restitution')
            for name in (kind, f'{kind}_lower', f'{kind}_upper')
        } | {'drag': float(final['drag']), 'flags': str(final['quality'])}
        clusters = measured.decay.clusters.iloc[-1]
        found['clusters'] = {
            name: float(clusters[name])
            for name in ('sticking_speed', 'sticking_speed_lower', 'sticking_speed_upper', 'onset')
        }
    return found


def _row(film: LabFilm, held: dict[str, list[bool]]) -> str:
    truth = drawn_truth(film)
    found = json.loads(film.results.read_text('utf-8'))
    sizes = ', '.join(
        f'{count} of {1e3 * diameter:.1f} mm'
        for count, diameter in zip(truth.counts, truth.diameters, strict=True)
    )
    name = f'{film.number}, rolling' if film.rolling else f'{film.number}'
    cells = [name, sizes, f'{film.friction:g}', f'{film.drag:g}']
    if 'refusal' in found:
        return f'| {" | ".join(cells)} | {found["refusal"]} |' + ' |' * 10
    final = found.get('final', {})
    cells.append(f'{final["drag"]:.4f}' if math.isfinite(final.get('drag', math.nan)) else '')
    truths = truth.box.restitution, truth.box.wall_restitution
    for kind, name, value in zip(
        ('beads', 'walls'), ('restitution', 'wall_restitution'), truths, strict=True
    ):
        alone = found['alone'].get(kind, {})
        cells += [f'{value:.3f}', f'{alone.get("contacts", 0):.0f}']
        for told, key, source in ((alone, 'restitution', 'alone'), (final, name, 'headline')):
            cells.append(_interval(told, key))
            lower, upper = told.get(f'{key}_lower', math.nan), told.get(f'{key}_upper', math.nan)
            if math.isfinite(told.get(key, math.nan)):
                held.setdefault(f'{kind}, {source}', []).append(lower <= value <= upper)
    cells += [_sticking(film, found.get('clusters', {}), held), final.get('flags', '')]
    return f'| {" | ".join(cells)} |'


def _sticking(film: LabFilm, found: dict[str, float], held: dict[str, list[bool]]) -> str:
    lower, upper = (found.get(f'sticking_speed_{end}', math.nan) for end in ('lower', 'upper'))
    # Any limit holds where nothing sticks.
    if film.sticking and math.isfinite(upper):
        low = lower if math.isfinite(lower) else 0.0
        held.setdefault('sticking speed', []).append(low <= film.sticking <= upper)
    shown = {name: 1e3 * value for name, value in found.items()}
    limit = f'< {1e3 * upper:.2f}' if math.isfinite(upper) else 'unknown'
    told = _interval(shown, 'sticking_speed') or limit
    return f'{1e3 * film.sticking:g}: {told}'


def _interval(told: dict[str, float], name: str) -> str:
    if not math.isfinite(told.get(name, math.nan)):
        return ''
    return f'{told[name]:.3f} [{told[f"{name}_lower"]:.3f}, {told[f"{name}_upper"]:.3f}]'


def picture(path: Path) -> None:
    """Write one frame of each of the first films without friction and drag, side by side."""
    films = [LabFilm(number=number, friction=0.0, drag=0.0) for number in range(_FILMS)]
    _run('drawing films', _draw, [film for film in films if not film.video.exists()])
    frames = [_frame(film.video) for film in films]
    rows = max(len(frame) for frame in frames)
    tall = [
        cv2.copyMakeBorder(frame, 0, rows - len(frame), 0, 8, cv2.BORDER_CONSTANT, value=[255] * 3)
        for frame in frames
    ]
    cv2.imwrite(str(path), np.hstack(tall)[:, :-8])


def _frame(video: Path) -> np.ndarray:
    """A frame after the shaking."""
    film = cv2.VideoCapture(str(video))
    film.set(cv2.CAP_PROP_POS_MSEC, 6e3)
    _, frame = film.read()
    return frame


if __name__ == '__main__':
    picture(Path(sys.argv[1]))
