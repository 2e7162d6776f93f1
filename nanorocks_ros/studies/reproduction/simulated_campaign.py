"""A campaign in flight, simulated: cycles of the plate, filmed and analysed like flight data.

Every cycle is a task of its own with a folder of its own: interrupted, the campaign goes on with
the next; on several cores, several are made at once.
"""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.settings import (
    CompressionSettings,
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.studies.analysis.results_folder import write_results
from nanorocks_ros.studies.analysis.results_json import as_json
from nanorocks_ros.studies.synthetic.film_bag import START_NS
from nanorocks_ros.studies.synthetic.film_scene import SceneRecorder
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.bead_truth import beads_from_array

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from nanorocks_ros.studies.analysis.offline_analysis import Analysis

SCALE = 12500.0
"""Of the picture of the plate at 1920 pixels, [px/m]."""

BOUNCING, STICKING = 'bouncing', 'sticking'
FILM, RESULTS, PAPER, SUMMARY = 'film', 'results', 'paper', 'summary.json'
_SHAKE = 1.0
_QUALITY = 85
# Shares of the work on a cycle: film, analysis, analysis by the paper's recipe.
_SHARES = (0.35, 0.45, 0.2)
# Truth of the clusters is kept so often, [s].
_TRUTH_STEP = 0.2
# What a folder of this kind is marked with.
_MARK = '.nanorocks_campaign'


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignPlan:
    """What is simulated.

    Parameters
    ----------
    cycles : int, > 0
        Of each kind: without sticking, and with.
    seconds : float, [s]
        Of film for each cycle.
    seed : int
    restitution, wall_restitution : float, 0 to 1
    sticking_speed : float, [m/s]
        Of the kind that sticks.
    """

    cycles: int = 1
    seconds: float = 34.0
    seed: int = 1
    restitution: float = 0.89
    wall_restitution: float = 0.97
    sticking_speed: float = 3e-3

    def tasks(self, folder: Path) -> dict[str, CycleTask]:
        """Every cycle, by the name of its folder."""
        return {
            f'{kind}_{number:03d}': CycleTask(
                plan=self, folder=folder / f'{kind}_{number:03d}', kind=kind, number=number
            )
            for number in range(1, self.cycles + 1)
            for kind in (BOUNCING, STICKING)
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleTask:
    """One cycle to film and analyse."""

    plan: CampaignPlan
    folder: Path
    kind: str
    number: int

    @property
    def simulation(self) -> SimulationSettings:
        """Gas and camera of the cycle."""
        plan = self.plan
        return SimulationSettings(
            seed=10_000 * plan.seed + 2 * self.number + int(self.kind == STICKING),
            restitution=plan.restitution,
            wall_restitution=plan.wall_restitution,
            sticking_speed=plan.sticking_speed if self.kind == STICKING else 0.0,
            first_shake=_SHAKE,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleFiles:
    """What is there of a cycle that is finished.

    Parameters
    ----------
    folder : Path
    kind : str
        `BOUNCING` or `STICKING`.
    summary : dict
        ``default`` and ``paper``: the analyses, as `nanorocks analyse --json` gives them;
        ``followed``: of each tray the mean share of its beads that were followed; ``clusters``:
        of each tray, the truth about its bodies over time.
    """

    folder: Path
    kind: str
    summary: dict[str, Any]

    @property
    def film(self) -> Path | None:
        """The bag, where it was kept."""
        path = self.folder / FILM
        return path if path.exists() else None

    @property
    def results(self) -> Path:
        """Tables of the analysis by our defaults."""
        return self.folder / RESULTS

    def tray(self, number: int, how: str = 'default') -> dict[str, Any]:
        """What an analysis says of a tray."""
        return dict(self.summary[how]['trays'][str(number)])


def plate_settings(**values: object) -> PipelineSettings:
    """How films of the plate are analysed; further settings by name."""
    names = {
        'trays': sorted(load_trays()),
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': SCALE,
        **values,
    }
    return with_values(PipelineSettings(), names, 'campaign')


def paper_settings() -> PipelineSettings:
    """The same by the paper's recipes: binarised area, its closed form."""
    return plate_settings(
        **{'speed.method': 'binarised_area', 'cooling.relation': 'paper', 'cooling.delay': 0.0}
    )


def prepare_campaign(folder: Path, plan: CampaignPlan) -> None:
    """Make the folder, or take up the one that an interrupted campaign left.

    Raises
    ------
    RecordingError
        When it holds something else, or a campaign of another plan, or cannot be written.
    """
    mark = folder / _MARK
    wanted = {key: value for key, value in asdict(plan).items() if key != 'cycles'}
    try:
        if folder.exists() and not mark.is_file() and any(folder.iterdir()):
            raise RecordingError(
                str(folder), 'exists and holds no campaign', 'pass another --output'
            )
        folder.mkdir(parents=True, exist_ok=True)
        if mark.is_file() and json.loads(mark.read_text('utf-8')) != wanted:
            raise RecordingError(
                str(folder),
                'holds a campaign of other settings',
                'pass another --output, or the settings it was begun with',
            )
        mark.write_text(json.dumps(wanted), 'utf-8')
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else 'its mark is damaged'
        raise RecordingError(
            str(folder), f'cannot be used ({reason})', 'pass another --output'
        ) from error


def run_campaign(
    folder: Path, plan: CampaignPlan, workers: Workers, progress: Callable[[float], None]
) -> list[CycleFiles]:
    """Film and analyse all cycles that are not there yet.

    Parameters
    ----------
    folder : Path
        From `prepare_campaign`.
    plan : CampaignPlan
    workers : Workers
    progress : callable
        Called with the part of the cycles that is done, 0 to 1.

    Raises
    ------
    RecordingError
        When something cannot be written or read.
    KeyboardInterrupt
        Ctrl-C; its text says what is kept.
    """
    tasks = plan.tasks(folder)
    missing = {name: task for name, task in tasks.items() if not _finished(task.folder)}
    done = len(tasks) - len(missing)
    progress(done / len(tasks))
    try:
        run_tasks(
            film_and_analyse,
            missing,
            workers,
            lambda count, _: progress((done + count) / len(tasks)),
        )
    except KeyboardInterrupt:
        kept = sum(_finished(task.folder) for task in tasks.values())
        raise KeyboardInterrupt(
            f'{kept} of {len(tasks)} cycles are kept in {folder}; the same command goes on from '
            'there'
        ) from None
    return [_read(task) for task in tasks.values()]


def parts_done(folder: Path, plan: CampaignPlan) -> float:
    """How much of the campaign is done, 0 to 1, cycles that are under way among them."""
    total = 0.0
    tasks = plan.tasks(folder)
    for task in tasks.values():
        if _finished(task.folder):
            total += 1.0
            continue
        try:
            total += float(_part(task.folder).joinpath('done').read_text('utf-8') or 0.0)
        except (OSError, ValueError):
            continue
    return total / len(tasks)


def film_and_analyse(task: CycleTask) -> str:
    """Make a cycle; the name of its folder, which is there only when all in it is complete."""
    part = _part(task.folder)
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    film = part / FILM
    scene = SceneSettings(trays=tuple(sorted(load_trays())))
    recorder = SceneRecorder(task.simulation, scene, task.plan.seconds)
    recorder.into_bag(film, CompressionSettings(), _QUALITY, partial(_note, part, 0))
    settings = plate_settings()
    analysis = analyse(film, settings, progress=partial(_note, part, 1), scratch=part)
    write_results(analysis, part / RESULTS, film, settings)
    by_paper = analyse(film, paper_settings(), progress=partial(_note, part, 2), scratch=part)
    write_results(by_paper, part / PAPER, film, paper_settings())
    summary = {
        'default': as_json(analysis),
        'paper': as_json(by_paper),
        'followed': _followed(analysis),
        'clusters': _true_clusters(film),
    }
    (part / SUMMARY).write_text(json.dumps(summary), 'utf-8')
    if task.number > 1:
        # A minute of film is 100 MB.
        shutil.rmtree(film)
    (part / 'done').unlink(missing_ok=True)
    os.replace(part, task.folder)
    return task.folder.name


def _note(part: Path, stage: int, done: int, total: int) -> None:
    if done % 30 == 0:
        before = sum(_SHARES[:stage])
        (part / 'done').write_text(f'{before + _SHARES[stage] * done / total:.4f}', 'utf-8')


def _part(folder: Path) -> Path:
    return folder.with_name(f'.{folder.name}.part')


def _finished(folder: Path) -> bool:
    return (folder / SUMMARY).is_file()


def _read(task: CycleTask) -> CycleFiles:
    path = task.folder / SUMMARY
    try:
        summary = json.loads(path.read_text('utf-8'))
    except (OSError, ValueError) as error:
        raise RecordingError(
            str(path), 'is damaged', f'delete {task.folder} and run the command again'
        ) from error
    return CycleFiles(folder=task.folder, kind=task.kind, summary=summary)


def _followed(found: Analysis) -> dict[str, float | None]:
    """Of each tray the mean share of its beads in tracks, after the shaking event."""
    shares: dict[str, float | None] = {}
    for number, results in found.trays.items():
        after = [body.followed / body.beads for body in results.bodies if body.cycle > 0]
        shares[str(number)] = float(np.mean(after)) if after else None
    return shares


def _true_clusters(film: Path) -> dict[str, dict[str, list[float]]]:
    """Bodies of each tray over time: number, weight-averaged size, clusters, beads in them."""
    names = [topics.BEADS.absolute(number) for number in load_trays()]
    rows: dict[str, list[Sequence[float]]] = {}
    due: dict[int, int] = {}
    bag = open_bag(film)
    for message in bag.messages(names):
        tray = topics.tray_of(message.topic) or 0
        if message.log_time_ns < due.get(tray, 0):
            continue
        due[tray] = message.log_time_ns + round(_TRUTH_STEP * 1e9)
        values = bag.deserialize(message).data
        one = beads_from_array(values, tray=tray, epoch_ns=START_NS, where=message.topic)
        sizes = np.unique(one.bodies, return_counts=True)[1].astype(float)
        large = sizes[sizes > 1.0]
        time = (one.stamp_ns - START_NS) / 1e9
        weighted = float(np.sum(sizes**2) / sizes.sum())
        rows.setdefault(str(tray), []).append(
            (time, float(sizes.size), weighted, float(large.size), float(large.sum()))
        )
    columns = ('time', 'bodies', 'weighted_size', 'clusters', 'beads_in_clusters')
    return {
        tray: {
            name: list(values)
            for name, values in zip(columns, zip(*own, strict=True), strict=True)
        }
        for tray, own in rows.items()
    }


def of_kind(cycles: Sequence[CycleFiles], kind: str) -> list[CycleFiles]:
    """Those with or without sticking."""
    return [cycle for cycle in cycles if cycle.kind == kind]
