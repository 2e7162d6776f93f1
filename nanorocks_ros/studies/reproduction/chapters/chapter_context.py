"""Input and result of the chapters of the report.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.numerics.sample_mean import mean_of
from nanorocks_ros.outputs.html_report import with_error
from nanorocks_ros.studies.reproduction.campaign_plan import BOUNCING, STICKING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.outputs.html_report import Section
    from nanorocks_ros.studies.reproduction.campaign_cycle import CycleFiles
    from nanorocks_ros.studies.reproduction.campaign_plan import CampaignPlan


class Difference(NamedTuple):
    """A row of the table of differences; an unknown value is an empty text.

    `quantity`: its name and unit; `paper`: the published value; `its_method`: the paper's method
    on our films; `ours`: the default method; `truth`: the value of the simulation.
    """

    quantity: str
    paper: str
    its_method: str
    ours: str
    truth: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Context:
    """A finished campaign, from which the chapters are made.

    Parameters
    ----------
    folder : Path
        Folder of the pictures and searches of the report.
    plan : CampaignPlan
    cycles : sequence of CycleFiles
    workers : Workers
    runs : int
        Simulated runs at each point of a search.
    notice : callable
        Called with messages for the user.
    progress : callable
        Called with the part of the chapter that is done, 0 to 1.
    """

    folder: Path
    plan: CampaignPlan
    cycles: Sequence[CycleFiles]
    workers: Workers
    runs: int
    notice: Callable[[str], None]
    progress: Callable[[float], None]

    @property
    def bouncing(self) -> list[CycleFiles]:
        """Cycles without sticking."""
        return self._of_kind(BOUNCING)

    @property
    def sticking(self) -> list[CycleFiles]:
        """Cycles with sticking."""
        return self._of_kind(STICKING)

    def _of_kind(self, kind: str) -> list[CycleFiles]:
        return [cycle for cycle in self.cycles if cycle.kind == kind]

    def film(self, kind: str = BOUNCING) -> Path:
        """The film of the first cycle of a kind, the only one that is kept."""
        return next(cycle.film for cycle in self._of_kind(kind) if cycle.film is not None)

    def picture(self, name: str) -> Path:
        """The path of a picture."""
        return self.folder / name

    def count(self, done: int, total: int) -> None:
        """Report the steps of the chapter that are done."""
        self.progress(done / max(total, 1))


@dataclass(slots=True, kw_only=True)
class Chapter:
    """A section of the report, its rows of the table of differences, and what follows from it.

    `findings` are sentences for the conclusion of the report.
    """

    section: Section
    differences: list[Difference] = field(default_factory=list)
    findings: list[str] = field(default_factory=list)


def mean_text(values: Sequence[float | None], factor: float = 1.0) -> str:
    """Mean over the cycles and its standard error; without an error from a single cycle."""
    mean, scatter, count = mean_of(values)
    return with_error(mean, scatter / math.sqrt(max(count, 1)), factor)
