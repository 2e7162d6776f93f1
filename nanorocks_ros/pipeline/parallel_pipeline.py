"""The stages of a pipeline with the work behind the tray images shared out among processes."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.pipeline.composition import Pipeline, trays_of
from nanorocks_ros.pipeline.tray_processes import TrayProcess
from nanorocks_ros.records import CorEstimate, TrayImage

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.experiment.view import View
    from nanorocks_ros.pipeline.composition import Result, Wanted
    from nanorocks_ros.pipeline.tray_processes import Found
    from nanorocks_ros.records import ClusterEstimate, Notice
    from nanorocks_ros.settings import PipelineSettings

# More share the work of eight trays unevenly: the slowest tray takes a quarter of it.
_MOST = 4
# Cost of a tray without beads, in beads.
_EMPTY = 20


def worker_count(wanted: int, trays: int) -> int:
    """How many processes follow the trays; 0: none but this one.

    Parameters
    ----------
    wanted : int
        As the setting says; negative: one core is left to this process, and a single tray is
        followed in a thread of it.
    trays : int
        There are.
    """
    if wanted >= 0:
        return min(wanted, trays)
    cores = len(os.sched_getaffinity(0))
    return 0 if trays == 1 else min(cores - 1, trays, _MOST)


def shares_of(trays: Sequence[Tray], workers: int) -> tuple[tuple[Tray, ...], ...]:
    """The trays that each of some workers follows: about as many beads each."""
    shares: list[list[Tray]] = [[] for _ in range(workers)]
    loads = np.zeros(workers)
    for tray in sorted(trays, key=lambda tray: -tray.count):
        least = int(np.argmin(loads))
        shares[least].append(tray)
        loads[least] += tray.count + _EMPTY
    return tuple(tuple(share) for share in shares)


class SharedPipeline(Pipeline):
    """The same stages for the same settings, and so the same records, from several cores.

    Parameters
    ----------
    settings, camera, view
        As of `Pipeline`.
    workers : sequence of TrayProcess
        At least one; their stages are made anew by `prepare`, or with the first frame.

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
        super().__init__(settings, camera, view)
        self._settings = calibrated(settings)
        self._workers = workers
        self._shares = shares_of(tuple(trays_of(self._settings).values()), len(workers))
        self._begun = False

    def prepare(self) -> None:
        """Have the stages made in the processes, which must not work for another pipeline."""
        if not self._begun:
            self._ask((), None)

    def follow(
        self, records: Sequence[TrayImage | Notice], wanted: Mapping[int, Wanted] | None = None
    ) -> tuple[Result, ...]:
        """See `Pipeline.follow`; raises NanorocksError when a process has ended."""
        images = [record for record in records if isinstance(record, TrayImage)]
        results_by_tray = self._ask(images, wanted) if images else {}
        results: list[Result] = []
        for record in records:
            results.append(record)
            if isinstance(record, TrayImage):
                results += results_by_tray[record.tray]
        return tuple(results)

    def flush(self) -> tuple[CorEstimate | ClusterEstimate, ...]:
        """See `Pipeline.flush`."""
        if not self._begun:
            return super().flush()
        results_by_tray = self._ask((), None, flush=True)
        return tuple(record for number in self.trays for record in results_by_tray[number])  # type: ignore[misc]

    def _ask(
        self,
        images: Sequence[TrayImage],
        wanted: Mapping[int, Wanted] | None,
        *,
        flush: bool = False,
    ) -> Found:
        begin, self._begun = not self._begun, True
        busy = []
        for worker, share in zip(self._workers, self._shares, strict=True):
            numbers = {tray.number for tray in share}
            worker.send(
                [image for image in images if image.tray in numbers],
                {
                    number: outputs
                    for number, outputs in (wanted or {}).items()
                    if number in numbers
                },
                begin=(self._settings, share) if begin else None,
                flush=flush,
            )
            busy.append(worker)
        results_by_tray: Found = {}
        # All are asked, also when one has met an error: none may be left with an answer.
        errors = []
        for worker in busy:
            try:
                results_by_tray |= worker.answer()
            except Exception as error:
                errors.append(error)
        if errors:
            raise errors[0]
        return results_by_tray


def started(workers: int) -> tuple[TrayProcess, ...]:
    """So many processes, all of them starting at once."""
    return tuple(TrayProcess() for _ in range(workers))
