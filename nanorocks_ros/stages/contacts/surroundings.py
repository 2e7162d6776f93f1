"""The last pictures of a tray: how it moved, how warm its gas was, who else was near."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

# Pictures on each side from which the motion of a tray that swings is measured, and one at rest.
_NARROW, _WIDE = 4, 15
_CUBIC, _STRAIGHT = 3, 1
# Fourth differences see noise but no swing; their variance is so many times that of the noise.
_FOURTH = 70.0
# Times the noise, what may be left of the displacements when a tray is called at rest.
_AT_REST = 1.5
# Pictures on each side over which a gas is called equally warm.
_WARM = 15


class Surroundings:
    """What is known of the tray besides single tracks, for as long as a flight may last.

    Parameters
    ----------
    pictures : int
        How many are kept.
    """

    def __init__(self, pictures: int) -> None:
        self._records: deque[Tracks] = deque(maxlen=pictures)
        self._times: deque[float] = deque(maxlen=pictures)
        self.interval = math.inf

    def push(self, time: float, tracks: Tracks) -> None:
        """Take the next picture, at a time in s."""
        if self._times:
            recent = np.diff([*list(self._times)[-_WARM:], time])
            self.interval = float(np.median(recent))
        self._times.append(time)
        self._records.append(tracks)

    def _around(self, time: float, pictures: int) -> slice:
        times = np.array(self._times)
        middle = int(np.searchsorted(times, time))
        return slice(max(middle - pictures, 0), middle + pictures)

    def motion(self, time: float) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Displacement of the tray at a time, its velocity, and the error of a component.

        Returns
        -------
        displacement, velocity : ndarray (2,), [m], [m/s]
        error : float, [m/s]
        """
        wide, narrow = self._around(time, _WIDE), self._around(time, _NARROW)
        times = np.array(self._times) - time
        places = np.array([one.displacement for one in self._records])
        slow = _polynomial(times[wide], places[wide], _STRAIGHT)
        noise = float(np.sqrt(np.mean(np.diff(places[wide], 4, axis=0) ** 2) / _FOURTH))
        if slow[2] <= _AT_REST * noise or times[narrow].size <= _CUBIC + 1:
            place, velocity, _, factor = slow
        else:
            place, velocity, _, factor = _polynomial(times[narrow], places[narrow], _CUBIC)
        return place, velocity, noise * factor

    def temperature(self, time: float, species: int) -> float:
        """Mean square of a horizontal component of velocity of a species, [m^2/s^2]."""
        squares = [
            np.sum(one.velocities[one.species == species] ** 2, axis=1)
            for one in list(self._records)[self._around(time, _WARM)]
        ]
        known = np.concatenate(squares)
        known = known[np.isfinite(known)]
        return 0.5 * float(known.mean()) if known.size else math.nan

    def alone(
        self,
        time: float,
        beads: Sequence[tuple[int, NDArray[np.float64], float, float]],
    ) -> bool:
        """Whether nobody else can have hit some beads between the pictures around a time.

        Parameters
        ----------
        time : float, [s]
        beads : sequence of (track, place, radius, speed)
            Places past the camera.
        """
        own = [bead[0] for bead in beads]
        for record in list(self._records)[self._around(time, 1)]:
            others = ~np.isin(record.ids, own)
            places = record.positions[others] + record.displacement
            speeds = np.nan_to_num(np.hypot(*record.velocities[others].T))
            for _, place, radius, speed in beads:
                reach = radius + record.radii[others] + self.interval * (speed + speeds)
                if (np.hypot(*(places - place).T) < reach).any():
                    return False
        return True


def _polynomial(
    times: NDArray[np.float64], places: NDArray[np.float64], degree: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], float, float]:
    """Value and slope at 0, scatter of the rest, and the error of the slope per error of a place."""
    powers = np.vander(times, degree + 1, increasing=True)
    inverse = np.linalg.pinv(powers)
    found = inverse @ places
    freedom = max(times.size - degree - 1, 1)
    rest = float(np.sqrt(np.sum((places - powers @ found) ** 2) / (2 * freedom)))
    return found[0], found[1], rest, float(np.linalg.norm(inverse[1]))
