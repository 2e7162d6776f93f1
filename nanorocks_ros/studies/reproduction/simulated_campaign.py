"""A simulated campaign: cycles of the plate, filmed and analysed like flight data.

Each cycle is a task with its own folder. An interrupted campaign continues with the next cycle;
several cores make several cycles at once.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import json
import os
from contextlib import contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.jobs.folder_lock import lock_folder
from nanorocks_ros.jobs.interruption import interruption_says
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.outputs.json_values import read_object
from nanorocks_ros.outputs.unfinished_files import holds_files
from nanorocks_ros.studies.reproduction.campaign_cycle import (
    CycleFiles,
    delete_unfinished_cycles,
    film_and_analyse,
    is_finished,
    part_done,
    read_cycle,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from nanorocks_ros.studies.reproduction.campaign_plan import CampaignPlan

# A file of this name marks the folder of a campaign; the other is locked by its process.
_MARK, _LOCK = '.nanorocks_campaign', '.lock'


@contextmanager
def open_campaign(folder: Path, plan: CampaignPlan) -> Iterator[None]:
    """Make the folder of a campaign, or reuse that of an interrupted one; one process at a time.

    Raises
    ------
    RecordingError
        When it holds other files or a campaign of another plan, is in use, or cannot be written.
    """
    with _folder_errors(folder):
        is_campaign = not folder.exists() or (folder / _MARK).is_file()
        if not is_campaign and holds_files(folder, besides=_LOCK):
            raise RecordingError(
                str(folder), 'exists and holds no campaign', 'pass another --output'
            )
    lock = lock_folder(folder, _LOCK)
    try:
        with _folder_errors(folder):
            _mark(folder, plan)
        delete_unfinished_cycles(folder)
        yield
    finally:
        os.close(lock)


def _mark(folder: Path, plan: CampaignPlan) -> None:
    """Write the plan into the folder, or compare it with the plan that is there."""
    mark = folder / _MARK
    settings = {key: value for key, value in asdict(plan).items() if key != 'cycles'}
    if mark.is_file() and read_object(mark) != settings:
        raise RecordingError(
            str(folder),
            'holds a campaign of other settings',
            'pass another --output, or the settings of that campaign',
        )
    write_bytes(mark, json.dumps(settings).encode())


@contextmanager
def _folder_errors(folder: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else 'its mark is damaged'
        raise RecordingError(
            str(folder), f'cannot be used ({reason})', 'pass another --output'
        ) from error


def run_campaign(
    folder: Path, plan: CampaignPlan, workers: Workers, progress: Callable[[float], None]
) -> list[CycleFiles]:
    """Film and analyse the cycles that are not finished.

    Parameters
    ----------
    folder : Path
        Inside of `open_campaign`.
    plan : CampaignPlan
    workers : Workers
    progress : callable
        Called with the part of the cycles that is finished, 0 to 1.

    Raises
    ------
    RecordingError
        When a file cannot be written or read.
    KeyboardInterrupt
        On Ctrl-C; the text names the cycles that are kept.
    """
    tasks = plan.tasks(folder)
    missing = {name: task for name, task in tasks.items() if not is_finished(task.folder)}
    done = len(tasks) - len(missing)
    progress(done / len(tasks))

    def kept() -> str:
        finished = sum(is_finished(task.folder) for task in tasks.values())
        return (
            f'{finished} of {len(tasks)} cycles are kept in {folder}; the same command goes on '
            'from there'
        )

    with interruption_says(kept):
        run_tasks(
            film_and_analyse,
            missing,
            workers,
            lambda count, _: progress((done + count) / len(tasks)),
        )
    return [read_cycle(task) for task in tasks.values()]


def parts_done(folder: Path, plan: CampaignPlan) -> float:
    """The part of a campaign that is done, 0 to 1, with the cycles in progress."""
    tasks = plan.tasks(folder)
    return sum(part_done(task.folder) for task in tasks.values()) / len(tasks)
