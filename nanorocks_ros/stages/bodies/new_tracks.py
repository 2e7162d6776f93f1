"""Tracks that begin within a cycle: how often, and which are of beads that were found twice."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

# Sums of radii within which a bead that was not there before is the one that was.
_WITHIN = 0.8
# A rate is not asked over less, [s].
_LEAST_TIME = 1.0


class Births:
    """Follows which beads were not there before."""

    def __init__(self) -> None:
        # In this cycle, and before that.
        self._seen: set[int] = set()
        self._known: set[int] = set()
        self._twice: set[tuple[int, int]] = set()
        self._count = 0
        self._last: NDArray[np.int64] | None = None

    def next_cycle(self) -> None:
        """Count anew, and forget beads that were not there in the whole cycle that is over."""
        self._count = 0
        self._twice = {pair for pair in self._twice if self._seen.issuperset(pair)}
        self._known = self._seen
        self._seen = set()
        self._last = None

    def push(self, tracks: Tracks, ids: NDArray[np.int64]) -> None:
        """Take the next picture, with the numbers of its beads, (n,)."""
        if ids is self._last:
            return
        self._last = ids
        numbers = ids.tolist()
        self._seen.update(numbers)
        if self._known.issuperset(numbers):
            return
        fresh = [row for row, number in enumerate(numbers) if number not in self._known]
        if self._known:
            self._count += len(fresh)
            for row in fresh:
                apart = np.hypot(*(tracks.positions - tracks.positions[row]).T)
                near = apart < _WITHIN * (tracks.radii + tracks.radii[row])
                here = numbers[row]
                self._twice |= {
                    (min(here, other), max(here, other))
                    for other in ids[near].tolist()
                    if other != here
                }
        self._known.update(numbers)

    def one_bead(self, pair: tuple[int, int]) -> bool:
        """Whether one of a pair appeared over the other: most likely a bead found twice.

        An uneven bead often is, and then the two stay together for as long as anything does.
        """
        return (min(pair), max(pair)) in self._twice

    def rate(self, time: float) -> float:
        """Tracks that began in a second of this cycle, [1/s], so long after its start, [s]."""
        return self._count / max(time, _LEAST_TIME)
