"""Speed of the tray itself, which oscillates on its springs and drives the gas in it."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

from nanorocks_ros.records import NS, UNKNOWN, SpeedEstimate
from nanorocks_ros.stages.delays import KNOWN_AFTER_NS

if TYPE_CHECKING:
    from nanorocks_ros.records import TrayImage

# About half a period of the oscillation on each side.
_REACH_NS = 350_000_000
_DEVIATIONS = 2.0


class TrayOscillation:
    """Keeps the last velocities of the tray, for its speed around an estimate."""

    def __init__(self) -> None:
        self._squares: deque[tuple[int, float, float]] = deque()

    def push(self, image: TrayImage) -> None:
        """Take the next image; one whose tray could not be registered is left out."""
        across, down = image.velocity
        square, noise = across**2 + down**2, 2.0 * image.velocity_error**2
        if not math.isfinite(square + noise):
            return
        self._squares.append((image.stamp_ns, square, noise))
        while image.stamp_ns - self._squares[0][0] > KNOWN_AFTER_NS[SpeedEstimate]:
            self._squares.popleft()

    def speed(self, estimate: SpeedEstimate) -> float:
        """Root of the mean square of the speed of the tray around an estimate, [m/s].

        Parameters
        ----------
        estimate : SpeedEstimate
            At most 10 s old.

        Returns
        -------
        float
            Without what errors may add; NaN when the tray could not be registered.
        """
        reach = max(_REACH_NS, round(0.5 * estimate.window * NS))
        near = []
        # From the end: an estimate is of a second ago, and ten seconds are kept.
        for stamp_ns, square, noise in reversed(self._squares):
            if stamp_ns < estimate.stamp_ns - reach:
                break
            if stamp_ns <= estimate.stamp_ns + reach:
                near.append((square, noise))
        if not near:
            return UNKNOWN
        near.reverse()
        square, noise = (sum(column) / len(near) for column in zip(*near, strict=True))
        # The mean of so many squares of noise scatters by itself.
        largest_noise = noise * (1.0 + _DEVIATIONS / math.sqrt(len(near)))
        return math.sqrt(max(square - largest_noise, 0.0))
