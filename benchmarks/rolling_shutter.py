"""A tray as a camera sees it that reads its rows one after the other.

Each bead is seen where it is when its row is read; between times at which the engine stops,
places are interpolated. Tested by ``test/validation/test_rolling_shutter.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.simulation.shaken_tray import Moment

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.simulation.shaken_tray import ShakenTray

_NS = 1e9
# Stops of the engine while the rows of the tray are read.
_STOPS = 10


class RolledTray:
    """Beads as seen by a rolling shutter.

    Parameters
    ----------
    shaken : ShakenTray
    tray : Tray
    readout : float, [s]
        From its first row to its last; at most the time between frames.
    frame_rate : float, [1/s]
    """

    def __init__(self, shaken: ShakenTray, tray: Tray, readout: float, frame_rate: float) -> None:
        self._shaken = shaken
        self._rows = tray.dimensions[1]
        self._readout = readout
        self._frame_rate = frame_rate

    @property
    def radii(self) -> NDArray[np.float64]:
        """Radius of each bead, (n,), [m]."""
        return self._shaken.radii

    def moments(self, frames: int) -> Iterator[Moment]:
        """Iterate over the frames; to be called once."""
        parts = np.arange(_STOPS + 1) / _STOPS
        for number in range(frames):
            start = number / self._frame_rate
            stops = [self._shaken.at(start + part * self._readout) for part in parts]
            places = np.array([positions for positions, _ in stops])
            motion = np.array([velocities for _, velocities in stops])
            # Where a bead is ahead of the row that is read; rows catch up with all of them.
            ahead = places[:, :, 1] / self._rows - parts[:, np.newaxis]
            before = np.minimum((ahead > 0.0).sum(axis=0), _STOPS) - 1
            before, beads = np.maximum(before, 0), np.arange(places.shape[1])
            left, taken = ahead[before, beads], ahead[before, beads] - ahead[before + 1, beads]
            share = (left / taken)[:, np.newaxis]
            seen = (1.0 - share) * places[before, beads] + share * places[before + 1, beads]
            yield Moment(
                positions=seen,
                velocities=motion[before, beads],
                truth=self._shaken.truth(round(start * _NS), motion[0]),
            )
