"""The last pictures of a tray: how it moved, how warm its gas was, who else was near."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.records import Tracks

# Pictures on each side from which the motion of a tray is measured when it swings or rests, and
# when it does anything else.
_WIDE, _NARROW = 45, 4
_FEWEST = 2 * _NARROW
# Frequencies of a swing that are tried, [1/s].
_FREQUENCIES = np.geomspace(0.5, 6.0, 40)
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
        noise = float(np.sqrt(np.mean(np.diff(places[wide], 4, axis=0) ** 2) / _FOURTH))
        rest = _slope(_powers(times[wide], 1), places[wide])
        swing = _slope(_swing(times[wide], places[wide]), places[wide])
        if rest.left - swing.left < _SWINGS * noise**2:
            # A swing too weak to be seen may still be there.
            return rest.velocity, noise * math.hypot(rest.factor, 0.5 * swing.factor)
        quiet = 2 * times[wide].size * (_QUIET * noise) ** 2
        if swing.left < max(_EXPLAINED * rest.left, quiet):
            scatter = math.sqrt(swing.left / (2 * times[wide].size))
            error = _LASTING * max(noise, scatter) * swing.factor
            return swing.velocity, math.hypot(error, _MISSCALED * math.hypot(*swing.velocity))
        other = _slope(_powers(times[narrow], 3), places[narrow])
        return other.velocity, _LASTING * noise * other.factor

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


class _Slope(NamedTuple):
    """Slope at time 0 of what was fitted.

    Parameters
    ----------
    velocity : ndarray (2,), [m/s]
    left : float, [m^2]
        Sum of the squares that are left.
    factor : float, [1/s]
        Error of the slope over that of a place.
    """

    velocity: NDArray[np.float64]
    left: float
    factor: float


def _slope(terms: NDArray[np.float64], places: NDArray[np.float64]) -> _Slope:
    """Fit terms, (pictures, n), of which the second alone has a slope at 0, of 1."""
    inverse = np.linalg.pinv(terms)
    found = inverse @ places
    left = float(np.sum((places - terms @ found) ** 2))
    return _Slope(found[1], left, float(np.linalg.norm(inverse[1])))


def _powers(times: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
    return np.vander(times, degree + 1, increasing=True)


def _swing(times: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Terms of a swing that dies away about a resting place, of the frequency that fits best.

    The first slope is that of its sine, divided by the angular frequency.
    """
    omega = 2.0 * math.pi * _FREQUENCIES[:, None]
    sine, cosine = np.sin(omega * times), np.cos(omega * times)
    # Terms in t sin have no slope at 0; that in t cos has one, and is taken off the sine's.
    decay = times * cosine - sine / omega
    ones = np.ones_like(sine)
    terms = np.stack([ones, sine / omega, cosine, decay, times * sine], axis=2)
    turned = terms.transpose(0, 2, 1)
    projected = turned @ places
    explained = projected * (np.linalg.pinv(turned @ terms, hermitian=True) @ projected)
    best: NDArray[np.float64] = terms[np.argmax(explained.sum(axis=(1, 2)))]
    return best


def _squares(tracks: Tracks) -> NDArray[np.float64]:
    """Of each species, sum of the squares of the velocities and their number, (species, 2)."""
    squares = np.sum(np.square(tracks.velocities), axis=1)
    known = np.isfinite(squares)
    sums = [
        np.bincount(tracks.species[known], weights, minlength=tracks.expected.size)
        for weights in (squares[known], None)
    ]
    return np.column_stack(sums)
