"""Whether the picture of a tray moves because the tray does, or because the camera does.

The walls show how the tray moves in the picture, but not whether tray or camera moves. Beads in
free flight do: they fly straight in space. Where the tray swings, their paths bend in the frame of
the tray by the opposite of its motion in the picture; where the camera moves, they are straight in
the frame of the tray.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Times between the three positions that give a bend, [s]: for motion of 1 to 10 Hz and of less.
_LAGS = (0.1, 0.3)
# Fewest beads with three positions: fewer have no reliable median.
_FEWEST_BEADS = 4
# Error of a median of normal variates over that of their mean, and their standard deviation over
# the median of their absolute values.
_MEDIAN_ERROR = 1.2533
_DEVIATION = 1.4826
# Least error of the common bend, [px]: registration and detection have errors that beads share.
_LEAST_ERROR = 0.05
# Least bend of the motion of the picture that is evidence, in errors of a registered bend.
_SIGNIFICANT = 4.0
_BEND_ERROR = math.sqrt(6.0)
# Largest log likelihood ratio of a frame: no single frame decides.
_LARGEST_RATIO = 4.0
# Log likelihood ratio that decides, and its largest value, so that a change is noticed.
_DECISIVE, _LARGEST_EVIDENCE = 6.0, 12.0
# Evidence and misfit are forgotten with this time, [s].
_MEMORY = 1.0
# Largest mean square of the common bend that the motion leaves, in units of its variance: 4 for a
# variate of 2 standard errors. A single frame counts as at most this square.
_LARGEST_MISFIT, _MISFIT_BOUND = 4.0, 25.0


@dataclass(frozen=True, slots=True)
class TrayMotion:
    """Motion of a tray in space.

    Parameters
    ----------
    displacement : ndarray (2,), [px]
    camera_moves : bool
        Whether the motion of the picture is that of the camera.
    changed : bool
        Whether this was decided anew with this frame: positions in space before it do not count.
    uncertain : bool
        Whether the beads contradict what is assumed, as where tray and camera both move.
    """

    displacement: NDArray[np.float64]
    camera_moves: bool
    changed: bool
    uncertain: bool


@dataclass(frozen=True, slots=True)
class _Moment:
    """Beads of a frame in the frame of the tray, and the row of each in the frame before."""

    time: float
    positions: NDArray[np.float64]
    before: NDArray[np.int64]
    displacement: NDArray[np.float64]


class CameraMotion:
    """Decides from frame to frame whether the tray or the camera moves; at first the tray."""

    def __init__(self) -> None:
        self._moments: deque[_Moment] = deque()
        self._evidence = 0.0
        self._misfit = 1.0
        self.camera_moves = False

    def push(
        self,
        time: float,
        positions: NDArray[np.float64],
        displacement: NDArray[np.float64],
        error: float,
    ) -> TrayMotion:
        """Motion of the tray in space up to the next frame.

        Parameters
        ----------
        time : float, [s]
        positions : ndarray (n, 2), [px]
            Of the beads in the frame of the tray, in any order.
        displacement : ndarray (2,), [px]
            Of the tray in the picture.
        error : float, [px]
            Of a component of the displacement.
        """
        last = self._moments[-1] if self._moments else None
        rows = np.empty(len(positions), dtype=np.int64)
        if last is None:
            rows[:] = -1
        else:
            _nearest_rows(positions, last.positions, rows)
        self._moments.append(_Moment(time, positions, rows, displacement))
        while time - self._moments[0].time > 2.0 * _LAGS[-1] + _MEMORY:
            self._moments.popleft()
        step = time - last.time if last is not None else 0.0
        fading = math.exp(-step / _MEMORY)
        self._evidence *= fading
        for lag in _LAGS:
            self._weigh(lag, step, error)
        changed = self._decide()
        return TrayMotion(
            np.zeros(2) if self.camera_moves else displacement,
            self.camera_moves,
            changed,
            self._misfit > _LARGEST_MISFIT,
        )

    def _decide(self) -> bool:
        before = self.camera_moves
        if abs(self._evidence) > _DECISIVE:
            self.camera_moves = self._evidence > 0.0
        self._evidence = min(max(self._evidence, -_LARGEST_EVIDENCE), _LARGEST_EVIDENCE)
        if self.camera_moves != before:
            self._misfit = 1.0
        return self.camera_moves != before

    def _weigh(self, lag: float, step: float, error: float) -> None:
        """Add the evidence of three moments, as far as the picture moves."""
        frames = max(1, round(lag / step)) if step > 0.0 else 0
        if not frames or len(self._moments) <= 2 * frames:
            return
        later, middle, earlier = (self._moments[-1 - k * frames] for k in range(3))
        between = middle.time - earlier.time
        ratio = (later.time - middle.time) / between if between > 0.0 else math.inf
        # Where frames are missing the bend would be that of another lag.
        if not 0.8 < ratio < 1.25:
            return
        moved = _bend(later.displacement, middle.displacement, earlier.displacement, ratio)
        if math.hypot(moved[0], moved[1]) < _SIGNIFICANT * _BEND_ERROR * error:
            self._misfit += (1.0 - self._misfit) * step / _MEMORY
            return
        bends = self._bends(frames, ratio)
        if len(bends) < _FEWEST_BEADS:
            return
        common = np.median(bends, axis=0)
        deviation = _DEVIATION * np.median(np.abs(bends - common), axis=0)
        noise = np.hypot(_MEDIAN_ERROR * deviation / math.sqrt(len(bends)), _LEAST_ERROR)
        of_tray = float(np.sum(((common + moved) / noise) ** 2))
        of_camera = float(np.sum((common / noise) ** 2))
        # Successive bends share the motion within a lag.
        ratio_here = min(max(0.5 * (of_tray - of_camera), -_LARGEST_RATIO), _LARGEST_RATIO)
        self._evidence += ratio_here / frames
        square = min(0.5 * (of_camera if self.camera_moves else of_tray), _MISFIT_BOUND)
        self._misfit += (square - self._misfit) * min(1.0, step / _MEMORY)

    def _bends(self, frames: int, ratio: float) -> NDArray[np.float64]:
        """Bends of the paths of all beads that are in all frames from the first on, (n, 2)."""
        rows = [np.arange(len(self._moments[-1].positions))]
        for k in range(2 * frames):
            before = self._moments[-1 - k].before
            rows.append(np.where(rows[-1] >= 0, before[rows[-1]], -1))
        seen = rows[-1] >= 0
        later, middle, earlier = (
            self._moments[-1 - k * frames].positions[rows[k * frames][seen]] for k in range(3)
        )
        return _bend(later, middle, earlier, ratio)


def _bend(
    later: NDArray[np.float64],
    middle: NDArray[np.float64],
    earlier: NDArray[np.float64],
    ratio: float,
) -> NDArray[np.float64]:
    """Distance of the later position from where straight motion would have led."""
    return later - middle - ratio * (middle - earlier)


@compiled
def _nearest_rows(
    positions: NDArray[np.float64], before: NDArray[np.float64], rows: NDArray[np.int64]
) -> None:
    """Row of each bead in the frame before: that nearest to it, if it is also nearest to that.

    -1 for a bead that has none.
    """
    taken = np.full(before.shape[0], -1, np.int64)
    nearest = np.full(before.shape[0], np.inf)
    for k in range(positions.shape[0]):
        rows[k] = -1
        best = np.inf
        for j in range(before.shape[0]):
            dx = positions[k, 0] - before[j, 0]
            dy = positions[k, 1] - before[j, 1]
            square = dx * dx + dy * dy
            if square < best:
                best, rows[k] = square, j
        j = rows[k]
        if j >= 0 and best < nearest[j]:
            if taken[j] >= 0:
                rows[taken[j]] = -1
            taken[j], nearest[j] = k, best
        else:
            rows[k] = -1
