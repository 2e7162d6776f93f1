"""From tracks to single contacts: rebounds from the side walls, and collisions of two beads."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import PairCollision, Rebound
from nanorocks_ros.stages.contacts.checks import FAR, LEAST_SIGNAL, only_these_two
from nanorocks_ros.stages.contacts.flights import Line, Meeting, meeting
from nanorocks_ros.stages.contacts.history import LONGEST, Kink, TrackHistory
from nanorocks_ros.stages.contacts.surroundings import Surroundings
from nanorocks_ros.stages.contacts.waiting import Waiting

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Tracks

_NS = 1e9
LATEST_NS = 2_000_000_000
"""A contact is known that much later at the latest, at 30 pictures a second."""

# Intervals between two pictures: a bead not seen for longer may have done anything; and a contact
# while it was not seen is not used.
_GAP = 3.5
_CONTACT_GAP = 1.5
# Of grains with corners a collision says nothing of the kind.
_NOT_ROUND = ('JSC-1',)
# Flights from which the scatter of places is learnt, their fewest places, and how far they lead
# in errors of a place: beads at rest are always misplaced alike.
_FLIGHTS, _FEWEST_PLACES, _LEAST_WAY = 200, 8, 8.0
_FEWEST_FLIGHTS = 10
# Flights used are as straight as chance leaves all but one in a thousand.
_STRAIGHT = 4.0
# How far off the wall a rebound may be seen, in radii; and in sums of radii, how close or far
# two beads: less is one over the other, whose places are not good then.
_WALL_SLACK = 0.15
_NEAREST, _FURTHEST = 0.9, 1.05
# Error of a measured radius, over it, that outlines leave besides the stated one.
_OUTLINE = 0.02
# Part of an interval by which the contact may lie outside the pictures around it.
_EARLY = 0.3


class ContactFinder:
    """Finds rebounds and collisions in the tracks of one tray.

    Parameters
    ----------
    tray : Tray
    """

    def __init__(self, tray: Tray) -> None:
        self._tray = tray
        self._round = [one.material not in _NOT_ROUND for one in tray.species]
        self._restart()

    def _restart(self) -> None:
        self._first_ns = 0
        self._last_ns: int | None = None
        self._histories: dict[int, TrackHistory] = {}
        self._around = Surroundings(3 * LONGEST)
        self._waiting: list[Waiting] = []
        self._scatter: list[deque[float]] = [deque(maxlen=_FLIGHTS) for _ in self._round]
        self._variances = [1.0 for _ in self._round]

    def push(self, tracks: Tracks) -> tuple[Rebound | PairCollision, ...]:
        """Take the next picture; a contact is known when the flights after it are.

        That is a second and a half later at most. A stamp that goes back starts all afresh.
        """
        if self._last_ns is not None and tracks.stamp_ns <= self._last_ns:
            self._restart()
        if self._last_ns is None:
            self._first_ns = tracks.stamp_ns
        self._last_ns = tracks.stamp_ns
        time = (tracks.stamp_ns - self._first_ns) / _NS
        self._around.push(time, tracks)
        kinks = self._kinks(time, tracks)
        horizon = time - 2 * LONGEST * self._around.interval
        self._waiting = [one for one in self._waiting if one.when.time > horizon]
        return tuple(found for kink in kinks for found in self._contact(kink))

    def flush(self) -> tuple[Rebound | PairCollision, ...]:
        """The contacts whose flights afterwards end with the recording."""
        ends = [
            one.finish(self._variances[one.species]) for _, one in sorted(self._histories.items())
        ]
        self._histories = {}
        return tuple(found for kink in ends if kink for found in self._contact(kink))

    def _kinks(self, time: float, tracks: Tracks) -> list[Kink]:
        found = []
        gap = _GAP * self._around.interval
        places = tracks.positions + tracks.displacement
        columns = (tracks.ids.tolist(), tracks.species.tolist(), tracks.position_errors.tolist())
        for row, (number, species, error) in enumerate(zip(*columns, strict=True)):
            if not (tracks.seen[row] and self._round[species]):
                continue
            history = self._histories.get(number)
            if history is None:
                history = self._histories[number] = TrackHistory(number, species)
            self._measure(history, float(tracks.radii[row]), float(tracks.radius_errors[row]))
            kink, flight = history.push(time, places[row], error, self._variances[species], gap)
            if kink is not None:
                found.append(kink)
            if flight is not None:
                self._learn(species, flight)
        for number in self._histories.keys() - set(columns[0]):
            history = self._histories.pop(number)
            kink = history.finish(self._variances[history.species])
            if kink is not None:
                found.append(kink)
        return found

    def _measure(self, history: TrackHistory, radius: float, error: float) -> None:
        one = self._tray.species[history.species]
        history.radius, history.radius_error = radius, math.hypot(error, _OUTLINE * radius)
        if one.diameter_low == one.diameter_high:
            history.radius, history.radius_error = 0.5 * one.diameter, 0.0

    def _mass(self, kink: Kink) -> float:
        return self._tray.species[kink.species].density * 4.0 / 3.0 * math.pi * kink.radius**3

    def _learn(self, species: int, flight: Line) -> None:
        """Scatter of places over what their errors say; those hold what pictures share, too."""
        if flight.used < _FEWEST_PLACES:
            return
        way = math.hypot(*flight.velocity) / math.sqrt(flight.velocity_variance)
        if way < _LEAST_WAY:
            return
        known = self._scatter[species]
        known.append(flight.chi_square / (2 * flight.used - 4))
        if len(known) >= _FEWEST_FLIGHTS:
            self._variances[species] = float(np.median(known))

    def _contact(self, kink: Kink) -> tuple[Rebound | PairCollision, ...]:
        when = meeting([(kink.before, kink.after)])
        if not (_straight(kink) and self._between(kink, when)):
            return ()
        rebound = self._rebound(kink, when)
        if rebound is not None:
            return (rebound,)
        this = Waiting.of(kink, when)
        for other in self._waiting:
            # Hundreds wait: a quick look at each.
            soon = abs(other.when.time - when.time) < this.slack + other.slack
            near = soon and other.near(this, when.time) and self._together(when, other.when)
            pair = self._pair((other.kink, kink)) if near else None
            if pair is not None:
                self._waiting = [one for one in self._waiting if one is not other]
                return (pair,)
        self._waiting.append(this._replace(slack=this.slack + self._around.interval))
        return ()

    def _between(self, kink: Kink, when: Meeting) -> bool:
        """Whether the contact was between two pictures, one right after the other."""
        slack = _EARLY * self._around.interval + FAR * when.error
        if kink.first - kink.last > _CONTACT_GAP * self._around.interval:
            return False
        return kink.last - slack < when.time < kink.first + slack

    def _together(self, one: Meeting, other: Meeting) -> bool:
        slack = self._around.interval + FAR * math.hypot(one.error, other.error)
        return abs(one.time - other.time) < slack

    def _stamp_ns(self, time: float) -> int:
        return self._first_ns + round(time * _NS)

    def _rebound(self, kink: Kink, when: Meeting) -> Rebound | None:
        place, variance = _place(kink, when.time)
        slack = _WALL_SLACK * kink.radius + FAR * math.sqrt(variance)
        place = place - self._around.displacement(when.time)
        for wall in range(4):
            axis, high = divmod(wall, 2)
            room = self._tray.dimensions[axis] - place[axis] if high else place[axis]
            if abs(room - kink.radius) < slack:
                change = float(kink.after.velocity[1 - axis] - kink.before.velocity[1 - axis])
                if abs(change) < FAR * math.hypot(*_errors(kink)) and self._alone(when, [kink]):
                    return self._rebound_from(wall, kink, when, place)
        return None

    def _rebound_from(
        self, wall: int, kink: Kink, when: Meeting, place: NDArray[np.float64]
    ) -> Rebound | None:
        axis, high = divmod(wall, 2)
        outward = 1.0 if high else -1.0
        motion, motion_error = self._around.motion(when.time)
        incoming_error, outgoing_error = _errors(kink)
        before, after = kink.before.velocity, kink.after.velocity
        found = Rebound(
            stamp_ns=self._stamp_ns(when.time),
            tray=self._tray.number,
            track=kink.track,
            species=kink.species,
            wall=wall,
            incoming=outward * float(before[axis] - motion[axis]),
            incoming_error=incoming_error,
            outgoing=outward * float(motion[axis] - after[axis]),
            outgoing_error=outgoing_error,
            tangential_incoming=float(before[1 - axis]),
            tangential_outgoing=float(after[1 - axis]),
            tangential_error=math.hypot(incoming_error, outgoing_error),
            wall_velocity=outward * float(motion[axis]),
            wall_velocity_error=motion_error,
            place=place,
        )
        signal = LEAST_SIGNAL * math.hypot(incoming_error, motion_error)
        return found if found.incoming > signal and found.outgoing > 0.0 else None

    def _alone(self, when: Meeting, kinks: list[Kink]) -> bool:
        beads = [
            (
                one.track,
                _place(one, when.time)[0],
                one.radius,
                max(math.hypot(*one.before.velocity), math.hypot(*one.after.velocity)),
            )
            for one in kinks
        ]
        return self._around.alone(when.time, beads)

    def _pair(self, kinks: tuple[Kink, Kink]) -> PairCollision | None:
        when = meeting([(one.before, one.after) for one in kinks])
        if not all(self._between(one, when) for one in kinks):
            return None
        distance = math.hypot(*(_place(kinks[1], when.time)[0] - _place(kinks[0], when.time)[0]))
        reach = kinks[0].radius + kinks[1].radius
        if (
            not _NEAREST * reach < distance < _FURTHEST * reach
            or when.chi_square > FAR**2 + 3.0
            or not self._alone(when, list(kinks))
        ):
            return None
        found = self._collision(kinks, when)
        return found if only_these_two(found) else None

    def _collision(self, kinks: tuple[Kink, Kink], when: Meeting) -> PairCollision:
        (here, variance), (there, its) = (_place(one, when.time) for one in kinks)
        before = np.array([one.before.velocity for one in kinks])
        approach = before[1] - before[0]
        shared = sum(one.shared_error**2 for one in kinks)
        mistimed = when.error**2 * float(approach @ approach)
        temperatures = [self._around.temperature(when.time, one.species) for one in kinks]
        errors = np.array([_errors(one) for one in kinks])
        return PairCollision(
            stamp_ns=self._stamp_ns(when.time),
            tray=self._tray.number,
            tracks=np.array([one.track for one in kinks], dtype=np.int32),
            species=np.array([one.species for one in kinks], dtype=np.int32),
            radii=np.array([one.radius for one in kinks]),
            radius_errors=np.array([one.radius_error for one in kinks]),
            masses=np.array([self._mass(one) for one in kinks]),
            before=before,
            after=np.array([one.after.velocity for one in kinks]),
            before_errors=errors[:, 0],
            after_errors=errors[:, 1],
            separation=there - here,
            separation_error=math.sqrt(variance + its + shared + mistimed),
            temperatures=np.array(temperatures),
            height=self._tray.dimensions[2],
            place=here - self._around.displacement(when.time),
        )


def _place(kink: Kink, time: float) -> tuple[NDArray[np.float64], float]:
    """Where the bead was at the contact, by both flights, and the variance of a coordinate."""
    before, after = kink.before.variance_at(time), kink.after.variance_at(time)
    share = after / (before + after)
    place = share * kink.before.at(time) + (1.0 - share) * kink.after.at(time)
    return place, share * before


def _errors(kink: Kink) -> tuple[float, float]:
    """Of a component of the velocities before and after, [m/s]."""
    return math.sqrt(kink.before.velocity_variance), math.sqrt(kink.after.velocity_variance)


def _straight(kink: Kink) -> bool:
    for line in (kink.before, kink.after):
        freedom = 2 * line.used - 4
        if line.chi_square > freedom + _STRAIGHT * math.sqrt(2.0 * freedom):
            return False
    return True
