"""Runs of a sweep as tasks, and as parts of its result.

Tested by ``test/studies/sweeps/test_sweep_runs.py``.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import RecordingError, SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from nanorocks_ros.jobs.journal import Journal
    from nanorocks_ros.outputs.npz_archive import Arrays
    from nanorocks_ros.studies.sweeps.sweep_plan import SweepPlan

SPEEDS = ('mean_speed', 'mean_projected_speed')
COUNTS = ('pair_collisions', 'wall_collisions')


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRange:
    """A task: some consecutive runs of a sweep, counted through all points of its grid."""

    plan: SweepPlan
    first: int
    last: int

    @property
    def key(self) -> str:
        """Key of the part with these runs."""
        return f'{self.first}-{self.last}'

    @property
    def size(self) -> int:
        """Number of runs."""
        return self.last - self.first


def _ranges(keys: Iterable[str]) -> list[tuple[int, int, str]]:
    """First and last run of parts, and their keys, in order."""
    ranges = []
    for key in keys:
        first, last = key.split('-')
        ranges.append((int(first), int(last), key))
    return sorted(ranges)


def missing_runs(plan: SweepPlan, keys: Iterable[str]) -> list[RunRange]:
    """Ranges of runs that no part holds.

    Parameters
    ----------
    plan : SweepPlan
    keys : iterable of str
        Keys of the existing parts.
    """
    gaps = []
    end = 0
    for first, last, _ in [*_ranges(keys), (plan.total_runs, plan.total_runs, '')]:
        if first > end:
            gaps.append(RunRange(plan=plan, first=end, last=first))
        end = max(end, last)
    return gaps


def divided(whole: RunRange, size: int) -> Iterator[RunRange]:
    """Split a range into tasks of at most `size` runs."""
    for first in range(whole.first, whole.last, size):
        yield RunRange(plan=whole.plan, first=first, last=min(first + size, whole.last))


def check_points(plan: SweepPlan) -> None:
    """Raise for settings that are incompatible at a point of the grid, before any work.

    Raises
    ------
    SimulationError
        Names the first such point.
    """
    from nanorocks_ros.simulation.initial_state import rules_of

    for point in range(plan.points):
        with _point_named_in_error(plan, point):
            rules_of(*plan.point(point))


@contextmanager
def _point_named_in_error(plan: SweepPlan, point: int) -> Iterator[None]:
    try:
        yield
    except SimulationError as error:
        raise SimulationError(plan.name(point) or error.where, error.what, error.do) from error


def cool(task: RunRange) -> Arrays:
    """Simulate some runs of a sweep.

    Parameters
    ----------
    task : RunRange

    Returns
    -------
    dict of str to ndarray
        ``mean_speed`` and ``mean_projected_speed`` (n_runs, n_times), [m/s];
        ``pair_collisions`` and ``wall_collisions`` (n_runs,).

    Raises
    ------
    SimulationError
        When the gas cannot be prepared or simulated; names the point of the grid.
    """
    from nanorocks_ros.simulation.ensemble import cooling_runs

    plan = task.plan
    pieces = []
    for point in range(task.first // plan.runs, (task.last - 1) // plan.runs + 1):
        settings, tray = plan.point(point)
        start = point * plan.runs
        first, last = max(task.first - start, 0), min(task.last - start, plan.runs)
        numbers = plan.run_numbers(point, first, last)
        with _point_named_in_error(plan, point):
            pieces.append(cooling_runs(settings, tray, np.array(plan.times), numbers))
    return {
        name: np.concatenate([getattr(piece, name) for piece in pieces])
        for name in (*SPEEDS, *COUNTS)
    }


def points_in_order(plan: SweepPlan, journal: Journal) -> Iterator[Arrays]:
    """Yield the runs of each point; only these and one part are in memory.

    Parameters
    ----------
    plan : SweepPlan
    journal : Journal
        Of a finished plan.

    Yields
    ------
    dict of str to ndarray
        As `cool` returns them.

    Raises
    ------
    RecordingError
        When a part is missing or cannot be read.
    """
    keys = journal.keys()
    if missing_runs(plan, keys):
        raise RecordingError(str(journal.folder), 'parts have gone', 'give the same command again')
    pieces: list[Arrays] = []
    count = end = 0
    for first, last, key in _ranges(keys):
        part = journal.read(key)
        # Parts overlap where the runs of a damaged one were divided differently.
        pieces.append({name: array[max(end - first, 0) :] for name, array in part.items()})
        count += max(last - max(first, end), 0)
        end = max(end, last)
        if count < plan.runs:
            continue
        joined = {name: np.concatenate([piece[name] for piece in pieces]) for name in part}
        whole = count - count % plan.runs
        for start in range(0, whole, plan.runs):
            yield {name: array[start : start + plan.runs] for name, array in joined.items()}
        pieces = [{name: array[whole:] for name, array in joined.items()}]
        count -= whole
