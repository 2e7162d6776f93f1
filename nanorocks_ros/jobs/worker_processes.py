"""Tasks in processes of this machine, which end with the process that started them."""

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

# Pools in a row that end without finishing a single task.
_MOST_FRUITLESS = 3
_DIED = 'the process that worked on it was killed, for lack of memory perhaps'
# What a worker gets to hand over a result when it is told to end [s].
_GRACE = 1.0


def finished_in_processes(
    function: Callable[[Argument], Result], tasks: Mapping[str, Argument], processes: int
) -> Generator[tuple[str, Result], None, None]:
    """Results as they come. What a killed worker had in hand is done again by a new one.

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
        When the workers of three pools in a row end before any task does.
    """
    left = dict(tasks)
    fruitless = 0
    while left:
        before = len(left)
        try:
            with closing(_one_pool(function, dict(left), processes)) as results:
                for key, result in results:
                    del left[key]
                    yield key, result
        except BrokenProcessPool as error:
            fruitless = fruitless + 1 if len(left) == before else 0
            if fruitless == _MOST_FRUITLESS:
                raise NanorocksError(
                    'workers',
                    f'were killed {fruitless} times with nothing done, for lack of memory perhaps',
                    'use fewer --workers, or a smaller task',
                ) from error


def _one_pool(
    function: Callable[[Argument], Result], tasks: Mapping[str, Argument], processes: int
) -> Generator[tuple[str, Result], None, None]:
    broken = None
    with _pool(processes) as pool:
        with _born_quiet():
            keys = {pool.submit(_work, function, task): key for key, task in tasks.items()}
        for future in as_completed(keys):
            try:
                result = future.result()
            except BrokenProcessPool as error:
                # Others may have finished before: hand these over first.
                broken = error
            else:
                yield keys[future], result
        if broken is not None:
            raise broken


@contextmanager
def _pool(processes: int) -> Iterator[ProcessPoolExecutor]:
    """Workers that end with this block; nobody waits for work that is not wanted any more."""
    # Not forked: a fork copies the locks of threads that numba or matplotlib may have started.
    context = multiprocessing.get_context('spawn')
    ending, lifeline = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(
        processes, mp_context=context, initializer=_start, initargs=(ending,)
    )
    try:
        yield pool
    finally:
        lifeline.close()
        pool.shutdown(wait=True, cancel_futures=True)
        ending.close()


def finished_apart(
    function: Callable[[Argument], Result],
    tasks: Mapping[str, Argument],
    processes: int,
    lost: Callable[[str, str], Result],
) -> Generator[tuple[str, Result], None, None]:
    """Results as they come; a task that kills its worker costs no other task anything.

    Parameters
    ----------
    function, tasks, processes
        As for `finished_in_processes`.
    lost : callable
        Makes, of a key and what happened, the result of a task whose worker ended under it.

    Yields
    ------
    key, result
    """
    with ExitStack() as everything:
        lanes = _Lanes(function, tasks, everything)
        for _ in range(min(processes, len(tasks))):
            lanes.open()
        while lanes.busy:
            for future in wait(lanes.busy, return_when=FIRST_COMPLETED).done:
                yield lanes.collect(future, lost)


class _Lanes(Generic[Argument, Result]):
    """Pools of one worker each: when one breaks, it is known over what."""

    def __init__(
        self,
        function: Callable[[Argument], Result],
        tasks: Mapping[str, Argument],
        everything: ExitStack,
    ) -> None:
        self._function = function
        self._waiting = deque(tasks.items())
        self._everything = everything
        self.busy: dict[Future[Result], tuple[str, ExitStack, ProcessPoolExecutor]] = {}

    def open(self) -> None:
        """Start a worker on the next task, if there is one."""
        if self._waiting:
            lane = self._everything.enter_context(ExitStack())
            self._hand_over(lane, lane.enter_context(_pool(1)))

    def _hand_over(self, lane: ExitStack, pool: ProcessPoolExecutor) -> None:
        key, argument = self._waiting[0]
        try:
            with _born_quiet():
                future = pool.submit(_work, self._function, argument)
        except BrokenProcessPool:
            # Killed with nothing in hand: nobody's fault.
            lane.close()
            self.open()
            return
        self._waiting.popleft()
        self.busy[future] = key, lane, pool

    def collect(
        self, future: Future[Result], lost: Callable[[str, str], Result]
    ) -> tuple[str, Result]:
        """What came of a task; its worker takes the next, or another one does."""
        key, lane, pool = self.busy.pop(future)
        try:
            result = future.result()
        except BrokenProcessPool:
            lane.close()
            self.open()
            return key, lost(key, _DIED)
        if self._waiting:
            self._hand_over(lane, pool)
        else:
            lane.close()
        return key, result


@contextmanager
def _born_quiet() -> Iterator[None]:
    """Processes started here get one thread of BLAS, and no Ctrl-C while they start."""
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
        # Last: a Ctrl-C that came meanwhile is raised here.
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


_working = threading.Lock()


def _start(ending: Connection) -> None:
    """In the worker: Ctrl-C is for the parent, which tells us by closing the pipe, or dying."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_end_with, args=(ending,), daemon=True).start()


def _end_with(ending: Connection) -> None:
    ending.poll(None)
    # Cutting a result in two would leave the parent waiting for the other half.
    if _working.acquire(blocking=False):
        time.sleep(_GRACE)
    os._exit(1)


def _work(function: Callable[[Argument], Result], argument: Argument) -> Result:
    with _working:
        return function(argument)
