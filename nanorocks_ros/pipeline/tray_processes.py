"""Processes beside this one that follow the trays: what each gets, does and hands back.

Tested by ``test/pipeline/test_parallel_pipeline.py``.
"""

from __future__ import annotations

import atexit
import os
import signal
import threading
import traceback
from contextlib import suppress
from dataclasses import replace
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.shared_memory import SharedMemory
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from nanorocks_ros.errors import NanorocksError
from nanorocks_ros.experiment.trays import Tray
from nanorocks_ros.pipeline.changed_settings import Part
from nanorocks_ros.pipeline.composition import OpenTrayStages, Result, TrayStages, Wanted
from nanorocks_ros.pipeline.warm_up import warm_up_clusters, warm_up_cooling, warm_up_speed
from nanorocks_ros.records import TrayImage
from nanorocks_ros.settings import PipelineSettings

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from multiprocessing.connection import Connection

    from numpy.typing import NDArray

TrayRecords = dict[int, tuple[Result, ...]]
"""Records of each tray, by its number."""

StageInputs = tuple[PipelineSettings, tuple[Tray, ...]]
"""Settings and trays of which new stages are made."""

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_NO_PIXELS = np.empty((0, 0), dtype=np.uint8)


class _Place(NamedTuple):
    """Position of a picture in the shared memory."""

    offset: int
    shape: tuple[int, ...]


class _SentImage(NamedTuple):
    """A tray image without its pixels, and the positions of these."""

    image: TrayImage
    gray: _Place
    color: _Place | None


class _Job(NamedTuple):
    """A job for one process; see `TrayProcess.send`."""

    stages: StageInputs | None
    change: tuple[PipelineSettings, Part] | None
    images: tuple[_SentImage, ...]
    wanted: Mapping[int, Wanted]
    flush: bool


class TrayProcess:
    """One process, which starts at once and ends when this one ends, for whatever reason.

    Images are handed over in shared memory: a tenth of the time that a pipe takes. The memory is
    unlinked as soon as both have opened it, so that no file is left over.
    """

    def __init__(self) -> None:
        # Of several processes the first alone imports what all of them need.
        context = get_context('forkserver')
        context.set_forkserver_preload([__name__])
        self._connection, remote = context.Pipe()
        self._process = context.Process(target=_serve, args=(remote,), daemon=True)
        self._memory: SharedMemory | None = None
        # Started later, the resource tracker would unblock the signals.
        resource_tracker.ensure_running()
        # Ctrl-C reaches all processes of a terminal: only this one handles it.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
        try:
            self._process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        remote.close()
        atexit.register(self.close)

    @property
    def pid(self) -> int | None:
        """Process id."""
        return self._process.pid

    def ready(self) -> None:
        """Wait until all functions are compiled.

        Raises
        ------
        NanorocksError
            When the process ended.
        """
        self._answer()

    def send(
        self,
        images: Sequence[TrayImage] = (),
        wanted: Mapping[int, Wanted] | None = None,
        *,
        stages: StageInputs | None = None,
        change: tuple[PipelineSettings, Part] | None = None,
        flush: bool = False,
    ) -> None:
        """Send a job; `answer` must be called before the next one.

        Parameters
        ----------
        images : sequence of TrayImage
            To be measured.
        wanted : mapping of int to Wanted
            By number of the tray.
        stages : (PipelineSettings, tuple of Tray), optional
            Make new stages first.
        change : (PipelineSettings, Part), optional
            See `TrayStages.adopt`.
        flush : bool
            Answer with the records that are held back.

        Raises
        ------
        NanorocksError
            When the process ended.
        """
        job = _Job(stages, change, tuple(self._packed(images)), wanted or {}, flush)
        try:
            self._connection.send(job)
        except OSError as error:
            raise self._ended() from error

    def answer(self) -> TrayRecords:
        """The records of the job; an error in the process is raised here."""
        records, error = self._answer()
        if error is not None:
            raise error
        return records

    def kill(self) -> None:
        """End the process, also in the middle of a job; `close` waits for that."""
        self._process.kill()

    def close(self) -> None:
        """End the process, and wait until it has ended."""
        atexit.unregister(self.close)
        self.kill()
        self._process.join()
        if self._memory is not None:
            # Another thread may be about to write.
            with suppress(BufferError):
                self._memory.close()

    def _answer(self) -> tuple[TrayRecords, Exception | None]:
        try:
            answer: tuple[TrayRecords, Exception | None] = self._connection.recv()
        except (EOFError, OSError) as error:
            raise self._ended() from error
        return answer

    def _ended(self) -> NanorocksError:
        self._process.join(1.0)
        return NanorocksError(
            'pipeline',
            f'a process that measures trays ended (exit code {self._process.exitcode})',
            'see the messages before; set workers: 0 to do without processes',
        )

    def _packed(self, images: Sequence[TrayImage]) -> list[_SentImage]:
        pictures = [
            pixels
            for image in images
            for pixels in (image.gray, image.color)
            if pixels is not None
        ]
        self._make_room(sum(picture.nbytes for picture in pictures))
        offset, packed = 0, []
        for image in images:
            gray, offset = self._written(image.gray, offset)
            color = None
            if image.color is not None:
                color, offset = self._written(image.color, offset)
            packed.append(_SentImage(replace(image, gray=_NO_PIXELS, color=None), gray, color))
        return packed

    def _written(self, pixels: NDArray[np.uint8], offset: int) -> tuple[_Place, int]:
        assert self._memory is not None
        np.ndarray(pixels.shape, np.uint8, self._memory.buf, offset)[...] = pixels
        return _Place(offset, pixels.shape), offset + pixels.nbytes

    def _make_room(self, size: int) -> None:
        if size == 0 or (self._memory is not None and self._memory.size >= size):
            return
        if self._memory is not None:
            self._memory.close()
        self._memory = SharedMemory(create=True, size=size)
        try:
            self._connection.send(self._memory.name)
            self._answer()
        except OSError as error:
            raise self._ended() from error
        finally:
            self._memory.unlink()


def _serve(connection: Connection) -> None:
    """Do jobs, one after the other, until the connection is closed."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    # The other cores are used by other processes.
    cv2.setNumThreads(1)
    warm_up_speed()
    warm_up_clusters()
    warm_up_cooling()
    connection.send(({}, None))
    worker = _Worker()
    while True:
        try:
            job = connection.recv()
        except EOFError:
            return
        answer: tuple[TrayRecords, Exception | None]
        try:
            answer = worker.take(job), None
        except NanorocksError as error:
            answer = {}, error
        # Raised again in the main process, where the traceback of this one would be lost.
        except Exception:
            answer = {}, RuntimeError(traceback.format_exc())
        connection.send(answer)


def _end_with_parent() -> None:
    """End this process with its parent, also in the middle of a job or a compilation."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


class _Worker:
    """The stages of some trays."""

    def __init__(self) -> None:
        self._trays: dict[int, TrayStages | OpenTrayStages] = {}
        self._memory: SharedMemory | None = None

    def take(self, job: str | _Job) -> TrayRecords:
        """Do a job, or use the shared memory of this name from now on."""
        if isinstance(job, str):
            self._memory = SharedMemory(job)
            return {}
        if job.stages is not None:
            settings, trays = job.stages
            self._trays = {tray.number: TrayStages.of(settings, tray) for tray in trays}
        if job.change is not None:
            for tray_stages in self._trays.values():
                tray_stages.adopt(*job.change)
        for number, wanted in job.wanted.items():
            self._trays[number].emit(wanted)
        records: TrayRecords = {}
        for image, gray, color in job.images:
            complete = replace(
                image,
                gray=self._pixels(gray),
                color=None if color is None else self._pixels(color),
            )
            records[image.tray] = self._trays[image.tray].push(complete)
        if job.flush:
            records = {number: tray.flush() for number, tray in self._trays.items()}
        return records

    def _pixels(self, place: _Place) -> NDArray[np.uint8]:
        """A copy: stages keep images, and the next ones are written to the same position."""
        assert self._memory is not None
        return np.ndarray(place.shape, np.uint8, self._memory.buf, place.offset).copy()
