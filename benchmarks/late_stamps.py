"""Pictures that are taken at other times than their stamps say.

Tested by ``test/validation/test_late_stamps.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.simulation.shaken_tray import Moment

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from nanorocks_ros.simulation.shaken_tray import ShakenTray

_NS = 1e9
# Part of the time between frames by which a picture is late at most: each comes after the last.
_LATEST = 0.45


class LateTray:
    """Beads as in pictures that are late, or early, by chance.

    Parameters
    ----------
    shaken : ShakenTray
    late : float, [s]
        Standard deviation.
    frame_rate : float, [1/s]
    rng : numpy.random.Generator
    """

    def __init__(
        self, shaken: ShakenTray, late: float, frame_rate: float, rng: np.random.Generator
    ) -> None:
        self._shaken = shaken
        self._late = late
        self._frame_rate = frame_rate
        self._rng = rng

    @property
    def radii(self) -> NDArray[np.float64]:
        """Radius of each bead, (n,), [m]."""
        return self._shaken.radii

    def moments(self, frames: int) -> Iterator[Moment]:
        """Iterate over the frames; to be called once."""
        latest = _LATEST / self._frame_rate
        late = np.clip(self._late * self._rng.standard_normal(frames), -latest, latest)
        for number in range(frames):
            stamp = number / self._frame_rate
            positions, velocities = self._shaken.at(max(stamp + late[number], 0.0))
            truth = self._shaken.truth(round(stamp * _NS), velocities)
            yield Moment(positions=positions, velocities=velocities, truth=truth)
