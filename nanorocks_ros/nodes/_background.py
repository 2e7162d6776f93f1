"""Work that goes on in a thread of its own while the node takes the next message.

On two cores a camera of 1080p is followed only if the next frame is decoded and cut while the
trays of the last are measured. The work releases Python's lock where most of it is done (compiled
functions, OpenCV); of a whole plate the rest is too much for one lock, and the thread here only
hands it to other processes (`study.shared_pipeline`). Jobs are done one after the other, in order,
and results come back in the thread of the node: what is published does not depend on who was
faster, and nothing of ROS is touched by two threads.
"""

from __future__ import annotations

import queue
import threading
from collections import deque

# Frames that may wait: the first takes most of a second, until floor and walls are known.
_MOST_WAITING = 30
_FAREWELL_S = 1.0


class Background:
    """Does jobs in a thread.

    Parameters
    ----------
    node : NanorocksNode
    work : callable
        Called with each job, in the thread; must not touch ROS.
    take : callable
        Called with what `work` returned, in the thread of the node.
    """

    def __init__(self, node, work, take):
        self._work, self._take = work, take
        self._jobs = queue.Queue(_MOST_WAITING)
        self._done = deque()
        self._ready = node.create_guard_condition(self.hand_over)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def waiting(self):
        """Jobs that nobody has begun."""
        return self._jobs.qsize()

    def put(self, job):
        """Leave a job to the thread; waits while too many are waiting."""
        self._jobs.put(job)

    def drain(self):
        """Wait until all jobs are done, and hand over the results."""
        self._jobs.join()
        self.hand_over()

    def close(self):
        """End the thread; what still waits is not done."""
        while not self._jobs.empty():
            self._jobs.get_nowait()
            self._jobs.task_done()
        self._jobs.put(None)
        self._thread.join(_FAREWELL_S)

    def hand_over(self):
        """Pass on the results that are there, in order; an error is raised where it belongs."""
        while self._done:
            result, error = self._done.popleft()
            if error is not None:
                raise error
            self._take(result)

    def _run(self):
        while True:
            job = self._jobs.get()
            if job is None:
                return
            try:
                self._done.append((self._work(job), None))
            # Raised again in the thread of the node.
            except Exception as error:
                self._done.append((None, error))
            self._jobs.task_done()
            self._ready.trigger()
