"""Simulate a tray that cools after a shaking event: `nanorocks_ros.simulate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays, tray_by_number
from nanorocks_ros.interface.progress_bars import count_bar, part_bar
from nanorocks_ros.interface.python_words import in_python
from nanorocks_ros.interface.results.simulation_result import SimulationResult
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.settings import SimulationSettings, with_values
from nanorocks_ros.studies.synthetic.film_video import VIDEOS
from nanorocks_ros.studies.synthetic.simulated_files import SimulatedFiles
from nanorocks_ros.studies.synthetic.simulated_plan import SimulationPlan, default_samples
from nanorocks_ros.studies.synthetic.simulated_runs import simulate as simulated_runs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.interface.inputs import PathLike


def simulate(
    *,
    tray: int = 1,
    trays_file: PathLike = '',
    duration: float = 60.0,
    runs: int = 1,
    times: int | None = None,
    film: PathLike | None = None,
    overwrite: bool = False,
    keep_tracks: bool = False,
    workers: int | None = None,
    progress: bool = True,
    **settings: float | str | Sequence[float],
) -> SimulationResult:
    """Simulate runs of a tray whose beads cool after a shaking event.

    It is what the command ``nanorocks simulate`` does. Results do not depend on the workers.

    Parameters
    ----------
    tray : int
        Number of the tray.
    trays_file : path, optional
        YAML file of trays other than those that flew.
    duration : float, [s]
        After the shaking event; a film begins ``first_shake`` before it.
    runs : int
        Their number.
    times : int, optional
        Number of evenly spaced times of curves and tracks; default: one for each frame, at most
        301.
    film : path, optional
        Where to film the first run: a video for ``.avi`` or ``.mp4``, close to the tray; else a
        bag, which holds the truth as well.
    overwrite : bool
        Whether to replace a video that exists.
    keep_tracks : bool
        Whether to keep places and velocities of all beads at all times, for ``.tracks``.
    workers : int, optional
        Processes; default: one for each core.
    progress : bool
        As of `analyse`.
    **settings
        Of the simulation, such as ``restitution=0.89``, ``wall_restitution=0.97`` or ``seed=1``;
        ``nanorocks simulate --help-all`` lists them.

    Returns
    -------
    SimulationResult

    Raises
    ------
    ConfigurationError
        For an unknown setting, or a value that cannot be.
    RecordingError
        When the film exists, or cannot be written.
    SimulationError
        When the beads do not fit.
    """
    with in_python():
        told = with_values(SimulationSettings(), {'tray': tray, **settings}, 'simulate')
        trays = load_trays(str(trays_file))
        samples = default_samples(told, duration) if times is None else times
        plan = SimulationPlan(
            settings=told,
            tray=tray_by_number(trays, tray),
            trays_file=str(trays_file),
            duration=duration,
            samples=samples,
            runs=runs,
            trajectory=keep_tracks,
            picture=True,
            events=True,
        )
        plan.check_size()
        files = _films(film, overwrite=overwrite)
        files.check(plan)
        with part_bar('simulating', shown=progress) as part:
            simulated = simulated_runs(plan, Workers(processes=workers), part)
        if film is not None:
            with count_bar('filming', shown=progress) as count:
                _ = (files.film_video if files.video else files.film_bag)(plan, count)
        return SimulationResult(simulated)


def _films(film: PathLike | None, *, overwrite: bool) -> SimulatedFiles:
    """The file of the film: a video by its ending, else a bag."""
    if film is None:
        return SimulatedFiles()
    path = Path(film).expanduser()
    if path.suffix.lower() in VIDEOS:
        return SimulatedFiles(video=path, force=overwrite)
    if path.suffix:
        raise ConfigurationError(
            str(film),
            f'ends in {path.suffix}',
            f'name a video ({", ".join(VIDEOS)}), or a bag, which has no ending',
        )
    return SimulatedFiles(bag=path)
