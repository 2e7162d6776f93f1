"""Error of registration and detection that all beads of a frame share."""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.quantiles import median
from nanorocks_ros.stages.tracking.bead_paths import (
    Positions,
    column_medians,
    paths_of,
    positions_at,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.bead_paths import Moment

# Errors that all beads share are measured by the fourth difference of their positions in
# successive frames, of so many times the error of a frame: a swing of 1.5 Hz leaves 0.023 of
# itself in it at 25 frames/s, registration all of its errors.
_FOURTH = (1.0, -4.0, 6.0, -4.0, 1.0)
_LAGS = (0, 1, 2, 3, 4)
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
        # Times, and sizes of the two components, of the last differences.
        self._times: deque[float] = deque()
        self._sizes: deque[float] = deque()
        self.error = 0.0

    def push(self, moments: deque[Moment]) -> None:
        """Take the last of the moments."""
        while self._times and moments[-1].time - self._times[0] > _MEMORY:
            self._times.popleft()
            self._sizes.popleft()
            self._sizes.popleft()
        count = len(_FOURTH)
        if len(moments) >= count:
            times = [moments[-1 - k].time for k in range(count)]
            steps = [later - earlier for later, earlier in pairwise(times)]
            if max(steps) < _EVEN * min(steps):
                last = moments[-1]
                positions = positions_at(moments, _LAGS)
                beads, *sizes = _fourth_difference(positions, last.links, last.radii)
                if beads >= _FEWEST_BEADS:
                    self._times.append(times[0])
                    self._sizes.extend(sizes)
        self.error = 0.0
        if len(self._times) >= _FEWEST_FOURTHS:
            # Median over frames and components: collisions do not count.
            self.error = _DEVIATION * median(self._sizes) / _FOURTH_ERROR


@compiled
def _fourth_difference(
    positions: Positions, links: NDArray[np.int32], radii: NDArray[np.float64]
) -> tuple[int, float, float]:
    """Number of beads seen in five frames, and the size of each component of their difference."""
    paths, _ = paths_of(positions, links, _LAGS, radii)
    beads = paths.shape[1]
    if beads < _FEWEST_BEADS:
        return beads, 0.0, 0.0
    fourth = np.zeros(paths.shape[1:])
    for k in range(len(_FOURTH)):
        fourth += _FOURTH[k] * paths[k]
    common = column_medians(fourth)
    return beads, abs(common[0]), abs(common[1])
