"""Frames that are missing although the time stamps do not show it.

Where a recorder loses a frame and gives the others even stamps, all beads move by two steps in the
time of one. Beads collide one by one, so that nothing else makes all of them fast for one step.

Tested by ``test/stages/speed/test_skipped_frames.py``.
"""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.median import median_of
from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

# Shortest median step that is compared with its neighbours: places are known to 0.05 to 0.1 px.
_SHORTEST_STEP_PX = 0.5
# A step is looked at where its median is so many times those before and after it.
_SUSPECT = 1.5
# A bead is in free flight where the steps before and after differ by at most this share of both.
_STRAIGHT = 0.25
# Beads in free flight that tell, and the share of them that must agree on a whole number of steps.
_FEWEST_BEADS, _AGREEING, _WHOLE = 4, 0.75, 0.3
# Steps that are looked at, at least, and the share of missing ones from which on speeds are
# flagged: with every 37th frame lost, restitutions of three films were right, with every tenth
# that of the beads was 0.08 too high in one.
_FEWEST_STEPS, _FLAGGED_SHARE = 30, 0.04


class _Step(NamedTuple):
    """Velocities of the beads between two successive frames.

    Parameters
    ----------
    ids : ndarray of int, (n,)
    velocities : ndarray (n, 2), [m/s]
    median : float, [m]
        Of the lengths of the steps.
    speed : float, [m/s]
        Median.
    """

    ids: NDArray[np.int32]
    velocities: NDArray[np.float64]
    median: float
    speed: float


class SkippedFrames:
    """Counts the frames that are missing between even time stamps.

    Parameters
    ----------
    pixels_per_metre : float

    Attributes
    ----------
    steps, skipped : int
        Steps that could tell, and frames that are missing among them.
    """

    def __init__(self, pixels_per_metre: float) -> None:
        self._shortest = _SHORTEST_STEP_PX / pixels_per_metre
        self._last: Tracks | None = None
        self._recent: deque[_Step] = deque(maxlen=3)
        self.steps = self.skipped = 0

    def push(self, tracks: Tracks) -> None:
        """Take the tracks of the next frame."""
        last, self._last = self._last, tracks
        step = None if last is None else _step_between(last, tracks)
        if step is None or step.median < self._shortest:
            self._recent.clear()
            return
        self._recent.append(step)
        if len(self._recent) == self._recent.maxlen:
            self.steps += 1
            self.skipped += _frames_missing(*self._recent)

    @property
    def matters(self) -> bool:
        """Whether so many frames are missing that restitutions may be wrong."""
        return self.steps >= _FEWEST_STEPS and self.skipped > _FLAGGED_SHARE * self.steps


def _step_between(earlier: Tracks, later: Tracks) -> _Step | None:
    """The steps of the beads seen in both frames, in space."""
    interval = (later.stamp_ns - earlier.stamp_ns) / NS
    if interval <= 0.0:
        return None
    most = min(earlier.ids.size, later.ids.size)
    ids, steps = np.empty(most, dtype=np.int32), np.empty((most, 2))
    count, median = _write_steps(
        earlier.ids,
        earlier.seen,
        earlier.positions,
        earlier.displacement,
        later.ids,
        later.seen,
        later.positions,
        later.displacement,
        ids,
        steps,
    )
    if count < _FEWEST_BEADS:
        return None
    return _Step(ids[:count], steps[:count] / interval, median, median / interval)


@compiled
def _write_steps(
    earlier_ids: NDArray[np.int32],
    earlier_seen: NDArray[np.bool_],
    earlier_positions: NDArray[np.float64],
    earlier_displacement: NDArray[np.float64],
    later_ids: NDArray[np.int32],
    later_seen: NDArray[np.bool_],
    later_positions: NDArray[np.float64],
    later_displacement: NDArray[np.float64],
    ids: NDArray[np.int32],
    steps: NDArray[np.float64],
) -> tuple[int, float]:
    """Write numbers and steps of the beads seen in both frames; how many, and the median length.

    The numbers ascend in both frames.
    """
    lengths = np.empty(ids.size)
    j = count = 0
    for k in range(later_ids.size):
        while j < earlier_ids.size and earlier_ids[j] < later_ids[k]:
            j += 1
        if j == earlier_ids.size:
            break
        if earlier_ids[j] != later_ids[k] or not (earlier_seen[j] and later_seen[k]):
            continue
        ids[count] = later_ids[k]
        for axis in range(2):
            end = later_positions[k, axis] + later_displacement[axis]
            steps[count, axis] = end - earlier_positions[j, axis] - earlier_displacement[axis]
        lengths[count] = math.hypot(steps[count, 0], steps[count, 1])
        count += 1
    median = median_of(lengths[:count]) if count else math.nan
    return count, median


def _frames_missing(before: _Step, step: _Step, after: _Step) -> int:
    """Frames that are missing in the middle one of three successive steps."""
    if step.speed < _SUSPECT * max(before.speed, after.speed):
        return 0
    ids = np.intersect1d(before.ids, after.ids, assume_unique=True)
    ids = np.intersect1d(ids, step.ids, assume_unique=True)
    first, middle, last = (
        each.velocities[np.searchsorted(each.ids, ids)] for each in (before, step, after)
    )
    usual = 0.5 * (first + last)
    square = (usual**2).sum(axis=1)
    straight = ((first - last) ** 2).sum(axis=1) < _STRAIGHT**2 * square
    if straight.sum() < _FEWEST_BEADS:
        return 0
    square, usual, middle = square[straight], usual[straight], middle[straight]
    factors = (middle * usual).sum(axis=1) / square
    whole = round(float(np.median(factors)))
    off = np.hypot(*(middle - whole * usual).T) / np.sqrt(square)
    agree = np.mean(off < _WHOLE)
    return whole - 1 if whole > 1 and agree >= _AGREEING else 0
