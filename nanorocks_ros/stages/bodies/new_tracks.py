"""Tracks that begin within a cycle: their rate, and which of them are double detections."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

# A new track within this distance of another, in sums of radii, is a double detection.
_DOUBLE_DISTANCE = 0.8
# Shortest time over which a rate is taken, [s].
_MIN_TIME = 1.0


class NewTracks:
    """Counts tracks that begin within a cycle, and remembers double detections."""

    def __init__(self) -> None:
        # Tracks of this cycle, and all tracks so far.
        self._seen: set[int] = set()
        self._known: set[int] = set()
        self._doubles: set[tuple[int, int]] = set()
        self._count = 0
        self._last: NDArray[np.int64] | None = None

    def next_cycle(self) -> None:
        """Reset the count, and forget tracks that the last cycle did not contain."""
        self._count = 0
        self._doubles = {pair for pair in self._doubles if self._seen.issuperset(pair)}
        self._known = self._seen
        self._seen = set()
        self._last = None

    def push(self, tracks: Tracks, ids: NDArray[np.int64]) -> None:
        """Add the next frame, with the numbers of its beads, (n,)."""
        if ids is self._last:
            return
        self._last = ids
        numbers = ids.tolist()
        self._seen.update(numbers)
        if self._known.issuperset(numbers):
            return
        new_rows = [row for row, number in enumerate(numbers) if number not in self._known]
        if self._known:
            self._count += len(new_rows)
            for row in new_rows:
                distances = np.hypot(*(tracks.positions - tracks.positions[row]).T)
                is_near = distances < _DOUBLE_DISTANCE * (tracks.radii + tracks.radii[row])
                new = numbers[row]
                self._doubles |= {
                    (min(new, other), max(new, other))
                    for other in ids[is_near].tolist()
                    if other != new
                }
        self._known.update(numbers)

    def is_double_detection(self, pair: tuple[int, int]) -> bool:
        """Whether one track of a pair began on top of the other: most likely the same bead.

        Beads with an uneven surface are often detected twice; the two tracks stay together.
        """
        return (min(pair), max(pair)) in self._doubles

    def rate(self, time: float) -> float:
        """Tracks that began per second of this cycle, [1/s], at a time after its start, [s]."""
        return self._count / max(time, _MIN_TIME)
