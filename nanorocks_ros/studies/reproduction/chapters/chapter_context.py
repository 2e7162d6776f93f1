"""What every chapter of the report starts from, and what it returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.studies.reproduction.simulated_campaign import (
    BOUNCING,
    STICKING,
    CycleFiles,
    of_kind,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.outputs.html_report import Section
    from nanorocks_ros.studies.reproduction.simulated_campaign import CampaignPlan


class Difference(NamedTuple):
    """A row of the table of differences; each a text, empty where there is nothing.

    `what`; `paper`: what it reports; `its_method`: the same method on our films; `ours`: our
    default; `truth`: what was put in.
    """

    what: str
    paper: str
    its_method: str
    ours: str
    truth: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Context:
    """What is there when the campaign is over.

    Parameters
    ----------
    folder : Path
        For pictures and searches, of the report.
    plan : CampaignPlan
    cycles : sequence of CycleFiles
    workers : Workers
    runs : int
        At each point of a search.
    notice : callable
        Called with what the user should know.
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
        """Cycles in which nothing sticks."""
        return of_kind(self.cycles, BOUNCING)

    @property
    def sticking(self) -> list[CycleFiles]:
        """Cycles in which beads stick."""
        return of_kind(self.cycles, STICKING)

    def film(self, kind: str = BOUNCING) -> Path:
        """The film that was kept."""
        return next(one.film for one in of_kind(self.cycles, kind) if one.film is not None)

    def picture(self, name: str) -> Path:
        """Where a picture goes."""
        return self.folder / name

    def count(self, done: int, total: int) -> None:
        """So many of all steps of the chapter are done."""
        self.progress(done / max(total, 1))


@dataclass(slots=True, kw_only=True)
class Chapter:
    """A section of the report, and the rows it adds to the table of differences."""

    section: Section
    differences: list[Difference] = field(default_factory=list)
