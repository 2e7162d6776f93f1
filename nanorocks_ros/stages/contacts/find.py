"""From tracks to single contacts: rebounds from the side walls, and collisions of two beads."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import PairCollision, Rebound
from nanorocks_ros.stages.contacts.flights import Line, Meeting, meeting
from nanorocks_ros.stages.contacts.history import LONGEST, Kink, TrackHistory
from nanorocks_ros.stages.contacts.surroundings import Surroundings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Tracks

_NS = 1e9
# Longer than this many intervals between two pictures, anything may have happened.
_GAP = 1.5
# Of grains with corners a collision says nothing of the kind.
_NOT_ROUND = ('JSC-1',)
# Flights from which the scatter of places is learnt, their fewest places, and how far they lead
# in errors of a place: beads at rest are always misplaced alike.
_FLIGHTS, _FEWEST_PLACES, _LEAST_WAY = 200, 8, 8.0
_FEWEST_FLIGHTS = 10
# Flights used are as straight as chance leaves all but one in a thousand.
_STRAIGHT = 4.0
# Standard errors beyond which a contact is no such contact.
_FAR = 4.0
# Of the speed at which beads meet, the largest error: below, its own error hardly bends the ratio.
_LEAST_SIGNAL = 12.0
# How far off the wall a rebound may be seen, in radii; and in sums of radii, how close or far
# two beads: less is one over the other, whose places are not good then.
_WALL_SLACK = 0.15
_NEAREST, _FURTHEST = 0.9, 1.05
# Beads that go on together have merged.
_MERGED = 0.1
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
        self._waiting: list[tuple[Kink, Meeting]] = []
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
        self._waiting = [one for one in self._waiting if one[1].time > horizon]
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
            history = self._histories.setdefault(number, TrackHistory(number, species))
            history.radius = self._radius(species, float(tracks.radii[row]))
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

    def _radius(self, species: int, measured: float) -> float:
        one = self._tray.species[species]
        return 0.5 * one.diameter if one.diameter_low == one.diameter_high else measured

    def _mass(self, kink: Kink) -> float:
        return self._tray.species[kink.species].density * 4.0 / 3.0 * math.pi * kink.radius**3

    def _learn(self, species: int, flight: Line) -> None:
        """Scatter of places over what their errors say; those hold what pictures share, too."""
        if flight.count < _FEWEST_PLACES:
            return
        way = math.hypot(*flight.velocity) / math.sqrt(flight.velocity_variance)
        if way < _LEAST_WAY:
            return
        known = self._scatter[species]
        known.append(flight.chi_square / (2 * flight.count - 4))
        if len(known) >= _FEWEST_FLIGHTS:
            self._variances[species] = float(np.median(known))

    def _contact(self, kink: Kink) -> tuple[Rebound | PairCollision, ...]:
        when = meeting([(kink.before, kink.after)])
        if not (_straight(kink) and self._between(kink, when)):
            return ()
        rebound = self._rebound(kink, when)
        if rebound is not None:
            return (rebound,)
        for other, its in self._waiting:
            pair = self._pair(other, kink) if self._together(when, its) else None
            if pair is not None:
                self._waiting = [one for one in self._waiting if one[0] is not other]
                return (pair,)
        self._waiting.append((kink, when))
        return ()

    def _between(self, kink: Kink, when: Meeting) -> bool:
        """Whether the contact was between the pictures before and after it."""
        slack = _EARLY * self._around.interval + _FAR * when.error
        return kink.last - slack < when.time < kink.first + slack

    def _together(self, one: Meeting, other: Meeting) -> bool:
        slack = self._around.interval + _FAR * math.hypot(one.error, other.error)
        return abs(one.time - other.time) < slack

    def _stamp_ns(self, time: float) -> int:
        return self._first_ns + round(time * _NS)

    def _rebound(self, kink: Kink, when: Meeting) -> Rebound | None:
        shift, motion, motion_error = self._around.motion(when.time)
        place, variance = _place(kink, when.time)
        place = place - shift
        slack = _WALL_SLACK * kink.radius + _FAR * math.sqrt(variance)
        incoming_error, outgoing_error = _errors(kink)
        along_error = math.hypot(incoming_error, outgoing_error)
        for wall in range(4):
            axis, high = divmod(wall, 2)
            sign = 1.0 if high else -1.0
            room = self._tray.dimensions[axis] - place[axis] if high else place[axis]
            incoming = sign * float(kink.before.velocity[axis] - motion[axis])
            outgoing = -sign * float(kink.after.velocity[axis] - motion[axis])
            along = [float(one.velocity[1 - axis]) for one in (kink.before, kink.after)]
            if (
                abs(room - kink.radius) < slack
                and incoming > _LEAST_SIGNAL * math.hypot(incoming_error, motion_error)
                and outgoing > 0.0
                and abs(along[1] - along[0]) < _FAR * along_error
                and self._alone(when, [kink])
            ):
                return Rebound(
                    stamp_ns=self._stamp_ns(when.time),
                    tray=self._tray.number,
                    track=kink.track,
                    species=kink.species,
                    wall=wall,
                    incoming=incoming,
                    incoming_error=incoming_error,
                    outgoing=outgoing,
                    outgoing_error=outgoing_error,
                    tangential_incoming=along[0],
                    tangential_outgoing=along[1],
                    tangential_error=along_error,
                    wall_velocity=sign * float(motion[axis]),
                    wall_velocity_error=motion_error,
                    place=place,
                )
        return None

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

    def _pair(self, first: Kink, second: Kink) -> PairCollision | None:
        kinks = [first, second]
        when = meeting([(one.before, one.after) for one in kinks])
        if not all(self._between(one, when) for one in kinks):
            return None
        (here, variance), (there, its) = (_place(one, when.time) for one in kinks)
        separation = there - here
        distance = math.hypot(*separation)
        turn = sum(float(np.sum((one.after.velocity - one.before.velocity) ** 2)) for one in kinks)
        relative = [second.before.velocity - first.before.velocity,
                    second.after.velocity - first.after.velocity]  # fmt: skip
        reach = first.radius + second.radius
        shift = self._around.motion(when.time)[0]
        record = PairCollision(
            stamp_ns=self._stamp_ns(when.time),
            tray=self._tray.number,
            tracks=np.array([one.track for one in kinks], dtype=np.int32),
            species=np.array([one.species for one in kinks], dtype=np.int32),
            radii=np.array([one.radius for one in kinks]),
            masses=np.array([self._mass(one) for one in kinks]),
            before=np.array([one.before.velocity for one in kinks]),
            after=np.array([one.after.velocity for one in kinks]),
            before_errors=np.array([_errors(one)[0] for one in kinks]),
            after_errors=np.array([_errors(one)[1] for one in kinks]),
            separation=separation,
            separation_error=math.sqrt(
                variance
                + its
                + first.shared_error**2
                + second.shared_error**2
                + when.error**2 * float(relative[0] @ relative[0])
            ),
            temperatures=np.array(
                [self._around.temperature(when.time, one.species) for one in kinks]
            ),
            height=self._tray.dimensions[2],
            place=here - shift,
        )
        good = (
            turn > 0.0
            and _NEAREST * reach < distance < _FURTHEST * reach
            and when.chi_square < _STRAIGHT**2 + 3.0
            and math.hypot(*relative[1]) > _MERGED * math.hypot(*relative[0])
            and _only_these_two(record)
            and self._alone(when, kinks)
        )
        return record if good else None


def _only_these_two(pair: PairCollision) -> bool:
    """Whether they met, exchanged momentum along their line of centres, and with nobody else."""
    normal = pair.separation / math.hypot(*pair.separation)
    across = np.array([-normal[1], normal[0]])
    errors = np.hypot(pair.before_errors, pair.after_errors)
    change = pair.after - pair.before
    approach = -float((pair.before[1] - pair.before[0]) @ normal)
    error = float(np.hypot(*pair.before_errors))
    lost = pair.masses @ change
    lost_error = math.hypot(*(pair.masses * errors))
    slip = float((change[1] - change[0]) @ across)
    # A line of centres that is turned a little makes a slip of the change along it.
    turned = pair.separation_error / math.hypot(*pair.separation)
    slip_error = math.hypot(*errors, turned * float((change[1] - change[0]) @ normal))
    return bool(
        approach > _LEAST_SIGNAL * error
        and float(lost @ lost) < _FAR**2 * lost_error**2
        and abs(slip) < _FAR * slip_error
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
        freedom = 2 * line.count - 4
        if line.chi_square > freedom + _STRAIGHT * math.sqrt(2.0 * freedom):
            return False
    return True
