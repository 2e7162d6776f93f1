"""Everything that can be written about simulated runs: which files, looked at and made."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from nanorocks_ros.outputs.atomic_files import check_outputs
from nanorocks_ros.outputs.parquet import check_parquet
from nanorocks_ros.studies.synthetic.film_bag import check_camera, check_quality, film_into_bag
from nanorocks_ros.studies.synthetic.film_video import (
    VIDEOS,
    check_video,
    close_up,
    film_into_video,
)
from nanorocks_ros.studies.synthetic.trajectory import TABLES, write_events, write_trajectory

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from nanorocks_ros.jobs.progress import Progress
    from nanorocks_ros.settings import SimulationSettings
    from nanorocks_ros.studies.synthetic.simulated_plan import SimulationPlan
    from nanorocks_ros.studies.synthetic.simulated_result import SimulatedRuns

PICTURES = '.png', '.pdf', '.svg'
"""Endings of pictures."""

_ENDINGS = {
    '--trajectory': TABLES,
    '--events': TABLES,
    '--picture': PICTURES,
    '--video': VIDEOS,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedFiles:
    """What is to be written, and how.

    Parameters
    ----------
    trajectory, events, picture, video, bag : Path or None
    effects : bool
        Whether films show what the sensor adds; without, frames are clean.
    near : bool
        Whether the video is a close-up, whatever the settings say of the camera.
    quality : int
        Of the JPEGs in the bag, 1 to 100.
    force : bool
        Whether files that exist may be replaced; a bag never is.
    """

    trajectory: Path | None = None
    events: Path | None = None
    picture: Path | None = None
    video: Path | None = None
    bag: Path | None = None
    effects: bool = True
    near: bool = True
    quality: int = 90
    force: bool = False

    @property
    def named(self) -> dict[str, Path]:
        """Those that are asked for, by their flag."""
        names = 'trajectory', 'events', 'picture', 'video', 'bag'
        found = {f'--{name}': getattr(self, name) for name in names}
        return {flag: path for flag, path in found.items() if path is not None}

    def check(self, plan: SimulationPlan) -> None:
        """Refuse what would fail in the end, before the work.

        Raises
        ------
        ConfigurationError
            For an unknown ending, a quality out of range, or a package that is missing.
        RecordingError
            For a file that exists, or cannot be made where it should.
        SimulationError
            For a tray that does not fit into the picture.
        """
        check_outputs(self.named, _ENDINGS, force=self.force)
        for table in (self.trajectory, self.events):
            if table is not None:
                check_parquet(table)
        if self.video is not None:
            check_video(self.video)
            check_camera(self._video_settings(plan), plan.tray)
        if self.bag is not None:
            check_quality(self.quality)
            check_camera(plan.settings, plan.tray)

    def write(self, found: SimulatedRuns) -> Iterator[Path]:
        """Write all but the films, one after the other.

        Yields
        ------
        Path
            When it is there.

        Raises
        ------
        RecordingError
            When a file cannot be written.
        """
        writers: list[tuple[Path | None, Callable[[Path, SimulatedRuns], None]]] = [
            (self.trajectory, write_trajectory),
            (self.events, write_events),
            (self.picture, _draw),
        ]
        for path, writer in writers:
            if path is not None:
                writer(path, found)
                yield path

    def film_bag(self, plan: SimulationPlan, progress: Progress) -> dict[str, Any]:
        """Film the first run into the bag, and say what was filmed."""
        assert self.bag is not None
        return film_into_bag(
            self.bag,
            self._seen(plan.settings),
            duration=plan.duration,
            quality=self.quality,
            progress=progress,
            tray=plan.tray,
        )

    def film_video(self, plan: SimulationPlan, progress: Progress) -> dict[str, Any]:
        """Film the first run into the video, and say what was filmed."""
        assert self.video is not None
        settings = self._video_settings(plan)
        return film_into_video(
            self.video, settings, plan.tray, duration=plan.duration, progress=progress
        )

    def _video_settings(self, plan: SimulationPlan) -> SimulationSettings:
        seen = self._seen(plan.settings)
        return close_up(seen, plan.tray) if self.near else seen

    def _seen(self, settings: SimulationSettings) -> SimulationSettings:
        return settings if self.effects else replace(settings, noise=0.0)


def _draw(path: Path, found: SimulatedRuns) -> None:
    # Loads matplotlib, which takes longer than most runs.
    from nanorocks_ros.studies.synthetic.simulated_figure import simulated_figure

    simulated_figure(path, found)
