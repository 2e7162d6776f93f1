"""The last pictures of a tray: how it moved, how warm its gas was, who else was near."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.contacts.oscillation_fit import powers, slope_of, swing_terms

if TYPE_CHECKING:
    from nanorocks_ros.records import Tracks

# Pictures on each side from which the motion of a tray is measured when it swings or rests, and
# when it does anything else.
_WIDE, _NARROW = 45, 4
_FEWEST = 2 * _NARROW
# By how much a swing must lower chi square to be believed: it has eight numbers more.
_SWINGS = 20.0
# Fourth differences see noise but no swing; their variance is so many times that of the noise.
_FOURTH = 70.0
# What a swing may leave of the displacements: a share of their power, or times the noise from
# picture to picture; errors of the registration that last for some pictures are in it.
_EXPLAINED = 0.02
_QUIET = 3.0
# Errors of a velocity: over that of independent pictures; and as a share of it, since small
# displacements were registered up to a tenth too small or too large.
_LASTING = 2.0
_MISSCALED = 0.08
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
        self._pictures = pictures
        self._records: deque[Tracks] = deque(maxlen=pictures)
        # Twice as many fit in: what is kept is moved to the front now and then.
        self._all_times = np.empty(2 * pictures)
        self._all_displacements = np.empty((2 * pictures, 2))
        # Of each species: sum of the squares of known velocities, and how many these are.
        self._all_squares = np.empty((2 * pictures, 0, 2))
        self._end = 0
        self.interval = math.inf

    @property
    def _kept(self) -> slice:
        return slice(max(self._end - self._pictures, 0), self._end)

    @property
    def _times(self) -> NDArray[np.float64]:
        return self._all_times[self._kept]

    @property
    def _displacements(self) -> NDArray[np.float64]:
        return self._all_displacements[self._kept]

    def push(self, time: float, tracks: Tracks) -> None:
        """Take the next picture, at a time in s."""
        if self._end == 2 * self._pictures:
            for values in (self._all_times, self._all_displacements, self._all_squares):
                values[: self._pictures] = values[self._pictures :]
            self._end = self._pictures
        if self._all_squares.shape[1] != tracks.expected.size:
            self._all_squares = np.zeros((2 * self._pictures, tracks.expected.size, 2))
        end, self._end = self._end, self._end + 1
        self._all_times[end] = time
        self._all_displacements[end] = tracks.displacement
        self._records.append(tracks)
        first = max(end - _WARM, self._kept.start)
        times = self._all_times[first : self._end]
        squares = self._all_squares[end]
        self.interval = _learn(times, tracks.velocities, tracks.species, squares)

    def _around(self, time: float, pictures: int) -> slice:
        middle = int(np.searchsorted(self._times, time))
        return slice(max(middle - pictures, 0), middle + pictures)

    def motion(self, time: float) -> tuple[NDArray[np.float64], float]:
        """Velocity of the tray at a time, and the error of a component.

        Returns
        -------
        velocity : ndarray (2,), [m/s]
        error : float, [m/s]
        """
        wide, narrow = self._around(time, _WIDE), self._around(time, _NARROW)
        times = self._times - time
        places = self._displacements
        if times[wide].size < _FEWEST:
            return np.zeros(2), math.inf
        noise = float(np.sqrt(np.mean(np.diff(places[wide], 4, axis=0) ** 2) / _FOURTH))
        rest = slope_of(powers(times[wide], 1), places[wide])
        swing = slope_of(swing_terms(times[wide], places[wide]), places[wide])
        if rest.left - swing.left < _SWINGS * noise**2:
            # A swing too weak to be seen may still be there.
            return rest.velocity, noise * math.hypot(rest.factor, 0.5 * swing.factor)
        quiet = 2 * times[wide].size * (_QUIET * noise) ** 2
        if swing.left < max(_EXPLAINED * rest.left, quiet):
            scatter = math.sqrt(swing.left / (2 * times[wide].size))
            error = _LASTING * max(noise, scatter) * swing.factor
            return swing.velocity, math.hypot(error, _MISSCALED * math.hypot(*swing.velocity))
        other = slope_of(powers(times[narrow], 3), places[narrow])
        return other.velocity, _LASTING * noise * other.factor

    def displacement(self, time: float) -> tuple[float, float]:
        """Of the tray at a time, [m]; the jitter of its registration is in it."""
        return _between(time, self._times, self._displacements)

    def temperature(self, time: float, species: int) -> float:
        """Mean square of a horizontal component of velocity of a species, [m^2/s^2]."""
        known = self._all_squares[self._kept][self._around(time, _WARM)]
        sums = np.sum(known[:, species], axis=0)
        return 0.5 * float(sums[0] / sums[1]) if sums[1] else math.nan

    def alone(self, time: float, own: list[int], beads: NDArray[np.float64]) -> bool:
        """Whether nobody else can have hit some beads between the pictures around a time.

        Parameters
        ----------
        time : float, [s]
        own : list of int
            Their tracks.
        beads : ndarray (k, 4)
            Place past the camera, radius [m] and speed [m/s] of each.
        """
        here = self._around(time, 1)
        last = min(here.stop, len(self._records))
        return all(
            _nobody_near(
                np.array(own),
                beads,
                record.ids,
                record.positions,
                record.displacement,
                record.velocities,
                record.radii,
                self.interval,
            )
            for record in (self._records[k] for k in range(here.start, last))
        )


@compiled
def _nobody_near(
    own: NDArray[np.int64],
    beads: NDArray[np.float64],
    ids: NDArray[np.int32],
    positions: NDArray[np.float64],
    displacement: NDArray[np.float64],
    velocities: NDArray[np.float64],
    radii: NDArray[np.float64],
    interval: float,
) -> bool:
    for k in range(ids.size):
        if (own == ids[k]).any():
            continue
        u, v = velocities[k]
        speed = math.sqrt(u * u + v * v)
        if speed != speed:
            speed = 0.0
        for j in range(beads.shape[0]):
            reach = beads[j, 2] + radii[k] + interval * (beads[j, 3] + speed)
            x = positions[k, 0] + displacement[0] - beads[j, 0]
            y = positions[k, 1] + displacement[1] - beads[j, 1]
            if math.sqrt(x * x + y * y) < reach:
                return False
    return True


@compiled
def _between(
    time: float, times: NDArray[np.float64], places: NDArray[np.float64]
) -> tuple[float, float]:
    """Place at a time, straight between two that are known; the last one after it."""
    k = int(np.searchsorted(times, time))
    if k == 0 or k == times.size:
        k = min(k, times.size - 1)
        return places[k, 0], places[k, 1]
    share = (time - times[k - 1]) / (times[k] - times[k - 1])
    x = places[k - 1, 0] + share * (places[k, 0] - places[k - 1, 0])
    y = places[k - 1, 1] + share * (places[k, 1] - places[k - 1, 1])
    return x, y


@compiled
def _learn(
    times: NDArray[np.float64],
    velocities: NDArray[np.float64],
    species: NDArray[np.int32],
    sums: NDArray[np.float64],
) -> float:
    """Time between two pictures, [s]: the middle one of some.

    Writes for each species the sum of the squares of the velocities and their number,
    (species, 2).
    """
    sums[:] = 0.0
    for k in range(species.size):
        square = velocities[k, 0] * velocities[k, 0] + velocities[k, 1] * velocities[k, 1]
        if square < np.inf:
            sums[species[k], 0] += square
            sums[species[k], 1] += 1.0
    return float(np.median(times[1:] - times[:-1])) if times.size > 1 else math.inf
