"""A sweep: many runs at every point of a grid of settings, in parallel and resumable."""

from __future__ import annotations

import math
import time
from contextlib import closing, nullcontext, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.jobs.interruption import interruption_says
from nanorocks_ros.jobs.journal import Journal, difference
from nanorocks_ros.jobs.resumed_tasks import parts_folder
from nanorocks_ros.jobs.tasks import Workers, as_completed
from nanorocks_ros.studies.sweeps.sweep_parts import (
    COUNTS,
    SPEEDS,
    RunRange,
    check_points,
    cool,
    divided,
    missing_runs,
    points_in_order,
)
from nanorocks_ros.studies.sweeps.sweep_result import Sweep

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from nanorocks_ros.jobs.progress import Progress
    from nanorocks_ros.outputs.npz_archive import Arrays
    from nanorocks_ros.studies.sweeps.sweep_plan import SweepPlan

# A part of more numbers than this is slow to send.
_MAX_NUMBERS = 2_000_000


def sweep(
    plan: SweepPlan,
    output: Path | None = None,
    workers: Workers | None = None,
    progress: Progress | None = None,
    notice: Callable[[str], None] | None = None,
) -> Sweep:
    """Simulate the cooling gas in many runs at every point of a grid.

    The numbers do not depend on the workers: each run has its own random numbers, and runs
    are added up in their order.

    Parameters
    ----------
    plan : SweepPlan
    output : Path, optional
        File for the result. Finished parts are kept in a folder beside it, ``OUTPUT.parts``,
        until the sweep is complete; the same call resumes an interrupted one. An existing
        result of the same plan is read.
    workers : Workers, optional
        By default processes on all cores.
    progress : callable, optional
        Called with the number of finished runs and the number of runs.
    notice : callable, optional
        Called with one line of text for each damaged part.

    Raises
    ------
    ConfigurationError
        For a setting, or a combination of settings, that cannot be used.
    SimulationError
        When the gas cannot be prepared or simulated at a point; names it.
    RecordingError
        When the output cannot be written, or it or its parts belong to another plan.
    NanorocksError
        When workers die repeatedly, or the cluster cannot be used.
    KeyboardInterrupt
        Ctrl-C; with an output its text says what is kept.
    """
    earlier = None if output is None else _existing_result(plan, output)
    if earlier is not None:
        return earlier
    workers = workers or Workers()
    check_points(plan)
    workers.check()
    with nullcontext() if output else TemporaryDirectory(prefix='nanorocks_sweep.') as scratch:
        folder = parts_folder(output) if output else Path(str(scratch))
        with Journal(folder, plan.specification()) as journal:
            work = _MissingRuns(plan, journal, progress or (lambda done, total: None))
            with interruption_says(work.kept) if output else nullcontext():
                work.run(workers, notice or (lambda text: None))
                result = assemble(plan, journal)
                if output is not None:
                    result.save(output)
            if output is not None:
                journal.delete()
    return result


def _existing_result(plan: SweepPlan, output: Path) -> Sweep | None:
    """The result that the output file holds; None when there is no such file."""
    if not output.exists():
        return None
    remedy = 'delete it, or pass another --output'
    try:
        existing = Sweep.load(output)
    except RecordingError as error:
        raise RecordingError(str(output), 'exists and holds no sweep', remedy) from error
    if existing.specification != plan.specification():
        text = difference(existing.specification, plan.specification())
        raise RecordingError(str(output), f'holds another sweep ({text})', remedy)
    if plan.keep_runs and existing.run_mean_speed is None:
        raise RecordingError(str(output), 'holds no single runs', remedy)
    if parts_folder(output).is_dir():
        # A kill came between the result and the end of its parts.
        with suppress(RecordingError), Journal(parts_folder(output), plan.specification()) as left:
            left.delete()
    return existing


class _MissingRuns:
    """Runs the missing runs of a journal on workers."""

    def __init__(self, plan: SweepPlan, journal: Journal, progress: Progress) -> None:
        self.done = 0
        self._plan = plan
        self._journal = journal
        self._progress = progress

    def run(self, workers: Workers, notice: Callable[[str], None]) -> None:
        missing = missing_runs(self._plan, self._journal.intact_keys())
        for text in self._journal.notices:
            notice(text)
        self.done = self._plan.total_runs - sum(piece.size for piece in missing)
        self._progress(self.done, self._plan.total_runs)
        if not missing:
            return
        # One run to compile or load the code, one to see how long a run takes. The last point
        # is the most elastic one of most grids, with the most collisions.
        first, last = missing[0].first, missing[-1].last - 1
        self._keep(first, cool(_part(self._plan, first)))
        begin = time.perf_counter()
        part = cool(_part(self._plan, last))
        seconds = time.perf_counter() - begin
        if last > first:
            self._keep(last, part)
        missing = missing_runs(self._plan, self._journal.keys())
        size = _task_size(self._plan, sum(piece.size for piece in missing), seconds, workers)
        tasks = {piece.key: piece for piece in missing for piece in divided(piece, size)}
        with closing(as_completed(cool, tasks, workers)) as results:
            for key, part in results:
                self._keep(tasks[key].first, part)

    def kept(self) -> str:
        return (
            f'{self.done} of {self._plan.total_runs} runs are kept in {self._journal.folder}; the '
            'same command goes on from there'
        )

    def _keep(self, first: int, part: Arrays) -> None:
        size = len(part[COUNTS[0]])
        self._journal.write(f'{first}-{first + size}', part)
        self.done += size
        self._progress(self.done, self._plan.total_runs)


def _part(plan: SweepPlan, run: int) -> RunRange:
    return RunRange(plan=plan, first=run, last=run + 1)


def _task_size(plan: SweepPlan, runs: int, seconds: float, workers: Workers) -> int:
    size = min(workers.task_seconds / max(seconds, 1e-6), _MAX_NUMBERS / len(plan.times))
    if workers.scheduler is None:
        # A task for every process.
        size = min(size, runs / workers.count)
    return max(1, math.ceil(size))


def assemble(plan: SweepPlan, journal: Journal) -> Sweep:
    """Assemble the result from the finished parts.

    Parameters
    ----------
    plan : SweepPlan
    journal : Journal
        Of a finished plan.

    Raises
    ------
    RecordingError
        When a part is missing or cannot be read.
    """
    arrays: dict[str, Any] = {}
    curve = (*plan.shape, len(plan.times))
    for name in SPEEDS:
        arrays[name], arrays[f'{name}_error'] = np.empty(curve), np.empty(curve)
        if plan.keep_runs:
            arrays[f'run_{name}'] = np.empty((*plan.shape, plan.runs, len(plan.times)))
    for name in COUNTS:
        arrays[name] = np.empty(plan.shape, dtype=np.int64)
    for point, runs in enumerate(points_in_order(plan, journal)):
        index = np.unravel_index(point, plan.shape)
        for name in SPEEDS:
            arrays[name][index], arrays[f'{name}_error'][index] = _mean(runs[name])
            if plan.keep_runs:
                arrays[f'run_{name}'][index] = runs[name]
        for name in COUNTS:
            arrays[name][index] = runs[name].sum()
    return Sweep(
        axes=plan.axes,
        times=np.array(plan.times),
        runs=plan.runs,
        specification=plan.specification(),
        **arrays,
    )


def _mean(runs: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and its standard error of (n_runs, n_times), added up run by run."""
    # Not ndarray.sum: the order of its additions, and with it the last digit, depends on the
    # shape of the array and on the machine.
    count = len(runs)
    mean = np.zeros(runs.shape[1])
    for run in runs:
        mean += run
    mean /= count
    squares = np.zeros(runs.shape[1])
    for run in runs:
        squares += (run - mean) ** 2
    if count == 1:
        return mean, np.full_like(mean, np.nan)
    return mean, np.sqrt(squares / (count - 1) / count)
