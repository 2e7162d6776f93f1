"""Error of registration and detection that all beads of a frame share."""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.quantiles import median
from nanorocks_ros.stages.tracking.bead_paths import column_medians, paths_of

if TYPE_CHECKING:
    from nanorocks_ros.stages.tracking.bead_paths import Moment

# Errors that all beads share are measured by the fourth difference of their positions in
# successive frames, of so many times the error of a frame: a swing of 1.5 Hz leaves 0.023 of
# itself in it at 25 frames/s, registration all of its errors.
_FOURTH = (1.0, -4.0, 6.0, -4.0, 1.0)
_FOURTH_ERROR = math.sqrt(70.0)
# Fewest fourth differences, and fewest beads of each.
_FEWEST_FOURTHS, _FEWEST_BEADS = 12, 3
# A difference counts for so long, [s].
_MEMORY = 1.0
# Largest ratio of the times between the frames.
_EVEN = 1.25
# Standard deviation of a normal variate over the median of its absolute values.
_DEVIATION = 1.4826


class SharedError:
    """Error of registration and detection that all beads share, from frame to frame.

    Attributes
    ----------
    error : float, [px]
        Of a component; 0 while too few frames show it.
    """

    def __init__(self) -> None:
        self._differences: deque[tuple[float, float, float]] = deque()
        self.error = 0.0

    def push(self, moments: deque[Moment]) -> None:
        """Take the last of the moments."""
        differences = self._differences
        while differences and moments[-1].time - differences[0][0] > _MEMORY:
            differences.popleft()
        count = len(_FOURTH)
        if len(moments) >= count:
            times = [moments[-1 - k].time for k in range(count)]
            steps = [later - earlier for later, earlier in pairwise(times)]
            if max(steps) < _EVEN * min(steps):
                positions, radii = paths_of(moments, tuple(range(count)))
                if len(radii) >= _FEWEST_BEADS:
                    fourth = np.tensordot(_FOURTH, positions, axes=1)
                    across, down = np.abs(column_medians(fourth)).tolist()
                    differences.append((times[0], across, down))
        self.error = 0.0
        if len(differences) >= _FEWEST_FOURTHS:
            # Median over frames and components: collisions do not count.
            usual = median(size for _, *sizes in differences for size in sizes)
            self.error = _DEVIATION * usual / _FOURTH_ERROR
