"""Clusters, first merges and sticking speeds in films with all effects, against the truth.

Plates of eight cells, four like tray 1 and four like tray 3 or 5, JPEG 85, 26 s after a shaking
event at 10 mm/s, restitutions 0.89 and 0.97; sizes come from tracks. In a sticking film each of
the four cells has its own sticking speed; controls are without sticking. Tracks are kept
(`kept_results.folder`), and bodies are counted in each run.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from benchmarks.kept_results import folder
from benchmarks.sticking import true_merges
from nanorocks_ros.experiment.trays import Tray, load_trays
from nanorocks_ros.experiment.view import View
from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle, sticking_cycle
from nanorocks_ros.inference.sticking.sticking_speed import sticking_estimate
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.physics.paper_clusters import paper_onset
from nanorocks_ros.physics.sticking_rates import slow_contacts
from nanorocks_ros.pipeline.composition import TrayStages
from nanorocks_ros.records import (
    BodyEstimate,
    ClusterEstimate,
    Frame,
    Merge,
    SpeedEstimate,
    Tracks,
    TrayImage,
)
from nanorocks_ros.settings import (
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm
from nanorocks_ros.stages.bodies.body_counter import BodyCounter
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor

# Positions of the eight cells of the plate, four of tray 1 and four of tray 3, [mm]: one film
# gives eight cycles.
_PLACES = {
    1: ((4.0, 5.0), (23.0, 5.0), (42.0, 5.0), (61.0, 5.0)),
    3: ((42.0, 25.0), (42.0, 41.0), (4.0, 60.0), (42.0, 60.0)),
}
_STICKING = (1e-3, 3e-3, 5e-3, 10.4e-3)
_FILMS, _CONTROLS = 12, 7
_SECONDS, _SHAKE = 26.5, 0.5
_RATE, _SCALE, _QUALITY = 30.0, 12500.0, 85
_NS = 1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class Filmed:
    """Results of the stages for one cell, and its truth.

    Parameters
    ----------
    like : int
        Tray with the same beads and sides.
    cell : Tray
        That tray with the number of the cell.
    sticking : float, [m/s]
    tracks : tuple of (int, Tracks)
        With the number of the cycle.
    speeds : tuple of SpeedEstimate
    areas : ndarray (n, 2)
        Times, [s], and level areas of the autocorrelation.
    time : ndarray (n,), [s]
    bodies, weighted_size : ndarray (n,)
        True.
    """

    like: int
    cell: Tray
    sticking: float
    tracks: tuple[tuple[int, Tracks], ...]
    speeds: tuple[SpeedEstimate, ...]
    areas: np.ndarray
    time: np.ndarray
    bodies: np.ndarray
    weighted_size: np.ndarray

    @property
    def first(self) -> float:
        """True first merge, [s]; NaN without."""
        fallen = np.flatnonzero(self.bodies < self.bodies[0])
        return float(self.time[fallen[0]]) if fallen.size else math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Counted:
    """One cell and its counted bodies.

    Parameters
    ----------
    film : Filmed
        Without its tracks.
    counts : tuple of BodyEstimate
    merges : tuple of Merge
    """

    film: Filmed
    counts: tuple[BodyEstimate, ...]
    merges: tuple[Merge, ...]


def report() -> None:
    """Print the tables."""
    films = {_name(k, sticks=True): (k, True) for k in range(_FILMS)}
    films |= {_name(k, sticks=False): (k, False) for k in range(_CONTROLS)}
    missing = {name: film for name, film in films.items() if not (folder() / name).exists()}
    run_tasks(_make, missing, Workers())
    counted = run_tasks(_counted, {name: name for name in films}, Workers())
    cells = [cell for film in counted for cell in film]
    _report_controls([cell for cell in cells if cell.film.sticking == 0.0])
    print(
        '\n| tray, sticking speed | cells | error of bodies: mean (rms) | of size: mean (rms) '
        '| first merge found later by: mean (largest) [s] | paper: onset [s], true '
        '| sticking speed / truth, one cycle: mean (sd) | 95 % hold | all [95 %] '
        '| from the true merges |'
    )
    print('| --- ' * 10 + '|')
    for tray in (1, 3, 5):
        for speed in _STICKING:
            group = [
                cell for cell in cells if (cell.film.like, cell.film.sticking) == (tray, speed)
            ]
            if group:
                print(_row(tray, speed, group), flush=True)


def _name(number: int, *, sticks: bool) -> str:
    return f'{"sticking" if sticks else "control"}_tracks_{number}.pickle'


def _counted(name: str) -> list[Counted]:
    """Count the bodies in the tracks of a film."""
    cells = []
    for film in pickle.loads((folder() / name).read_bytes()):
        counter = BodyCounter(PipelineSettings(), film.cell)
        records = [
            record
            for cycle, tracks in film.tracks
            for record in counter.push(replace(tracks, cycle=cycle))
        ]
        first_cycle = [record for record in (*records, *counter.flush()) if record.cycle == 1]
        cells.append(
            Counted(
                film=replace(film, tracks=()),
                counts=tuple(record for record in first_cycle if isinstance(record, BodyEstimate)),
                merges=tuple(record for record in first_cycle if isinstance(record, Merge)),
            )
        )
    return cells


def _report_controls(cells: list[Counted]) -> None:
    print(
        '| tray | controls | with a merge | paper: onset found in | at [s] |\n'
        + '| --- ' * 5
        + '|'
    )
    for tray in (1, 3, 5):
        controls = [cell for cell in cells if cell.film.like == tray]
        onsets = np.array([_paper_onset(cell.film) for cell in controls])
        print(
            f'| {tray} | {len(controls)} | {sum(bool(cell.merges) for cell in controls)} '
            f'| {np.isfinite(onsets).sum()} | {np.nanmedian(onsets):.1f} |'
        )


def _paper_onset(film: Filmed) -> float:
    return paper_onset(*film.areas.T, _SHAKE) - _SHAKE


def _row(tray: int, speed: float, cells: list[Counted]) -> str:
    bodies, sizes = (np.concatenate(part) for part in zip(*map(_errors, cells), strict=True))
    late = [
        min(merge.stamp_ns for merge in cell.merges) / _NS - cell.film.first
        for cell in cells
        if cell.merges
    ]
    onset = np.nanmean([_paper_onset(cell.film) for cell in cells])
    true = np.nanmean([cell.film.first - _SHAKE for cell in cells])
    beads = load_trays()[tray].count
    contacts = slow_contacts(load_trays()[tray])
    cycles = [_cycle(cell.film, cell.merges, beads) for cell in cells]
    actual = [
        _cycle(cell.film, true_merges(cell.film.time, cell.film.bodies, beads), beads)
        for cell in cells
    ]
    estimates = [sticking_estimate([cycle], contacts, beads) for cycle in cycles]
    ratio = np.array([estimate.sticking_speed for estimate in estimates]) / speed
    covered = sum(estimate.lower <= speed <= estimate.upper for estimate in estimates)
    combined, by_true_merges = (
        sticking_estimate(some, contacts, beads) for some in (cycles, actual)
    )
    return (
        f'| {tray}, {1e3 * speed:g} mm/s | {len(cells)} '
        f'| {bodies.mean():+.2f} ({np.sqrt(np.mean(bodies**2)):.2f}) '
        f'| {100 * sizes.mean():+.0f} % ({100 * np.sqrt(np.mean(sizes**2)):.0f} %) '
        f'| {np.mean(late):+.2f} ({np.abs(late).max():.2f}) | {onset:.1f}, {true:.2f} '
        f'| {np.nanmean(ratio):.2f} ({np.nanstd(ratio):.2f}) | {covered}/{len(cells)} '
        f'| {combined.sticking_speed / speed:.2f} [{combined.lower / speed:.2f}, '
        f'{combined.upper / speed:.2f}] | {by_true_merges.sticking_speed / speed:.2f} |'
    )


def _errors(cell: Counted) -> tuple[np.ndarray, np.ndarray]:
    """Errors of the number of bodies, and relative errors of the size, where known."""
    counts = [count for count in cell.counts if math.isfinite(count.bodies.value)]
    film = cell.film
    times = np.array([estimate.stamp_ns / _NS for estimate in counts])
    at = np.searchsorted(film.time, times - 0.5 / _RATE)
    bodies = np.array([estimate.bodies.value for estimate in counts]) - film.bodies[at]
    size = (
        np.array([estimate.weighted_size.value for estimate in counts]) / film.weighted_size[at]
        - 1.0
    )
    return bodies, size


def _cycle(film: Filmed, merges: Sequence[Merge], beads: int) -> StickingCycle:
    speeds = [speed for speed in film.speeds if speed.cycle == 1]
    return sticking_cycle(
        beads,
        merges,
        np.array([speed.stamp_ns for speed in speeds], dtype=np.int64),
        np.array([speed.mean_projected_speed.value for speed in speeds]),
        round(_SHAKE * _NS),
    )


def _make(task: tuple[int, bool]) -> None:
    cv2.setNumThreads(1)
    number, sticks = task
    flown = load_trays()
    cells: dict[int, Tray] = {}
    tray_of_cell: dict[int, int] = {}
    for default_tray, places in _PLACES.items():
        tray = 5 if default_tray == 3 and number % 2 else default_tray
        for x, y in places:
            cell = len(cells) + 1
            cells[cell] = replace(flown[tray], number=cell, place=(1e-3 * x, 1e-3 * y))
            tray_of_cell[cell] = tray
    gases = {
        cell: SimulationSettings(
            seed=2000 + 2 * number + int(sticks),
            mean_speed=0.010,
            first_shake=_SHAKE,
            frame_rate=_RATE,
            restitution=0.89,
            wall_restitution=0.97,
            sticking_speed=_STICKING[(cell - 1) % 4] if sticks else 0.0,
        )
        for cell in cells
    }
    results = _film(cells, gases)
    films = [
        Filmed(
            like=tray_of_cell[cell],
            cell=cells[cell],
            sticking=gases[cell].sticking_speed,
            **values,
        )
        for cell, values in results.items()
    ]
    path = folder() / _name(number, sticks=sticks)
    write_bytes(path, pickle.dumps(films))


def _film(cells: dict[int, Tray], gases: dict[int, SimulationSettings]) -> dict[int, dict]:
    scene = SceneFilm(gases[1], SceneSettings(trays=tuple(cells)), cells, gases)
    names = {
        'trays': list(cells),
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': _SCALE,
        # There are no libraries for the numbers of the cells.
        'cooling.relation': 'paper',
    }
    settings = with_values(PipelineSettings(), names, 'benchmark')
    stage = Preprocessor(settings, cells, 'film', View(camera=scene.camera.geometry.camera))
    stages = {cell: TrayStages(settings, tray) for cell, tray in cells.items()}
    for tray_stages in stages.values():
        tray_stages.measurement.emit_tracks = True
    tracks: dict[int, list[tuple[int, Tracks]]] = {cell: [] for cell in cells}
    records: dict[int, list] = {cell: [] for cell in cells}
    truth: dict[int, list[tuple[float, float, float]]] = {cell: [] for cell in cells}
    for moment in scene.moments(round(_SECONDS * _RATE)):
        for beads in moment.beads:
            sizes = np.unique(beads.bodies, return_counts=True)[1]
            weighted = float(np.sum(sizes**2) / sizes.sum())
            truth[beads.tray].append((beads.stamp_ns / _NS, float(sizes.size), weighted))
        quality = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
        jpeg = cv2.imencode('.jpg', moment.frame.image, quality)[1]
        image = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
        frame = Frame(stamp_ns=moment.frame.stamp_ns, encoding='bgr8', image=image)
        for record in stage.push(frame):
            if isinstance(record, TrayImage):
                products = stages[record.tray].push(record)
                new_tracks = [item for item in products if isinstance(item, Tracks)]
                tracks[record.tray] += [(record.cycle or 0, item) for item in new_tracks]
                kinds = (ClusterEstimate, SpeedEstimate)
                records[record.tray] += [item for item in products if isinstance(item, kinds)]
    results = {}
    for cell, tray in stages.items():
        cell_records = [*records[cell], *tray.flush()]
        time, bodies, weighted = np.array(truth[cell]).T
        clusters = [item for item in cell_records if isinstance(item, ClusterEstimate)]
        results[cell] = {
            'tracks': tuple(tracks[cell]),
            'speeds': tuple(item for item in cell_records if isinstance(item, SpeedEstimate)),
            'areas': np.array(
                [(cluster.stamp_ns / _NS, cluster.level_area) for cluster in clusters]
            ),
            'time': time,
            'bodies': bodies,
            'weighted_size': weighted,
        }
    return results
