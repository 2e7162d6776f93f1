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
_FEWEST = 2 * _NARROW
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
        self._displacements: deque[NDArray[np.float64]] = deque(maxlen=pictures)
        # Of each species: sum of the squares of known velocities, and how many these are.
        self._squares: deque[NDArray[np.float64]] = deque(maxlen=pictures)
        self.interval = math.inf

    def push(self, time: float, tracks: Tracks) -> None:
        """Take the next picture, at a time in s."""
        if self._times:
            recent = np.diff([*list(self._times)[-_WARM:], time])
            self.interval = float(np.median(recent))
        self._times.append(time)
        self._records.append(tracks)
        self._displacements.append(tracks.displacement)
        self._squares.append(_squares(tracks))

    def _around(self, time: float, pictures: int) -> slice:
        times = np.array(self._times)
        middle = int(np.searchsorted(times, time))
        return slice(max(middle - pictures, 0), middle + pictures)

    def motion(self, time: float) -> tuple[NDArray[np.float64], float]:
        """Velocity of the tray at a time, and the error of a component.

        Returns
        -------
        velocity : ndarray (2,), [m/s]
        error : float, [m/s]
        """
        wide, narrow = self._around(time, _WIDE), self._around(time, _NARROW)
        times = np.array(self._times) - time
        places = np.array(self._displacements)
        if times[wide].size < _FEWEST:
            return np.zeros(2), math.inf
        velocity, rest, factor = _slope(times[wide], places[wide], _STRAIGHT)
        noise = float(np.sqrt(np.mean(np.diff(places[wide], 4, axis=0) ** 2) / _FOURTH))
        if rest > _AT_REST * noise:
            velocity, _, factor = _slope(times[narrow], places[narrow], _CUBIC)
        return velocity, noise * factor

    def displacement(self, time: float) -> NDArray[np.float64]:
        """Of the tray at a time, (2,), [m]; the jitter of its registration is in it."""
        times, places = np.array(self._times), np.array(self._displacements)
        return np.array([np.interp(time, times, one) for one in places.T])

    def temperature(self, time: float, species: int) -> float:
        """Mean square of a horizontal component of velocity of a species, [m^2/s^2]."""
        known = list(self._squares)[self._around(time, _WARM)]
        sums = np.sum([one[species] for one in known], axis=0)
        return 0.5 * float(sums[0] / sums[1]) if sums[1] else math.nan

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


def _slope(
    times: NDArray[np.float64], places: NDArray[np.float64], degree: int
) -> tuple[NDArray[np.float64], float, float]:
    """Slope of a polynomial at 0, scatter of the rest, error of the slope for that of a place."""
    powers = np.vander(times, degree + 1, increasing=True)
    inverse = np.linalg.pinv(powers)
    found = inverse @ places
    freedom = max(times.size - degree - 1, 1)
    rest = float(np.sqrt(np.sum((places - powers @ found) ** 2) / (2 * freedom)))
    return found[1], rest, float(np.linalg.norm(inverse[1]))


def _squares(tracks: Tracks) -> NDArray[np.float64]:
    """Of each species, sum of the squares of the velocities and their number, (species, 2)."""
    squares = np.sum(np.square(tracks.velocities), axis=1)
    known = np.isfinite(squares)
    sums = [
        np.bincount(tracks.species[known], weights, minlength=tracks.expected.size)
        for weights in (squares[known], None)
    ]
    return np.column_stack(sums)
