"""Output files of simulated runs: checked before the simulation, written after it.

Tested by ``test/cli/simulation/test_simulate.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from nanorocks_ros.outputs.atomic_files import check_outputs
from nanorocks_ros.outputs.tables.parquet import check_parquet
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
"""Suffixes of figures."""

_ENDINGS = {
    '--trajectory': TABLES,
    '--events': TABLES,
    '--picture': PICTURES,
    '--video': VIDEOS,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedFiles:
    """Files to write, and how.

    Parameters
    ----------
    trajectory, events, picture, video, bag : Path or None
    effects : bool
        Whether films contain sensor noise.
    near : bool
        Whether the video is a close-up, regardless of the camera settings.
    quality : int
        JPEG quality in the bag, 1 to 100.
    force : bool
        Whether existing files may be replaced; a bag never is.
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
        """Paths of the files to write, by flag."""
        names = 'trajectory', 'events', 'picture', 'video', 'bag'
        files = {f'--{name}': getattr(self, name) for name in names}
        return {flag: path for flag, path in files.items() if path is not None}

    def check(self, plan: SimulationPlan) -> None:
        """Raise for files that could not be written, before the simulation.

        Raises
        ------
        ConfigurationError
            For an unknown suffix, a quality out of range, or a missing package.
        RecordingError
            For a file that exists, or cannot be created.
        SimulationError
            For a tray that does not fit into the image.
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

    def write(self, simulated: SimulatedRuns) -> Iterator[Path]:
        """Write all files except films, one after the other.

        Yields
        ------
        Path
            Each file when it is written.

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
                writer(path, simulated)
                yield path

    def film_bag(self, plan: SimulationPlan, progress: Progress) -> dict[str, Any]:
        """Film the first run into the bag; return frames, duration, tray and seed."""
        assert self.bag is not None
        return film_into_bag(
            self.bag,
            self._film_settings(plan.settings),
            duration=plan.duration,
            quality=self.quality,
            progress=progress,
            tray=plan.tray,
            trays_file=plan.trays_file,
        )

    def film_video(self, plan: SimulationPlan, progress: Progress) -> dict[str, Any]:
        """Film the first run into the video; return frames and duration."""
        assert self.video is not None
        settings = self._video_settings(plan)
        return film_into_video(
            self.video, settings, plan.tray, duration=plan.duration, progress=progress
        )

    def _video_settings(self, plan: SimulationPlan) -> SimulationSettings:
        settings = self._film_settings(plan.settings)
        return close_up(settings, plan.tray) if self.near else settings

    def _film_settings(self, settings: SimulationSettings) -> SimulationSettings:
        return settings if self.effects else replace(settings, noise=0.0)


def _draw(path: Path, simulated: SimulatedRuns) -> None:
    # Imported here: loading matplotlib takes longer than most runs.
    from nanorocks_ros.studies.synthetic.simulated_figure import simulated_figure

    simulated_figure(path, simulated)
