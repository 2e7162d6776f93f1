"""Tasks in worker processes of this machine, which exit when their parent does.

Tested by ``test/jobs/test_tasks.py``.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from concurrent.futures import (
    FIRST_COMPLETED,
    Future,
    ProcessPoolExecutor,
    as_completed,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, closing, contextmanager
from typing import TYPE_CHECKING, Generic, TypeVar

from nanorocks_ros.errors import NanorocksError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Mapping
    from multiprocessing.connection import Connection

Argument = TypeVar('Argument')
Result = TypeVar('Result')

# Pools in a row that may break without finishing a single task.
_MAX_BROKEN_POOLS = 3
_DIED = 'its worker process was killed, perhaps for lack of memory'
# Time that an ending worker has to send its result [s].
_GRACE_PERIOD = 1.0


def run_in_processes(
    function: Callable[[Argument], Result], tasks: Mapping[str, Argument], processes: int
) -> Generator[tuple[str, Result], None, None]:
    """Yield results as tasks finish; a new worker repeats the task of a killed one.

    Parameters
    ----------
    function : callable
    tasks : mapping of str to picklable objects
    processes : int, > 0

    Yields
    ------
    key, result

    Raises
    ------
    NanorocksError
        When three pools in a row break before any task is finished.
    """
    remaining = dict(tasks)
    broken_pools = 0
    while remaining:
        remaining_before = len(remaining)
        try:
            with closing(_run_in_pool(function, dict(remaining), processes)) as results:
                for key, result in results:
                    del remaining[key]
                    yield key, result
        except BrokenProcessPool as error:
            broken_pools = broken_pools + 1 if len(remaining) == remaining_before else 0
            if broken_pools == _MAX_BROKEN_POOLS:
                raise NanorocksError(
                    'workers',
                    f'were killed {broken_pools} times in a row, perhaps for lack of memory',
                    'use fewer --workers, or a smaller task',
                ) from error


def _run_in_pool(
    function: Callable[[Argument], Result], tasks: Mapping[str, Argument], processes: int
) -> Generator[tuple[str, Result], None, None]:
    broken = None
    with _pool(processes, function) as pool:
        with _worker_environment():
            keys = {pool.submit(_run_task, function, task): key for key, task in tasks.items()}
        for future in as_completed(keys):
            try:
                result = future.result()
            except BrokenProcessPool as error:
                # Tasks that finished before the break are yielded first.
                broken = error
            else:
                yield keys[future], result
        if broken is not None:
            raise broken


@contextmanager
def _pool(processes: int, function: Callable[[Argument], Result]) -> Iterator[ProcessPoolExecutor]:
    """A pool whose workers exit with this block; tasks that have not started are cancelled."""
    # Not fork: it copies the locks of threads that numba or matplotlib may have started. The
    # server, from which workers are forked, has no threads, and imports what the first of them
    # need once for all.
    context = multiprocessing.get_context('forkserver')
    context.set_forkserver_preload([function.__module__])
    pipe_end, lifeline = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(
        processes, mp_context=context, initializer=_initialise_worker, initargs=(pipe_end,)
    )
    try:
        yield pool
    finally:
        lifeline.close()
        pool.shutdown(wait=True, cancel_futures=True)
        pipe_end.close()


def run_isolated(
    function: Callable[[Argument], Result],
    tasks: Mapping[str, Argument],
    processes: int,
    lost: Callable[[str, str], Result],
) -> Generator[tuple[str, Result], None, None]:
    """Yield results as tasks finish; a task that kills its worker does not affect the others.

    Parameters
    ----------
    function, tasks, processes
        As for `run_in_processes`.
    lost : callable
        Returns the result of a task that killed its worker, from its key and the reason.

    Yields
    ------
    key, result
    """
    with ExitStack() as stack:
        workers = _IsolatedWorkers(function, tasks, stack)
        for _ in range(min(processes, len(tasks))):
            workers.start_worker()
        while workers.running:
            for future in wait(workers.running, return_when=FIRST_COMPLETED).done:
                yield workers.collect(future, lost)


class _IsolatedWorkers(Generic[Argument, Result]):
    """Pools of one worker each: a pool that breaks identifies the task that broke it."""

    def __init__(
        self,
        function: Callable[[Argument], Result],
        tasks: Mapping[str, Argument],
        stack: ExitStack,
    ) -> None:
        self._function = function
        self._waiting = deque(tasks.items())
        self._stack = stack
        self.running: dict[Future[Result], tuple[str, ExitStack, ProcessPoolExecutor]] = {}

    def start_worker(self) -> None:
        """Start a worker on the next task, if there is one."""
        if self._waiting:
            pool_stack = self._stack.enter_context(ExitStack())
            self._submit_next(pool_stack, pool_stack.enter_context(_pool(1, self._function)))

    def _submit_next(self, pool_stack: ExitStack, pool: ProcessPoolExecutor) -> None:
        key, argument = self._waiting[0]
        try:
            with _worker_environment():
                future = pool.submit(_run_task, self._function, argument)
        except BrokenProcessPool:
            # The worker was killed between two tasks.
            pool_stack.close()
            self.start_worker()
            return
        self._waiting.popleft()
        self.running[future] = key, pool_stack, pool

    def collect(
        self, future: Future[Result], lost: Callable[[str, str], Result]
    ) -> tuple[str, Result]:
        """Key and result of a finished task; its worker, or a new one, takes the next task."""
        key, pool_stack, pool = self.running.pop(future)
        try:
            result = future.result()
        except BrokenProcessPool:
            pool_stack.close()
            self.start_worker()
            return key, lost(key, _DIED)
        if self._waiting:
            self._submit_next(pool_stack, pool)
        else:
            pool_stack.close()
        return key, result


@contextmanager
def _worker_environment() -> Iterator[None]:
    """Start processes with one BLAS thread, and with Ctrl-C blocked while they start."""
    earlier = os.environ.get('OPENBLAS_NUM_THREADS')
    os.environ['OPENBLAS_NUM_THREADS'] = '1'
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        if earlier is None:
            del os.environ['OPENBLAS_NUM_THREADS']
        else:
            os.environ['OPENBLAS_NUM_THREADS'] = earlier
        # Last: a Ctrl-C that was pressed meanwhile is raised here.
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


_task_running = threading.Lock()


def _initialise_worker(pipe_end: Connection) -> None:
    """Initialise a worker: the parent handles Ctrl-C, and ends the worker by closing the pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_exit_with_parent, args=(pipe_end,), daemon=True).start()


def _exit_with_parent(pipe_end: Connection) -> None:
    pipe_end.poll(None)
    # The parent would wait for ever for the rest of a result that was cut.
    if _task_running.acquire(blocking=False):
        time.sleep(_GRACE_PERIOD)
    os._exit(1)


def _run_task(function: Callable[[Argument], Result], argument: Argument) -> Result:
    with _task_running:
        return function(argument)
