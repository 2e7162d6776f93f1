"""Beads as a camera sees them that reads its rows one after the other.

Each bead is seen where it is when its row is read; between times at which the engine stops,
places are interpolated. Tested by ``test/validation/test_rolling_shutter.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.simulation.shaken_tray import Moment

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from benchmarks.soft_spheres import SoftRun
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
            before, share = _when_read(places[:, :, 1] / self._rows, parts)
            yield Moment(
                positions=_between(places, before, share),
                velocities=_between(motion, before, np.zeros_like(share)),
                truth=self._shaken.truth(round(start * _NS), motion[0]),
            )


def rolled_run(run: SoftRun, every: int, parts: NDArray[np.float64], rows: float) -> SoftRun:
    """A run with many states for each picture, as seen by a rolling shutter.

    Parameters
    ----------
    run : SoftRun
    every : int
        States from picture to picture.
    parts : ndarray (n,)
        Part of the readout at the first n states from each picture on, 0 to 1.
    rows : float, [m]
        From what the first row of the picture shows to what the last one does, about the middle of
        the box.
    """
    middle = 0.5 * rows - 0.5 * (run.positions[0, :, 1].min() + run.positions[0, :, 1].max())
    pictures = range(0, len(run.positions) - len(parts), every)
    seen = []
    for first in pictures:
        places = run.positions[first : first + len(parts)]
        seen.append(_between(places, *_when_read((places[:, :, 1] + middle) / rows, parts)))
    return replace(
        run,
        positions=np.array(seen),
        velocities=run.velocities[pictures],
        displacement=run.displacement[pictures],
    )


def _when_read(
    heights: NDArray[np.float64], parts: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """State before the row of each bead is read, and the part of the time to the next, both (n,).

    `heights` (states, n) are rows of the beads, and `parts` (states,) the row that is read, both
    as parts of all rows.
    """
    # Where a bead is ahead of the row that is read; rows catch up with all of them.
    ahead = heights - parts[:, np.newaxis]
    before = np.clip((ahead > 0.0).sum(axis=0) - 1, 0, len(parts) - 2)
    beads = np.arange(heights.shape[1])
    left = ahead[before, beads]
    return before, left / (left - ahead[before + 1, beads])


def _between(
    states: NDArray[np.float64], before: NDArray[np.int64], share: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Each bead between two states (states, n, 3)."""
    beads = np.arange(states.shape[1])
    return (1.0 - share)[:, np.newaxis] * states[before, beads] + share[:, np.newaxis] * states[
        before + 1, beads
    ]
