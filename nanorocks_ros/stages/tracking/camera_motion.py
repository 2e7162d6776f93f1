"""Whether the picture of a tray moves because the tray does, or because the camera does.

The walls show how the tray moves in the picture, but not whether tray or camera moves. Beads in
free flight do: they fly straight in space. Where the tray swings, their paths bend in the frame of
the tray by the opposite of its motion in the picture; where the camera moves, they are straight in
the frame of the tray. Beads that touch may stick and turn: only their centre of mass flies
straight.

Where fewer than two bodies fly, motion that changes direction from frame to frame is that of the
camera: a tray on springs swings smoothly.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.picture_jitter import JitterMeter
from nanorocks_ros.stages.tracking.bead_paths import (
    Moment,
    Positions,
    bend,
    body_bends,
    column_medians,
    links_to,
    paths_of,
    positions_at,
)
from nanorocks_ros.stages.tracking.shared_error import SharedError

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Times between the three positions that give a bend, [s]: for motion of 1 to 10 Hz and of less.
_LAGS = (0.1, 0.3)
# A single body may just have collided; two that agree have not.
_FEWEST_BODIES = 2
# The scatter of n bodies is uncertain by itself: its error is larger by 1 + this / (n - 1).
_FEW_BODIES = 2.0
# Error of a median of normal variates over that of their mean, and their standard deviation over
# the median of their absolute values.
_MEDIAN_ERROR = 1.2533
_DEVIATION = 1.4826
# Least error of the common bend, [px]: detection has errors that beads share.
_LEAST_ERROR = 0.05
# Least bend of the motion of the picture that is evidence, in errors of a registered bend.
_SIGNIFICANT = 4.0
_BEND_ERROR = math.sqrt(6.0)
# Share of the motion of the picture by which that of the beads may differ from that of the walls:
# a lens that is not calibrated enlarges by some per cent more or less away from its centre.
_LENS_SHARE = 0.04
# Largest ratio of the two times between three moments.
_EVEN = 1.25
# Largest log likelihood ratio of a frame: no single frame decides.
_LARGEST_RATIO = 4.0
# Log likelihood ratio that decides, and its largest value, so that a change is noticed.
_DECISIVE, _LARGEST_EVIDENCE = 6.0, 12.0
# Evidence and misfit are forgotten with this time, [s].
_MEMORY = 1.0
# A motion that nothing explains for so long is called uncertain, [s].
_UNDECIDED = 1.0
# Largest mean square of the common bend that the motion leaves, in units of its variance: within
# the memory some ten values are independent, whose mean is beyond 2.5 in 0.5 % of all cases. A
# single frame counts as at most this square.
_LARGEST_MISFIT, _MISFIT_BOUND = 2.5, 25.0


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


class _Fate(Enum):
    """What three moments say: the picture is still, it moves, or beads say what moves."""

    STILL = 0
    UNKNOWN = 1
    WEIGHED = 2


class CameraMotion:
    """Decides from frame to frame whether the tray or the camera moves; at first the tray."""

    def __init__(self) -> None:
        self._moments: deque[Moment] = deque()
        self._jitter = JitterMeter()
        self._shared = SharedError()
        self._evidence = 0.0
        self._misfit = 1.0
        self._undecided = 0.0
        self._decided = False
        self.camera_moves = False

    def push(
        self,
        time: float,
        positions: NDArray[np.float64],
        radii: NDArray[np.float64],
        displacement: NDArray[np.float64],
        error: float,
    ) -> TrayMotion:
        """Motion of the tray in space up to the next frame.

        Parameters
        ----------
        time : float, [s]
        positions : ndarray (n, 2), [px]
            Of the beads in the frame of the tray, in any order.
        radii : ndarray (n,), [px]
        displacement : ndarray (2,), [px]
            Of the tray in the picture.
        error : float, [px]
            Of a component of the displacement.
        """
        last = self._moments[-1] if self._moments else None
        step, before, links = 0.0, np.empty((0, 2)), np.empty((0, 1), np.int32)
        if last is not None:
            step, before = time - last.time, last.positions
            links = last.links[: len(self._moments)]
        links = links_to(positions, before, links)
        self._moments.append(Moment(time, positions, radii, links, displacement))
        while time - self._moments[0].time > 2.0 * _LAGS[-1] + _MEMORY:
            self._moments.popleft()
        # Compressed pictures that jitter are registered worse than the walls of one of them say.
        self._shared.push(self._moments)
        error = max(error, self._shared.error)
        self._evidence *= math.exp(-step / _MEMORY)
        fates = [self._weigh(lag, step, error) for lag in _LAGS]
        self._jitter.push(time, float(displacement[0]), float(displacement[1]), error)
        if not any(fate is _Fate.WEIGHED for fate in fates) and self._jitter.jitters:
            self._evidence += 1.0
        changed = self._decide()
        moves = any(fate is not _Fate.STILL for fate in fates)
        self._undecided = self._undecided + step if moves and not self._decided else 0.0
        return TrayMotion(
            np.zeros(2) if self.camera_moves else displacement,
            self.camera_moves,
            changed,
            self._misfit > _LARGEST_MISFIT or self._undecided > _UNDECIDED,
        )

    def of_lost_tray(self) -> TrayMotion:
        """Motion in a frame in which the tray was not registered: it counts as at rest.

        Uncertain where the camera moves: then the beads move with it.
        """
        return TrayMotion(
            np.zeros(2), self.camera_moves, changed=False, uncertain=self.camera_moves
        )

    def _decide(self) -> bool:
        before = self.camera_moves
        if abs(self._evidence) > _DECISIVE:
            self.camera_moves, self._decided = self._evidence > 0.0, True
        self._evidence = min(max(self._evidence, -_LARGEST_EVIDENCE), _LARGEST_EVIDENCE)
        if self.camera_moves != before:
            self._misfit = 1.0
        return self.camera_moves != before

    def _weigh(self, lag: float, step: float, error: float) -> _Fate:
        """Add the evidence of three moments, as far as the picture moves."""
        frames = max(1, round(lag / step)) if step > 0.0 else 0
        if not frames or len(self._moments) <= 2 * frames:
            return _Fate.STILL
        later, middle, earlier = (self._moments[-1 - k * frames] for k in range(3))
        between = middle.time - earlier.time
        ratio = (later.time - middle.time) / between if between > 0.0 else math.inf
        # Where frames are missing the bend would be that of another lag.
        if not 1.0 / _EVEN < ratio < _EVEN:
            return _Fate.STILL
        share = min(1.0, step / _MEMORY)
        moved = bend(later.displacement, middle.displacement, earlier.displacement, ratio)
        still = math.hypot(moved[0], moved[1]) < _SIGNIFICANT * _BEND_ERROR * error
        bodies, of_tray, of_camera = (
            (0, 0.0, 0.0) if still else self._chi_squares(frames, ratio, moved, error)
        )
        if bodies < _FEWEST_BODIES:
            self._misfit += (1.0 - self._misfit) * share
            return _Fate.STILL if still else _Fate.UNKNOWN
        likelihood = min(max(0.5 * (of_tray - of_camera), -_LARGEST_RATIO), _LARGEST_RATIO)
        # Successive bends share the motion within a lag.
        self._evidence += likelihood / frames
        square = min(0.5 * (of_camera if self.camera_moves else of_tray), _MISFIT_BOUND)
        self._misfit += (square - self._misfit) * share
        return _Fate.WEIGHED

    def _chi_squares(
        self, frames: int, ratio: float, moved: NDArray[np.float64], error: float
    ) -> tuple[int, float, float]:
        """See `_chi_squares`: of all bodies that are in all frames from the first on."""
        lags = (0, frames, 2 * frames)
        last = self._moments[-1]
        positions = positions_at(self._moments, lags)
        return _chi_squares(positions, last.links, lags, last.radii, ratio, moved, error)


@compiled
def _chi_squares(
    positions: Positions,
    links: NDArray[np.int32],
    lags: tuple[int, int, int],
    radii: NDArray[np.float64],
    ratio: float,
    moved: NDArray[np.float64],
    error: float,
) -> tuple[int, float, float]:
    """Squares of the common bend that the motions of tray and camera leave, over its variance.

    Parameters
    ----------
    positions, links, lags, radii
        See `paths_of`.
    ratio : float
        See `body_bends`.
    moved : ndarray (2,), [px]
        Bend of the motion of the picture.
    error : float, [px]
        Of a registration.

    Returns
    -------
    int
        Number of bodies; with too few the squares are 0.
    float, float
        Of the tray, of the camera.
    """
    paths, radii_seen = paths_of(positions, links, lags, radii)
    bends = body_bends(paths, radii_seen, ratio)
    count = bends.shape[0]
    if count < _FEWEST_BODIES:
        return count, 0.0, 0.0
    common = column_medians(bends)
    deviation = column_medians(np.abs(bends - common))
    scatter = _MEDIAN_ERROR * _DEVIATION * (1.0 + _FEW_BODIES / (count - 1)) / math.sqrt(count)
    # A shift of the tray that was registered wrongly seems to be one of all beads.
    shared = _LEAST_ERROR**2 + (_BEND_ERROR * error) ** 2
    shared += _LENS_SHARE**2 * (moved[0] ** 2 + moved[1] ** 2)
    of_tray = of_camera = 0.0
    for axis in range(2):
        variance = (scatter * deviation[axis]) ** 2 + shared
        of_tray += (common[axis] + moved[axis]) ** 2 / variance
        of_camera += common[axis] ** 2 / variance
    return count, of_tray, of_camera
