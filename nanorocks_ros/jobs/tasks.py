"""Independent tasks in parallel: in processes of this machine, or on a Dask cluster.

Tasks finish in any order, but their results must not depend on it. The caller adds up results, in
the order of the tasks.
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

    from nanorocks_ros.jobs.progress import Progress

Argument = TypeVar('Argument')
Result = TypeVar('Result')


@dataclass(frozen=True, slots=True, kw_only=True)
class Workers:
    """Processes or cluster that run tasks.

    Parameters
    ----------
    processes : int or None, > 0
        On this machine; None: one for each core this process may use; 1: this process itself.
    scheduler : str or None
        Address of a Dask scheduler, ``tcp://host:port``, whose workers run the tasks.
    task_seconds : float, [s], > 0
        Approximate length of a task where work can be divided freely: an interruption loses the
        running tasks, and each task has an overhead of some milliseconds.

    Raises
    ------
    ConfigurationError
        For fewer than 1 process, both processes and a scheduler, or a time that is not positive.
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
        """Raise for a cluster that cannot be used, before any work is done.

        Raises
        ------
        NanorocksError
            See `dask_cluster.check_cluster`.
        """
        if self.scheduler is not None:
            from nanorocks_ros.jobs.dask_cluster import check_cluster

            check_cluster(self.scheduler)

    @property
    def count(self) -> int:
        """Processes of this machine."""
        return self.processes or len(os.sched_getaffinity(0))


def as_completed(
    function: Callable[[Argument], Result], tasks: Mapping[str, Argument], workers: Workers
) -> Generator[tuple[str, Result], None, None]:
    """Yield results as tasks finish; close the generator to stop the work.

    Parameters
    ----------
    function : callable
        Takes one argument; must be importable on the workers, which receive only its name.
    tasks : mapping of str to picklable objects
        Arguments by key.
    workers : Workers
        Processes of this machine import the main module again: a script must start its work
        under ``if __name__ == '__main__'``.

    Yields
    ------
    key, result

    Raises
    ------
    NanorocksError
        When workers die repeatedly, or the cluster cannot be used.
    Exception
        Raised by a task.
    """
    if not tasks:
        return
    if workers.scheduler is not None:
        from nanorocks_ros.jobs.dask_cluster import run_on_cluster

        yield from run_on_cluster(function, tasks, workers.scheduler)
    elif workers.count == 1:
        for key, argument in tasks.items():
            yield key, function(argument)
    else:
        from nanorocks_ros.jobs.worker_processes import run_in_processes

        yield from run_in_processes(function, tasks, min(workers.count, len(tasks)))


def as_completed_isolated(
    function: Callable[[Argument], Result],
    tasks: Mapping[str, Argument],
    workers: Workers,
    lost: Callable[[str, str], Result],
) -> Generator[tuple[str, Result], None, None]:
    """As `as_completed`, but a task that kills its worker does not stop the others.

    Parameters
    ----------
    function, tasks, workers
        As for `as_completed`; one process means a worker process, not this one.
    lost : callable
        Returns the result of a task that killed its worker, from its key and the reason.

    Yields
    ------
    key, result

    Raises
    ------
    NanorocksError
        When the cluster cannot be used.
    Exception
        Raised by a task.
    """
    if not tasks:
        return
    if workers.scheduler is not None:
        from nanorocks_ros.jobs.dask_cluster import run_on_cluster

        yield from run_on_cluster(function, tasks, workers.scheduler, lost)
    else:
        from nanorocks_ros.jobs.worker_processes import run_isolated

        yield from run_isolated(function, tasks, workers.count, lost)


def run_tasks(
    function: Callable[[Argument], Result],
    tasks: Mapping[str, Argument],
    workers: Workers,
    progress: Progress | None = None,
) -> list[Result]:
    """Run tasks; return the results in the order of the tasks.

    Parameters
    ----------
    function, tasks, workers
        As for `as_completed`.
    progress : callable, optional
        Called with the number of finished tasks and the number of tasks.

    Raises
    ------
    NanorocksError
        When workers die repeatedly, or the cluster cannot be used.
    Exception
        Raised by a task.
    """
    results_by_key: dict[str, Result] = {}
    with closing(as_completed(function, tasks, workers)) as results:
        for key, result in results:
            results_by_key[key] = result
            if progress is not None:
                progress(len(results_by_key), len(tasks))
    return [results_by_key[key] for key in tasks]
