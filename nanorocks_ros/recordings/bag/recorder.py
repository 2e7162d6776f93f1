"""A recording that is written in a thread of its own, so that no disk holds up who records.

How much can be lost: once a second what was taken goes to the disk (`BagWriter.sync`), so a kill
or a power cut costs little more than the last second. When the disk does not keep up, pictures
are left out and counted; small messages, the results, never are.
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

    from nanorocks_ros.recordings.bag.writer import OfferedTopic

_SYNC_S = 1.0
# Pictures that may wait: 20 uncompressed ones of 1080p, ten seconds of compressed ones.
_MOST_BYTES = 128 * 2**20
# A picture that is later than the one before by less is late, not part of another turn.
_LATE_NS = 1_000_000_000
_Job = tuple[str, int, 'Callable[[], bytes | object]', int]


class Recorder:
    """Takes messages, and writes them when the disk has time.

    Parameters
    ----------
    path : str or Path
        Folder to create; must not exist.
    topics : mapping of str to OfferedTopic
        By absolute name.
    metadata : mapping of str to str
        Provenance.
    most_bytes : int, [bytes]
        Of pictures that may wait.

    Attributes
    ----------
    dropped : int
        Pictures that were left out.
    written : int
        Messages written.
    problem : Exception or None
        Why nothing more is written.

    Raises
    ------
    RecordingError
        When the path exists or cannot be created.
    """

    def __init__(
        self,
        path: str | Path,
        topics: Mapping[str, OfferedTopic],
        *,
        metadata: Mapping[str, str],
        most_bytes: int = _MOST_BYTES,
    ) -> None:
        self._writer = BagWriter(path, topics, metadata=metadata)
        self._writer.__enter__()
        self._most_bytes = most_bytes
        self._jobs: deque[_Job] = deque()
        self._bytes = 0
        self._ending = False
        self._changed = threading.Condition()
        self._last_ns: int | None = None
        self._early: list[tuple[str, Callable[[], bytes | object]]] = []
        self._shift_ns = 0
        self.dropped = 0
        self.written = 0
        self.problem: Exception | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def advance(self, stamp_ns: int) -> None:
        """Tell what time it is in the recording: the stamp of the latest picture.

        Log times never go back: after a loop or a seek they go on from where they were, so that
        who reads the recording meets the pictures in the order they came.

        Parameters
        ----------
        stamp_ns : int, [ns]
        """
        last_ns = stamp_ns if self._last_ns is None else self._last_ns
        behind_ns = last_ns - (stamp_ns + self._shift_ns)
        if behind_ns > _LATE_NS:
            self._shift_ns += behind_ns
        self._last_ns = max(last_ns, stamp_ns + self._shift_ns)
        early, self._early = self._early, []
        for topic, make in early:
            self.put(topic, make)

    def put(
        self,
        topic: str,
        make: Callable[[], bytes | object],
        *,
        size: int = 0,
        wait: bool = False,
    ) -> bool:
        """Leave a message to the thread; before the first `advance` it waits for that.

        Parameters
        ----------
        topic : str
            One of the topics given at the start.
        make : callable
            Called in the thread: the message, as an object or as CDR.
        size : int, [bytes]
            Of a picture; 0 for what is never left out.
        wait : bool
            Until there is room, rather than leave the picture out.

        Returns
        -------
        bool
            Whether it was taken.
        """
        if self._last_ns is None:
            self._early.append((topic, make))
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
        return not size or not self._bytes or self._bytes + size <= self._most_bytes

    def close(self) -> None:
        """Write what waits, and the index; after a problem there is nothing left to do."""
        with self._changed:
            self._ending = True
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        try:
            self._write_all()
            self._writer.sync()
            self._writer.__exit__(None, None, None)
        # Said, or raised again, by whoever records.
        except Exception as error:
            self._writer.abandon()
            with self._changed:
                self.problem = error
                self._jobs.clear()
                self._changed.notify_all()

    def _write_all(self) -> None:
        due = time.monotonic() + _SYNC_S
        while (job := self._next(due)) is not None or not self._ending:
            if job is not None:
                self._write(job)
            if time.monotonic() >= due:
                self._writer.sync()
                due = time.monotonic() + _SYNC_S

    def _next(self, due: float) -> _Job | None:
        with self._changed:
            left = max(0.0, due - time.monotonic())
            self._changed.wait_for(lambda: bool(self._jobs) or self._ending, left)
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
