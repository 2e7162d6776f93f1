"""The way of one bead, cut into straight flights, and the kinks between them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.stages.contacts.flights import Line, best_break, fit_line

if TYPE_CHECKING:
    from numpy.typing import NDArray

LONGEST = 48
"""Places of a flight that are used at most."""

FEWEST = 4
"""Places of a flight below which it says nothing of being straight."""

_ROOM = 4 * LONGEST
# On each side of a break that is looked for; two lines through fewer would fit anything.
_FEWEST_BREAK = 2
# What a break must gain in chi square: chance reaches 30 once in some ten thousand flights.
_GAIN = 30.0
# Scatter that is believed at least, over the stated variance: errors that a bead keeps for some
# pixels bend its way a little, and would cut it into pieces.
_LEAST_VARIANCE = 0.25
# Way over which light, shadow and outline misplace a bead alike, in radii.
_SAME = 0.5
# Places that the best break may move when all of the flight behind it is known.
_MOVED = 2


class Kink(NamedTuple):
    """Where one flight of a bead ends and the next begins.

    Parameters
    ----------
    track, species : int
    radius, radius_error : float, [m]
    before, after : Line
        Through places past the camera.
    last, first : float, [s]
        Times of the last picture before and of the first after.
    shared_error : float, [m]
        Of a coordinate of all places alike, which their scatter does not show.
    """

    track: int
    species: int
    radius: float
    radius_error: float
    before: Line
    after: Line
    last: float
    first: float
    shared_error: float


class TrackHistory:
    """The last flights of one track.

    Parameters
    ----------
    track, species : int
    """

    def __init__(self, track: int, species: int) -> None:
        self.track = track
        self.species = species
        self.radius = self.radius_error = 0.0
        self._times = np.empty(_ROOM)
        self._places = np.empty((_ROOM, 2))
        self._errors = np.empty(_ROOM)
        self._end = 0
        # First place of this flight and of the one before; -1 when that is not known.
        self._first = 0
        self._before = -1

    def push(
        self, time: float, place: NDArray[np.float64], error: float, variance: float, gap: float
    ) -> tuple[Kink | None, Line | None]:
        """Take the next place.

        Parameters
        ----------
        time : float, [s]
        place : ndarray (2,), [m]
            Past the camera.
        error : float, [m]
            Of a coordinate.
        variance : float
            What variances of places of this species are, over what their errors say.
        gap : float, [s]
            Without a place for longer, what happened is not known.

        Returns
        -------
        kink : Kink or None
            One whose flights before and after are both known now.
        flight : Line or None
            One that ended now.
        """
        kink = None
        if self._end and time - self._times[self._end - 1] > gap:
            kink = self.finish(variance)
            self._end = self._first = 0
            self._before = -1
        if self._end == _ROOM:
            self._make_room()
        self._times[self._end], self._errors[self._end] = time, error
        self._places[self._end] = place
        self._end += 1
        if kink is not None:
            return kink, None
        return self._cut(variance)

    def finish(self, variance: float) -> Kink | None:
        """The kink before this flight, which ends here."""
        return self._kink(self._end, variance)

    def _cut(self, variance: float) -> tuple[Kink | None, Line | None]:
        here = slice(self._first, self._end)
        first, gain = best_break(
            self._times[here], self._places[here], self._errors[here], _FEWEST_BREAK
        )
        # The first place after a turn alone would take the last one before it along.
        settled = self._first + first + _FEWEST_BREAK < self._end
        if settled and gain > _GAIN * max(variance, _LEAST_VARIANCE):
            end = self._first + first
            flight = self._line(self._first, end)
            kink = self._kink(end, variance)
            self._before, self._first = self._first, end
            return kink, flight
        if self._end - self._first <= LONGEST:
            return None, None
        kink = self._kink(self._end, variance)
        self._before = -1
        self._first += 1
        return kink, None if kink is None else self._line(self._first, self._end)

    def _line(self, first: int, end: int) -> Line:
        here = slice(first, end)
        return fit_line(self._times[here], self._places[here], self._errors[here])

    def _kink(self, end: int, variance: float) -> Kink | None:
        """The kink where this flight began, when it ends at a place."""
        if self._before < 0:
            return None
        start = max(self._before, self._first - LONGEST)
        here = slice(start, end)
        first = (
            start
            + best_break(self._times[here], self._places[here], self._errors[here], _FEWEST_BREAK)[
                0
            ]
        )
        self._before = -1
        if min(first - start, end - first) < FEWEST or abs(first - self._first) > _MOVED:
            return None
        # What places share for some pixels differs between the ends of a flight.
        shared = math.sqrt(max(1.0 - variance, 0.0)) * float(np.mean(self._errors[here]))
        before, after = self._line(start, first), self._line(first, end)
        return Kink(
            self.track,
            self.species,
            self.radius,
            self.radius_error,
            before.with_errors(variance, shared, _SAME * self.radius),
            after.with_errors(variance, shared, _SAME * self.radius),
            float(self._times[first - 1]),
            float(self._times[first]),
            shared,
        )

    def _make_room(self) -> None:
        keep = self._before if self._before >= 0 else self._first
        keep = max(keep, self._first - LONGEST)
        for values in (self._times, self._places, self._errors):
            values[: self._end - keep] = values[keep : self._end].copy()
        self._first, self._end = self._first - keep, self._end - keep
        self._before = 0 if self._before >= 0 else -1
