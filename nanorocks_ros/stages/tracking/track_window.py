"""The last tracks of a tray, kept in one set of arrays."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.stages.tracking.displacements import Series

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

# Room that is made at once, in beads; what is kept is moved to the front when that is full.
_ROOM = 4096


class RecentTracks:
    """Tracks up to the present, to which one picture is added at a time.

    Joining all of them anew for every speed took a third of its time.
    """

    def __init__(self) -> None:
        self._stamps: deque[int] = deque()
        self._counts: deque[int] = deque()
        self._end = 0
        # Numbers, species, and so on: the fields of a series that have an entry for each bead.
        self._columns: list[NDArray[Any]] = []

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def stamps(self) -> list[int]:
        """Of the pictures, [ns]."""
        return list(self._stamps)

    def clear(self) -> None:
        """Forget them all."""
        self._stamps.clear()
        self._counts.clear()
        self._end = 0

    def push(self, tracks: Tracks, since_ns: int) -> None:
        """Add a picture, and forget those before a stamp."""
        new: list[NDArray[Any]] = [
            tracks.ids,
            tracks.species,
            tracks.seen,
            tracks.positions + tracks.displacement,
            tracks.position_errors,
        ]
        while self._stamps and self._stamps[0] < since_ns:
            self._stamps.popleft()
            self._counts.popleft()
        self._make_room(new)
        last = self._end + tracks.ids.size
        for column, values in zip(self._columns, new, strict=True):
            column[self._end : last] = values
        self._end = last
        self._stamps.append(tracks.stamp_ns)
        self._counts.append(tracks.ids.size)

    def _make_room(self, new: list[NDArray[Any]]) -> None:
        kept, needed = sum(self._counts), len(new[0])
        if self._columns and self._end + needed <= len(self._columns[0]):
            return
        room = max(_ROOM, 3 * (kept + needed))
        old = self._columns
        self._columns = [np.empty((room, *one.shape[1:]), dtype=one.dtype) for one in new]
        for column, values in zip(self._columns, old, strict=False):
            column[:kept] = values[self._end - kept : self._end]
        self._end = kept

    def series(self, pictures: int | None = None) -> Series:
        """The last so many pictures, or all of them; there must be one."""
        first = 0 if pictures is None else max(len(self._stamps) - pictures, 0)
        counts = np.array(self._counts, dtype=np.int64)[first:]
        here = slice(self._end - int(counts.sum()), self._end)
        stamps = np.array(self._stamps, dtype=np.int64)[first:]
        ends = np.concatenate([[0], np.cumsum(counts)])
        return Series._make((stamps, ends, *(values[here] for values in self._columns)))
