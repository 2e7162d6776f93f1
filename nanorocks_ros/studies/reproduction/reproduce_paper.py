"""The report that reproduces the figures and tables of the paper from simulated films."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

from nanorocks_ros.errors import FitError, RecordingError
from nanorocks_ros.outputs.html_report import Section, write_report
from nanorocks_ros.studies.reproduction.chapters.chapter_context import Chapter, Context
from nanorocks_ros.studies.reproduction.chapters.cluster_chapter import (
    cluster_chapter,
    packing_chapter,
)
from nanorocks_ros.studies.reproduction.chapters.experiment_chapter import (
    experiment_chapter,
    processing_chapter,
)
from nanorocks_ros.studies.reproduction.chapters.onset_chapter import onset_chapter
from nanorocks_ros.studies.reproduction.chapters.restitution_chapter import (
    restitution_chapter,
)
from nanorocks_ros.studies.reproduction.chapters.rotation_chapter import rotation_chapter
from nanorocks_ros.studies.reproduction.chapters.simulation_chapter import simulation_chapter
from nanorocks_ros.studies.reproduction.chapters.speed_chapter import speed_chapter
from nanorocks_ros.studies.reproduction.report_head import conclusion, differences, limits, summary
from nanorocks_ros.studies.reproduction.simulated_campaign import open_campaign, run_campaign

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.studies.reproduction.campaign_plan import CampaignPlan

# CPU time of one second of film with its two analyses, [s].
_CPU_SECONDS = 5.0
REPORT, PICTURES = 'report.html', 'pictures'
_CHAPTERS: dict[str, Callable[[Context], Chapter]] = {
    'experiment': experiment_chapter,
    'processing': processing_chapter,
    'speeds': speed_chapter,
    'restitution': restitution_chapter,
    'clusters': cluster_chapter,
    'packing': packing_chapter,
    'onset': onset_chapter,
    'simulation': simulation_chapter,
    'rotation': rotation_chapter,
}


def reproduce(
    folder: Path,
    plan: CampaignPlan,
    workers: Workers,
    runs: int,
    progress: Callable[[str, float], None],
    notice: Callable[[str], None],
) -> Path:
    """Simulate, film and analyse a campaign, and write the report.

    Finished cycles and searches of an earlier call in the folder are reused.

    Parameters
    ----------
    folder : Path
    plan : CampaignPlan
    workers : Workers
    runs : int
        Simulated runs at each point of a search.
    progress : callable
        Called with the name of a chapter and the part of it that is done, 0 to 1.
    notice : callable
        Called with messages for the user, one line each.

    Returns
    -------
    Path
        The report.

    Raises
    ------
    RecordingError
        When the folder holds other files, is in use, or cannot be written.
    KeyboardInterrupt
        On Ctrl-C; finished cycles are kept.
    """
    with open_campaign(folder, plan):
        cycles = run_campaign(folder, plan, workers, lambda done: progress('films', done))
        pictures = folder / PICTURES
        pictures.mkdir(exist_ok=True)
        chapters = []
        for name in _CHAPTERS:
            context = Context(
                folder=pictures,
                plan=plan,
                cycles=cycles,
                workers=workers,
                runs=runs,
                notice=notice,
                progress=partial(progress, name),
            )
            chapters.append(_make_chapter(name, context))
        path = folder / REPORT
        write_report(
            path,
            'NanoRocks, reproduced',
            conclusion(chapters),
            [differences(chapters), limits(), *(chapter.section for chapter in chapters)],
            made=summary(folder, plan, runs),
        )
    return path


def _make_chapter(name: str, context: Context) -> Chapter:
    """A chapter of the report; a note instead where the campaign is too short for it."""
    context.progress(0.0)
    try:
        chapter = _CHAPTERS[name](context)
    except (FitError, RecordingError) as error:
        # The campaign may still be long enough for the other chapters.
        context.notice(f'{name}: {error}')
        missing = Section(title=name.capitalize(), parts=[f'Could not be made: {error}.'])
        chapter = Chapter(section=missing)
    context.progress(1.0)
    return chapter


def minutes(plan: CampaignPlan, cores: int) -> int:
    """Approximate time of the films and their analysis, [min]."""
    return math.ceil(
        2 * plan.cycles * plan.seconds * _CPU_SECONDS / max(min(cores, 2 * plan.cycles), 1) / 60
    )
