"""A thread that works while the node takes the next message.

On two cores a camera of 1080p is followed only if the next frame is decoded and cut while the
trays of the last one are measured. Most of that work releases Python's lock (compiled functions,
OpenCV). For a whole plate the rest is too much for one lock, and the thread only passes the work
on to other processes (`pipeline.parallel_pipeline`). Jobs are done one after the other, in order,
and results come back in the thread of the node: what is published does not depend on timing, and
only one thread calls ROS.
"""

from __future__ import annotations

import queue
import threading
from collections import deque
from concurrent.futures import Future
from contextlib import suppress
from typing import TYPE_CHECKING, Generic, TypeVar

from rclpy.exceptions import InvalidHandle

if TYPE_CHECKING:
    from collections.abc import Callable

    from rclpy.node import Node

Job = TypeVar('Job')
Result = TypeVar('Result')

# Frames that may wait: the first takes most of a second, until floor and walls are known.
_MAX_WAITING = 30
_CHECK_S = 0.05


class BackgroundWorker(Generic[Job, Result]):
    """Does jobs in a thread.

    Parameters
    ----------
    node : rclpy.node.Node
    work : callable
        Called with each job, in the thread; must not touch ROS.
    deliver : callable
        Called with each result of `work`, in the thread of the node.

    Attributes
    ----------
    interrupted : bool
        Whether the node is to end, so that no more jobs are taken; a signal handler may set it.
    """

    def __init__(
        self, node: Node, work: Callable[[Job], Result], deliver: Callable[[Result], object]
    ) -> None:
        self._work, self._deliver = work, deliver
        self._jobs: queue.Queue[Job | None] = queue.Queue(_MAX_WAITING)
        self._done: deque[Future[Result]] = deque()
        self._closed = False
        self.interrupted = False
        self._ready = node.create_guard_condition(self.deliver_results)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def waiting(self) -> int:
        """Jobs that have not begun."""
        return self._jobs.qsize()

    def put(self, job: Job) -> None:
        """Add a job; waits while 30 are waiting, unless the node is interrupted meanwhile."""
        while not self.interrupted:
            with suppress(queue.Full):
                self._jobs.put(job, timeout=_CHECK_S)
                return

    def drain(self) -> None:
        """Wait until all jobs are done, and deliver the results."""
        self._jobs.join()
        self.deliver_results()

    def close(self) -> None:
        """Leave out the jobs that wait, and end the thread after the job that it is at.

        Does not wait for that: a node that ends has the processor for itself, as far as it can.
        """
        self._closed = True
        with suppress(queue.Empty):
            while True:
                self._jobs.get_nowait()
                self._jobs.task_done()
        self._jobs.put(None)

    def deliver_results(self) -> None:
        """Deliver the results so far, in order; an error of `work` is raised here."""
        while self._done:
            self._deliver(self._done.popleft().result())

    def _run(self) -> None:
        while True:
            job = self._jobs.get()
            if job is None:
                return
            outcome: Future[Result] = Future()
            try:
                outcome.set_result(self._work(job))
            # Raised again in the thread of the node.
            except Exception as error:
                outcome.set_exception(error)
            self._done.append(outcome)
            self._jobs.task_done()
            if self._closed:
                return
            # The node may be destroyed meanwhile.
            with suppress(InvalidHandle):
                self._ready.trigger()
