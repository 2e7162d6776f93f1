"""The decay of the speeds in a known container, compared with a library made for it.

Tested by ``test/studies/measure/test_measure_film.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.jobs.resumed_tasks import delete_parts_of_finished
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.studies.analysis.results.results_folder import write_results
from nanorocks_ros.studies.libraries.decay_simulations import build_library
from nanorocks_ros.studies.libraries.library_nodes import LibraryPlan

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import AbstractContextManager
    from pathlib import Path

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.jobs.progress import Progress
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.records import Tracks
    from nanorocks_ros.studies.analysis.offline_analysis import Analysis
    from nanorocks_ros.studies.analysis.recognition_verdicts import Verdict

# Points and runs of a library that is made on the way: half of those of `nanorocks library`.
_NODES, _ROUGH_NODES, _RUNS = 400, 300, 8
_LEAST_BEADS = 3


class _Plan(Protocol):
    """What of a plan the decay needs."""

    @property
    def bag(self) -> Path: ...

    @property
    def folder(self) -> Path: ...

    @property
    def image_topic(self) -> str: ...

    @property
    def workers(self) -> Workers: ...


class _Teller(Protocol):
    def say(self, line: str) -> None: ...

    def progress(self, label: str) -> AbstractContextManager[Progress]: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class DecayStep:
    """A tray whose decay may be read.

    Parameters
    ----------
    tray : Tray
    records : sequence of Tracks
        Of all frames.
    container_known : bool
    verdicts : tuple of Verdict
        On its beads.
    settings : PipelineSettings
        For this tray alone.
    """

    tray: Tray
    records: Sequence[Tracks]
    container_known: bool
    verdicts: tuple[Verdict, ...]
    settings: PipelineSettings = field(default_factory=PipelineSettings)

    @property
    def reason_against(self) -> str:
        """Why the decay cannot be read; empty when it can."""
        if not all(verdict.usable for verdict in self.verdicts):
            return 'the beads are not recognised well enough, see above'
        if not self.container_known:
            return (
                'it needs the container: --corners, --sides-mm, --height-mm, and --diameter-mm of '
                'the beads'
            )
        if not all(species.counted for species in self.tray.species):
            return 'it needs the number of beads: --count'
        if self.tray.count < _LEAST_BEADS:
            return f'fewer than {_LEAST_BEADS} beads are no gas that cools'
        if not any(record.cycle > 0 for record in self.records):
            return (
                'no shaking event was seen after which the beads cool; contacts need none, and '
                'stand above'
            )
        return ''


def measured_decay(plan: _Plan, step: DecayStep, teller: _Teller) -> Analysis:
    """Analyse the recording with the library of its tray, made where there is none.

    Raises
    ------
    NanorocksError
        When the library cannot be made, or the recording not be analysed.
    """
    library = _library(plan, step, teller)
    cooling = replace(step.settings.cooling, decay_library=library)
    settings = replace(step.settings, cooling=cooling)
    with teller.progress('analysing') as progress:
        analysis = analyse(
            plan.bag,
            settings,
            image_topic=plan.image_topic,
            progress=progress,
            scratch=plan.folder,
        )
    write_results(analysis, plan.folder / f'tray_{step.tray.number}', plan.bag, settings)
    return analysis


def _library(plan: _Plan, step: DecayStep, teller: _Teller) -> str:
    """The library of the settings, of the package, or of an earlier run; else a new one."""
    told = step.settings.cooling.decay_library
    own = plan.folder / f'tray_{step.tray.number}_library.npz'
    library_plan = LibraryPlan(tray=step.tray, nodes=_NODES, rough_nodes=_ROUGH_NODES, runs=_RUNS)
    delete_parts_of_finished(own, library_plan.specification())
    for path in (told,) if told else ('', str(own)):
        try:
            library_of(step.tray, path)
        except ConfigurationError:
            if told:
                raise
        else:
            return path
    teller.say(
        f'library: the decay is compared with simulations of this tray, made once, in {own}; the '
        'same command continues if it is interrupted'
    )
    with teller.progress('library') as progress:
        build_library(library_plan, own, plan.workers, progress, teller.say)
    return str(own)
