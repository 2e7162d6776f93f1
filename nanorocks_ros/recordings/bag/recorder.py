"""Recorder that writes a bag in its own thread, so that a slow disk does not block the caller.

Data is synced to the disk once a second (`BagWriter.sync`), so a kill or a power cut loses little
more than the last second. If the disk is too slow, images are dropped and counted; small messages
(results) are never dropped.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import TYPE_CHECKING

from nanorocks_ros.errors import FrameError
from nanorocks_ros.recordings.bag.writer import BagWriter

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic

_SYNC_S = 1.0
# Largest total size of queued images: 20 uncompressed 1080p images, or 10 s of compressed ones.
_MAX_QUEUED_BYTES = 128 * 2**20
# Stamps that step back by less than this belong to late images; a larger step back is a loop or
# a seek.
_LATE_NS = 1_000_000_000
# Topic, log time, function that makes the message, size of an image.
_Job = tuple[str, int, 'Callable[[], bytes | object]', int]


class Recorder:
    """Queue messages and write them in a thread.

    Parameters
    ----------
    path : str or Path
        Folder to create; must not exist.
    topics : mapping of str to OfferedTopic
        By absolute name.
    metadata : mapping of str to str
        Provenance.
    max_queued_bytes : int, [bytes]
        Largest total size of queued images.

    Attributes
    ----------
    dropped : int
        Number of dropped images.
    written : int
        Number of written messages.
    problem : Exception or None
        The error that ended the recording.

    Raises
    ------
    RecordingError
        If the path exists or cannot be created.
    """

    def __init__(
        self,
        path: str | Path,
        topics: Mapping[str, OfferedTopic],
        *,
        metadata: Mapping[str, str],
        max_queued_bytes: int = _MAX_QUEUED_BYTES,
    ) -> None:
        self._writer = BagWriter(path, topics, metadata=metadata)
        self._writer.__enter__()
        self._max_queued_bytes = max_queued_bytes
        self._jobs: deque[_Job] = deque()
        self._bytes = 0
        self._ending = False
        self._changed = threading.Condition()
        self._last_ns: int | None = None
        self._unstamped: list[tuple[str, Callable[[], bytes | object]]] = []
        self._shift_ns = 0
        self.dropped = 0
        self.written = 0
        self.problem: Exception | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def advance(self, stamp_ns: int) -> None:
        """Set the current time of the recording: the stamp of the latest image.

        Log times never step back: after a loop or a seek they continue from the latest log time,
        so that a reader gets the images in the order of their arrival.

        Parameters
        ----------
        stamp_ns : int, [ns]
        """
        last_ns = stamp_ns if self._last_ns is None else self._last_ns
        behind_ns = last_ns - (stamp_ns + self._shift_ns)
        if behind_ns > _LATE_NS:
            self._shift_ns += behind_ns
        self._last_ns = max(last_ns, stamp_ns + self._shift_ns)
        unstamped, self._unstamped = self._unstamped, []
        for topic, make in unstamped:
            self.put(topic, make)

    def put(
        self,
        topic: str,
        make: Callable[[], bytes | object],
        *,
        size: int = 0,
        wait: bool = False,
    ) -> bool:
        """Queue a message; messages before the first `advance` get the time of that call.

        Parameters
        ----------
        topic : str
            One of the topics given to the constructor.
        make : callable
            Called in the thread; returns the message as an object or as CDR.
        size : int, [bytes]
            Size of an image; 0 for messages that are never dropped.
        wait : bool
            Wait for room in the queue instead of dropping the image.

        Returns
        -------
        bool
            Whether the message was queued.
        """
        if self._last_ns is None:
            self._unstamped.append((topic, make))
            return True
        with self._changed:
            if wait:
                self._changed.wait_for(lambda: self._has_room(size) or self.problem is not None)
            if self.problem is not None or self._ending:
                return False
            if not self._has_room(size):
                self.dropped += 1
                return False
            self._jobs.append((topic, self._last_ns, make, size))
            self._bytes += size
            self._changed.notify_all()
            return True

    def _has_room(self, size: int) -> bool:
        return not size or not self._bytes or self._bytes + size <= self._max_queued_bytes

    def close(self) -> None:
        """Write all queued messages and the index; after an error nothing is written."""
        with self._changed:
            self._ending = True
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        try:
            self._write_all()
            self._writer.sync()
            self._writer.__exit__(None, None, None)
        # The caller reads `problem` and reports or raises it.
        except Exception as error:
            self._writer.abort()
            with self._changed:
                self.problem = error
                self._jobs.clear()
                self._changed.notify_all()

    def _write_all(self) -> None:
        sync_time = time.monotonic() + _SYNC_S
        while (job := self._next_job(sync_time)) is not None or not self._ending:
            if job is not None:
                self._write(job)
            if time.monotonic() >= sync_time:
                self._writer.sync()
                sync_time = time.monotonic() + _SYNC_S

    def _next_job(self, sync_time: float) -> _Job | None:
        with self._changed:
            timeout = max(0.0, sync_time - time.monotonic())
            self._changed.wait_for(lambda: bool(self._jobs) or self._ending, timeout)
            return self._jobs.popleft() if self._jobs else None

    def _write(self, job: _Job) -> None:
        topic, log_time_ns, make, size = job
        try:
            message = make()
            if isinstance(message, bytes):
                self._writer.write_raw(topic, log_time_ns, message)
            else:
                self._writer.write(topic, log_time_ns, message)
            self.written += 1
        except FrameError:
            self.dropped += 1
        finally:
            with self._changed:
                self._bytes -= size
                self._changed.notify_all()
