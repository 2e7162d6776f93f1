"""The last frames of a tray, to date when two beads began to stick."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.stages.bodies.touching_pairs import MAX_DISTANCE

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from nanorocks_ros.stages.bodies.bonds import Bond

# Time over which frames are kept, [s].
_MAX_AGE = 10.0
# Consecutive frames without the separation of a bond that end the search for its start.
_MAX_MISSES = 2


class BodyFrame(NamedTuple):
    """Beads of one frame.

    Parameters
    ----------
    time : float, [s]
    stamp_ns : int
    ids : ndarray of int64, (n,)
        Numbers of the visible beads, ascending.
    positions : ndarray (n, 2), [m]
    radii : ndarray (n,), [m]
    known_ids : frozenset of int
        Numbers of the visible and of the occluded beads.
    attached : tuple of (int, int)
        Reappearing beads, each with the nearest bead of its body.
    """

    time: float
    stamp_ns: int
    ids: NDArray[np.int64]
    positions: NDArray[np.float64]
    radii: NDArray[np.float64]
    known_ids: frozenset[int]
    attached: tuple[tuple[int, int], ...]


class FrameHistory:
    """The frames of the last 10 s."""

    def __init__(self) -> None:
        self._frames: deque[BodyFrame] = deque()

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def last(self) -> BodyFrame:
        """The newest frame; there must be one."""
        return self._frames[-1]

    def push(self, frame: BodyFrame) -> None:
        """Add a frame, and forget those older than 10 s."""
        self._frames.append(frame)
        while frame.time - self._frames[0].time > _MAX_AGE:
            self._frames.popleft()

    def start_of(self, bond: Bond) -> float:
        """Time since which the separation of a bond is constant, [s].

        The frames are searched backwards from the start that the bond states. A short jump of a
        track does not end the search.
        """
        start, misses = bond.start, 0
        for frame in reversed(self._frames):
            if frame.time >= bond.start:
                continue
            if _has_separation(frame, bond):
                start, misses = frame.time, 0
            else:
                misses += 1
            if misses > _MAX_MISSES:
                break
        return start

    def touching_since(
        self, start: float, bodies: Callable[[float], tuple[frozenset[int], frozenset[int]]]
    ) -> float:
        """Time since which some beads of two bodies may touch in the image, [s].

        Bodies that turn show other beads beside each other than those that met.

        Parameters
        ----------
        start : float, [s]
            The frames are searched backwards from here. A short jump of a track, or beads that
            are hidden for a frame or two, do not end the search.
        bodies : callable
            The beads of both bodies at a time. The search ends where they are one body, or single
            beads, whose own separation says when they met.
        """
        earliest, misses = start, 0
        for frame in reversed(self._frames):
            if frame.time >= start:
                continue
            if _may_touch(frame, *bodies(frame.time)):
                earliest, misses = frame.time, 0
            else:
                misses += 1
            if misses > _MAX_MISSES:
                break
        return earliest


def _may_touch(frame: BodyFrame, first_body: frozenset[int], second_body: frozenset[int]) -> bool:
    """Whether a visible bead of one body may touch one of another."""
    if first_body == second_body or len(first_body) == len(second_body) == 1:
        return False
    first, second = (np.isin(frame.ids, list(body)) for body in (first_body, second_body))
    separations = frame.positions[first][:, np.newaxis] - frame.positions[second]
    reach = MAX_DISTANCE * (frame.radii[first][:, np.newaxis] + frame.radii[second])
    return bool((np.linalg.norm(separations, axis=-1) < reach).any())


def _has_separation(frame: BodyFrame, bond: Bond) -> bool:
    """Whether both beads are visible at the offset of the bond."""
    rows = np.searchsorted(frame.ids, bond.ids)
    if rows.max() >= frame.ids.size or (frame.ids[rows] != bond.ids).any():
        return False
    separation = frame.positions[rows[1]] - frame.positions[rows[0]]
    return bool(np.abs(separation - bond.offset).max() < bond.tolerance)
