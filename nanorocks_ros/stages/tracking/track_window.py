"""Sliding window of the tracks of a tray, in contiguous arrays.

Tested by ``test/pipeline/test_tray_measurement.py``.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.stages.tracking.displacements import TrackSeries

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

# Smallest capacity in beads; the valid rows are moved to the front when it is exhausted.
_MIN_CAPACITY = 4096


class TrackWindow:
    """Tracks up to the present; one frame is added at a time.

    Concatenating all records for every speed took a third of its time.
    """

    def __init__(self) -> None:
        self._stamps: deque[int] = deque()
        self._counts: deque[int] = deque()
        self._displacements: deque[NDArray[np.float64]] = deque()
        self._end = 0
        # The fields of a `TrackSeries` that have an entry for each bead.
        self._columns: list[NDArray[Any]] = []

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def stamps(self) -> list[int]:
        """Stamps of the frames, [ns]."""
        return list(self._stamps)

    def clear(self) -> None:
        """Remove all frames."""
        self._stamps.clear()
        self._counts.clear()
        self._displacements.clear()
        self._end = 0

    def push(self, tracks: Tracks, since_ns: int) -> None:
        """Add a frame, and remove those before a stamp."""
        new: list[NDArray[Any]] = [
            tracks.ids,
            tracks.species,
            tracks.seen,
            tracks.positions + tracks.displacement,
            tracks.position_errors,
            tracks.radii,
        ]
        while self._stamps and self._stamps[0] < since_ns:
            self._stamps.popleft()
            self._counts.popleft()
            self._displacements.popleft()
        self._grow(new)
        last = self._end + tracks.ids.size
        for column, values in zip(self._columns, new, strict=True):
            column[self._end : last] = values
        self._end = last
        self._stamps.append(tracks.stamp_ns)
        self._counts.append(tracks.ids.size)
        self._displacements.append(tracks.displacement)

    def _grow(self, new: list[NDArray[Any]]) -> None:
        kept, needed = sum(self._counts), len(new[0])
        if self._columns and self._end + needed <= len(self._columns[0]):
            return
        capacity = max(_MIN_CAPACITY, 3 * (kept + needed))
        old = self._columns
        self._columns = [
            np.empty((capacity, *values.shape[1:]), dtype=values.dtype) for values in new
        ]
        for column, values in zip(self._columns, old, strict=False):
            column[:kept] = values[self._end - kept : self._end]
        self._end = kept

    def series(self, frames: int | None = None) -> TrackSeries:
        """The last `frames` frames, or all; there must be one."""
        first = 0 if frames is None else max(len(self._stamps) - frames, 0)
        counts = np.array(self._counts, dtype=np.int64)[first:]
        rows = slice(self._end - int(counts.sum()), self._end)
        stamps = np.array(self._stamps, dtype=np.int64)[first:]
        ends = np.concatenate([[0], np.cumsum(counts)])
        displacements = np.array(self._displacements)[first:]
        columns = (values[rows] for values in self._columns)
        return TrackSeries._make((stamps, ends, *columns, displacements))
