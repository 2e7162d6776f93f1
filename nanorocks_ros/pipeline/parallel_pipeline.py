"""The pipeline with the trays shared out among several processes."""

from __future__ import annotations

import itertools
import os
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.pipeline.composition import Pipeline, trays_of
from nanorocks_ros.pipeline.tray_processes import TrayProcess
from nanorocks_ros.records import TrayImage

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.experiment.view import View
    from nanorocks_ros.pipeline.changed_settings import Part
    from nanorocks_ros.pipeline.composition import Result, Wanted
    from nanorocks_ros.pipeline.tray_processes import TrayRecords
    from nanorocks_ros.records import Notice
    from nanorocks_ros.settings import PipelineSettings

# Largest number of processes by default: the slowest of eight trays takes a quarter of the work.
_MAX_WORKERS = 4
# Cost of a tray without beads, in beads.
_EMPTY_TRAY_COST = 20


def worker_count(wanted: int, trays: int) -> int:
    """Number of processes for the trays; 0: the work is done in this process.

    Parameters
    ----------
    wanted : int
        The setting; negative: one core is left to this process, and a single tray is measured in
        a thread of it.
    trays : int
        Number of trays.
    """
    if wanted >= 0:
        return min(wanted, trays)
    cores = len(os.sched_getaffinity(0))
    return 0 if trays == 1 else min(cores - 1, trays, _MAX_WORKERS)


def shares_of(trays: Sequence[Tray], workers: int) -> tuple[tuple[Tray, ...], ...]:
    """Share out the trays among the workers, with about as many beads for each."""
    shares: list[list[Tray]] = [[] for _ in range(workers)]
    loads = np.zeros(workers)
    for tray in sorted(trays, key=lambda tray: -tray.count):
        lightest = int(np.argmin(loads))
        shares[lightest].append(tray)
        loads[lightest] += tray.count + _EMPTY_TRAY_COST
    return tuple(tuple(share) for share in shares)


class SharedPipeline(Pipeline):
    """The same stages for the same settings, hence the same records, on several cores.

    Parameters
    ----------
    settings, camera, view
        As of `Pipeline`.
    workers : sequence of TrayProcess
        At least one; `prepare` or the first frame makes their stages anew.

    Raises
    ------
    ConfigurationError
        When the settings cannot be used.
    """

    def __init__(
        self,
        settings: PipelineSettings,
        camera: str,
        view: View | None,
        workers: Sequence[TrayProcess],
    ) -> None:
        super().__init__(settings, camera, view, contacts_suffice=True)
        self._settings = calibrated(settings)
        self._workers = workers
        self._shares = shares_of(tuple(trays_of(self._settings).values()), len(workers))
        self._prepared = False

    def prepare(self) -> None:
        """Make the stages in the processes, which must not serve another pipeline."""
        if not self._prepared:
            self._run((), None)

    def adopt(self, settings: PipelineSettings, parts: Part) -> None:
        """See `Pipeline.adopt`."""
        super().adopt(settings, parts)
        self._settings = calibrated(settings)
        if self._prepared:
            for worker in self._workers:
                worker.send(change=(self._settings, parts))
            self._answers()

    def follow(
        self, records: Sequence[TrayImage | Notice], wanted: Mapping[int, Wanted] | None = None
    ) -> tuple[Result, ...]:
        """See `Pipeline.follow`; raises NanorocksError when a process has ended."""
        results: list[Result] = []
        # The records of a tray must follow its image: of each tray one image at a time.
        for _, of_frame in itertools.groupby(records, lambda record: record.stamp_ns):
            results += self._follow_frame(tuple(of_frame), wanted)
        return tuple(results)

    def _follow_frame(
        self, records: Sequence[TrayImage | Notice], wanted: Mapping[int, Wanted] | None
    ) -> list[Result]:
        images = [record for record in records if isinstance(record, TrayImage)]
        of_tray = self._run(images, wanted) if images else {}
        results: list[Result] = []
        for record in records:
            results.append(record)
            if isinstance(record, TrayImage):
                results += of_tray[record.tray]
        return results

    def flush(self) -> tuple[Result, ...]:
        """See `Pipeline.flush`."""
        last = self.follow(self.preprocessor.flush())
        if not self._prepared:
            return (*last, *super().flush())
        of_tray = self._run((), None, flush=True)
        return (*last, *(record for number in self.trays for record in of_tray[number]))

    def _run(
        self,
        images: Sequence[TrayImage],
        wanted: Mapping[int, Wanted] | None,
        *,
        flush: bool = False,
    ) -> TrayRecords:
        first, self._prepared = not self._prepared, True
        for worker, share in zip(self._workers, self._shares, strict=True):
            numbers = {tray.number for tray in share}
            worker.send(
                [image for image in images if image.tray in numbers],
                {number: own for number, own in (wanted or {}).items() if number in numbers},
                stages=(self._settings, share) if first else None,
                flush=flush,
            )
        return self._answers()

    def _answers(self) -> TrayRecords:
        """The records of all processes."""
        records: TrayRecords = {}
        # All answers are received, also after an error: a worker must be free for the next job.
        errors = []
        for worker in self._workers:
            try:
                records |= worker.answer()
            except Exception as error:
                errors.append(error)
        if errors:
            raise errors[0]
        return records


def started(workers: int) -> tuple[TrayProcess, ...]:
    """Start so many processes at once."""
    return tuple(TrayProcess() for _ in range(workers))
