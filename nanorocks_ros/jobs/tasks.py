"""Many independent tasks at once: in processes of this machine, or on a Dask cluster.

The order in which tasks end depends on the machines; what they return must not. Nothing here
adds up results: that is done by the caller, in the order of the tasks.
"""

from __future__ import annotations

import math
import os
from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Mapping

Argument = TypeVar('Argument')
Result = TypeVar('Result')


@dataclass(frozen=True, slots=True, kw_only=True)
class Workers:
    """Who does the work.

    Parameters
    ----------
    processes : int or None, > 0
        On this machine; None takes all cores this process may use. One means this process.
    scheduler : str or None
        Address of a Dask scheduler, ``tcp://host:port``; its workers do the work instead.
    task_seconds : float, [s], > 0
        About how much work to put into one task where work can be divided at will: no less is
        lost by an interruption, and each task costs some milliseconds.

    Raises
    ------
    ConfigurationError
        For a number of processes below 1, or both, or a time that cannot be used.
    """

    processes: int | None = None
    scheduler: str | None = None
    task_seconds: float = 1.0

    def __post_init__(self) -> None:
        if self.processes is not None and self.processes < 1:
            raise ConfigurationError('--workers', f'{self.processes}', 'give 1 or more')
        if self.processes is not None and self.scheduler is not None:
            raise ConfigurationError(
                '--workers', 'counts processes of this machine', 'leave it out with --scheduler'
            )

        if not (math.isfinite(self.task_seconds) and self.task_seconds > 0.0):
            raise ConfigurationError(
                '--task-seconds', f'{self.task_seconds}', 'give a time above 0'
            )

    def check(self) -> None:
        """Refuse a cluster that cannot be used, before any work is done.

        Raises
        ------
        NanorocksError
            See `cluster.check_cluster`.
        """
        if self.scheduler is not None:
            from nanorocks_ros.jobs.dask_cluster import check_cluster

            check_cluster(self.scheduler)

    @property
    def count(self) -> int:
        """Processes of this machine."""
        return self.processes or len(os.sched_getaffinity(0))


def as_finished(
    function: Callable[[Argument], Result], tasks: Mapping[str, Argument], workers: Workers
) -> Generator[tuple[str, Result], None, None]:
    """Results as they come; close the generator to stop the work.

    Parameters
    ----------
    function : callable
        Of one argument; importable on the workers, which get its name only.
    tasks : mapping of str to picklable objects
        Arguments by key.
    workers : Workers
        Processes on this machine import the main module anew: a script has to start its work
        under ``if __name__ == '__main__'``.

    Yields
    ------
    key, result

    Raises
    ------
    NanorocksError
        When workers end again and again, or the cluster cannot be used.
    Exception
        What a task raised.
    """
    if not tasks:
        return
    if workers.scheduler is not None:
        from nanorocks_ros.jobs.dask_cluster import finished_on_cluster

        yield from finished_on_cluster(function, tasks, workers.scheduler)
    elif workers.count == 1:
        for key, argument in tasks.items():
            yield key, function(argument)
    else:
        from nanorocks_ros.jobs.worker_processes import finished_in_processes

        yield from finished_in_processes(function, tasks, min(workers.count, len(tasks)))


def as_finished_apart(
    function: Callable[[Argument], Result],
    tasks: Mapping[str, Argument],
    workers: Workers,
    lost: Callable[[str, str], Result],
) -> Generator[tuple[str, Result], None, None]:
    """As `as_finished`, but a task that kills its worker is that task's concern alone.

    Parameters
    ----------
    function, tasks, workers
        As for `as_finished`; a single process of this machine is another one than this.
    lost : callable
        Makes, of a key and what happened, the result of a task whose worker ended under it.

    Yields
    ------
    key, result

    Raises
    ------
    NanorocksError
        When the cluster cannot be used.
    Exception
        What a task raised.
    """
    if not tasks:
        return
    if workers.scheduler is not None:
        from nanorocks_ros.jobs.dask_cluster import finished_on_cluster

        yield from finished_on_cluster(function, tasks, workers.scheduler, lost)
    else:
        from nanorocks_ros.jobs.worker_processes import finished_apart

        yield from finished_apart(function, tasks, workers.count, lost)


def run_tasks(
    function: Callable[[Argument], Result],
    tasks: Mapping[str, Argument],
    workers: Workers,
    progress: Callable[[int, int], None] | None = None,
) -> list[Result]:
    """Results in the order of the tasks.

    Parameters
    ----------
    function, tasks, workers
        As for `as_finished`.
    progress : callable, optional
        Called with the tasks done and the tasks there are.

    Raises
    ------
    NanorocksError
        When workers end again and again, or the cluster cannot be used.
    Exception
        What a task raised.
    """
    found: dict[str, Result] = {}
    with closing(as_finished(function, tasks, workers)) as results:
        for key, result in results:
            found[key] = result
            if progress is not None:
                progress(len(found), len(tasks))
    return [found[key] for key in tasks]
