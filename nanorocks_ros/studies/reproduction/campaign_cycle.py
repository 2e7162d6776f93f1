"""One cycle of a simulated campaign: its film, its analyses, and the summary of both.

The folder of a cycle gets its name when all files in it are complete.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.outputs.json_values import read_object
from nanorocks_ros.settings import CompressionSettings, SceneSettings
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.studies.analysis.results.results_folder import write_results
from nanorocks_ros.studies.analysis.results.results_json import as_json
from nanorocks_ros.studies.reproduction.campaign_plan import (
    BOUNCING,
    STICKING,
    paper_settings,
    plate_settings,
)
from nanorocks_ros.studies.reproduction.campaign_truth import TrackSampler, film_truth
from nanorocks_ros.studies.synthetic.film_scene import SceneRecorder

if TYPE_CHECKING:
    from nanorocks_ros.studies.reproduction.campaign_plan import CycleTask

FILM, RESULTS, PAPER, SUMMARY = 'film', 'results', 'paper', 'summary.json'
_PROGRESS = 'done'
_QUALITY = 85
# Shares of the work on a cycle: film, analysis, analysis by the paper's recipe.
_SHARES = (0.35, 0.45, 0.2)
_PROGRESS_STEP_FRAMES = 30


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleFiles:
    """Files and summary of a finished cycle.

    Parameters
    ----------
    folder : Path
    kind : str
        `BOUNCING` or `STICKING`.
    summary : dict
        ``default`` and ``paper``: the analyses, as `nanorocks analyse --json` prints them;
        ``truth`` and ``tracked``: see `campaign_truth.FilmTruth`.
    """

    folder: Path
    kind: str
    summary: dict[str, Any]

    @property
    def film(self) -> Path | None:
        """The bag of the film; None where it was deleted."""
        path = self.folder / FILM
        return path if path.exists() else None

    @property
    def results(self) -> Path:
        """Tables of the analysis with the default settings."""
        return self.folder / RESULTS

    def tray(self, number: int, analysis: str = 'default') -> dict[str, Any]:
        """The results of one tray, of the analysis ``default`` or ``paper``."""
        return dict(self.summary[analysis]['trays'][str(number)])

    def first_cycle(self, number: int, analysis: str = 'default') -> dict[str, Any]:
        """The summary of the first cycle of a tray; empty where no cycle was found."""
        cycles = self.tray(number, analysis)['cycles']
        return dict(cycles[0]) if cycles else {}


def film_and_analyse(task: CycleTask) -> str:
    """Film and analyse a cycle, and return the name of its folder.

    Raises
    ------
    RecordingError
        When the folder is there without its summary, or a file cannot be written.
    """
    if task.folder.exists():
        raise RecordingError(
            str(task.folder), f'has no {SUMMARY}', 'delete it, and run the command again'
        )
    part = _part_folder(task.folder)
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    film = part / FILM
    scene = SceneSettings(trays=tuple(sorted(load_trays())))
    recorder = SceneRecorder(task.simulation, scene, task.plan.seconds)
    recorder.into_bag(film, CompressionSettings(), _QUALITY, partial(_write_progress, part, 0))
    settings = plate_settings()
    sampler = TrackSampler()
    analysis = analyse(
        film,
        settings,
        progress=partial(_write_progress, part, 1),
        scratch=part,
        observer=sampler,
    )
    write_results(analysis, part / RESULTS, film, settings)
    by_paper = analyse(
        film, paper_settings(), progress=partial(_write_progress, part, 2), scratch=part
    )
    write_results(by_paper, part / PAPER, film, paper_settings())
    truth = film_truth(film, sampler.tracks)
    summary = {
        'default': as_json(analysis),
        'paper': as_json(by_paper),
        'truth': truth.series,
        'tracked': truth.tracked,
    }
    write_bytes(part / SUMMARY, json.dumps(summary).encode())
    if task.number > 1:
        # A minute of film takes 100 MB; the report needs the film of the first cycle only.
        shutil.rmtree(film)
    (part / _PROGRESS).unlink(missing_ok=True)
    os.replace(part, task.folder)
    return task.folder.name


def _write_progress(part: Path, stage: int, done: int, total: int) -> None:
    if done % _PROGRESS_STEP_FRAMES == 0:
        before = sum(_SHARES[:stage])
        (part / _PROGRESS).write_text(f'{before + _SHARES[stage] * done / total:.4f}', 'utf-8')


def part_done(folder: Path) -> float:
    """The part of a cycle that is done, 0 to 1, from the file that its process writes."""
    if is_finished(folder):
        return 1.0
    try:
        return float(_part_folder(folder).joinpath(_PROGRESS).read_text('utf-8') or 0.0)
    except (OSError, ValueError):
        return 0.0


def _part_folder(folder: Path) -> Path:
    return folder.with_name(f'.{folder.name}.part')


def delete_unfinished_cycles(folder: Path) -> None:
    """Delete what killed processes left of the cycles of a campaign that no process makes."""
    for kind in (BOUNCING, STICKING):
        for part in folder.glob(_part_folder(folder / f'{kind}_*').name):
            shutil.rmtree(part, ignore_errors=True)


def is_finished(folder: Path) -> bool:
    """Whether the folder of a cycle is complete."""
    return (folder / SUMMARY).is_file()


def read_cycle(task: CycleTask) -> CycleFiles:
    """The files of a finished cycle, with its summary.

    Raises
    ------
    RecordingError
        When the summary is damaged.
    """
    path = task.folder / SUMMARY
    try:
        summary = read_object(path)
    except (OSError, ValueError) as error:
        raise RecordingError(
            str(path), 'is damaged', f'delete {task.folder} and run the command again'
        ) from error
    return CycleFiles(folder=task.folder, kind=task.kind, summary=summary)
