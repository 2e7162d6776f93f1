"""Jitter of a picture, told from the oscillation of a tray by the roughness of the motion."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Displacements whose roughness is measured, and the least roughness of jitter: the medians of
# fourth over second differences, (2 sin(pi f / rate))^2 for a frequency f. The limit is that of a
# fourth of the frame rate, faster than trays swing on springs; white jitter has 3.4.
_ROUGH_FRAMES, _ROUGH = 12, 2.0
# Least median second difference of a motion, in errors of a displacement. Those of noise have
# 1.7, their fourth differences 5.6: these must be small beside a swing.
_MOVING = 10.0
# Largest ratio of the times between the pictures: uneven ones make a swing rough.
_EVEN = 1.5


class JitterMeter:
    """Whether the picture jitters: whether it moves as no tray on springs does.

    Attributes
    ----------
    jitters : bool
        False while there are too few pictures.
    """

    def __init__(self) -> None:
        self._recent: deque[tuple[float, float, float]] = deque(maxlen=_ROUGH_FRAMES)
        self.jitters = False

    def push(self, time: float, x: float, y: float, error: float) -> None:
        """Take the displacement in the next picture; one that is not finite starts afresh.

        Parameters
        ----------
        time : float, [s]
        x, y, error : float, [px]
            ``error`` is that of a component.
        """
        if not math.isfinite(x + y + error):
            self._recent.clear()
            self.jitters = False
            return
        self._recent.append((time, x, y))
        full = len(self._recent) == _ROUGH_FRAMES
        self.jitters = full and _jitters(np.array(self._recent), error)


@compiled
def _jitters(recent: NDArray[np.float64], error: float) -> bool:
    steps = recent[1:, 0] - recent[:-1, 0]
    if not steps.max() < _EVEN * steps.min():
        return False
    displacements = recent[:, 1:]
    second = displacements[2:] - 2.0 * displacements[1:-1] + displacements[:-2]
    fourth = second[2:] - 2.0 * second[1:-1] + second[:-2]
    usual = np.median(np.abs(second))
    return bool(usual > _MOVING * error and np.median(np.abs(fourth)) > _ROUGH * usual)
