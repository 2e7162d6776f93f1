"""From tracks to single contacts: rebounds from the side walls, and collisions of two beads."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.records import PairCollision, Rebound
from nanorocks_ros.stages.contacts.flight_segments import LONGEST, Histories, Kink
from nanorocks_ros.stages.contacts.line_fits import Meeting, when_met
from nanorocks_ros.stages.contacts.pair_tests import FAR, LEAST_SIGNAL, only_these_two
from nanorocks_ros.stages.contacts.tray_history import Surroundings
from nanorocks_ros.stages.contacts.unmatched_jumps import Waiting

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
# Flights used are as straight as chance leaves all but one in a thousand.
_STRAIGHT = 4.0
# How far off the wall a rebound may be seen, in radii; and in sums of radii, how close or far
# two beads: less is one over the other, whose places are not good then.
_WALL_SLACK = 0.15
_NEAREST, _FURTHEST = 0.9, 1.05
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
        self.reset()

    def reset(self) -> None:
        """Forget all tracks; contacts that are held back are lost."""
        self._first_ns = 0
        self._last_ns: int | None = None
        self._histories = Histories(self._tray)
        self._around = Surroundings(3 * LONGEST)
        self._waiting = Waiting()

    def push(self, tracks: Tracks) -> tuple[Rebound | PairCollision, ...]:
        """Take the next picture; a contact is known when the flights after it are.

        That is a second and a half later at most. A stamp that goes back starts all afresh.
        """
        if self._last_ns is not None and tracks.stamp_ns <= self._last_ns:
            self.reset()
        if self._last_ns is None:
            self._first_ns = tracks.stamp_ns
        self._last_ns = tracks.stamp_ns
        time = (tracks.stamp_ns - self._first_ns) / _NS
        self._around.push(time, tracks)
        kinks = self._histories.push(time, tracks, _GAP * self._around.interval)
        self._waiting.forget(time - 2 * LONGEST * self._around.interval)
        return tuple(found for kink in kinks for found in self._contact(kink))

    def flush(self) -> tuple[Rebound | PairCollision, ...]:
        """Give out the contacts that are held back, at the end of a recording.

        A contact is held back until the flight after it ends, or is 48 places long. Here every
        flight ends with the last frame: the contacts before flights of at least 4 places are
        given out, as far as they pass the tests of `push`. Tracks that go on begin new flights.
        """
        kinks = self._histories.flush()
        return tuple(found for kink in kinks for found in self._contact(kink))

    def _mass(self, kink: Kink) -> float:
        return self._tray.species[kink.species].density * 4.0 / 3.0 * math.pi * kink.radius**3

    def _contact(self, kink: Kink) -> tuple[Rebound | PairCollision, ...]:
        when = Meeting(*when_met(kink.lines[None]))
        if not (_straight(kink.lines) and self._between(kink, when)):
            return ()
        rebound = self._rebound(kink, when)
        if rebound is not None:
            return (rebound,)
        for other in self._waiting.partners(kink, when, self._around.interval):
            pair = self._pair((other, kink))
            if pair is not None:
                self._waiting.remove(other)
                return (pair,)
        self._waiting.add(kink, when, self._around.interval)
        return ()

    def _between(self, kink: Kink, when: Meeting) -> bool:
        """Whether the contact was between two pictures, one right after the other."""
        slack = _EARLY * self._around.interval + FAR * when.error
        if kink.first - kink.last > _CONTACT_GAP * self._around.interval:
            return False
        return kink.last - slack < when.time < kink.first + slack

    def _stamp_ns(self, time: float) -> int:
        return self._first_ns + round(time * _NS)

    def _rebound(self, kink: Kink, when: Meeting) -> Rebound | None:
        x, y, variance = _place(kink.lines, when.time)
        shift_x, shift_y = self._around.displacement(when.time)
        place = x - shift_x, y - shift_y
        slack = _WALL_SLACK * kink.radius + FAR * math.sqrt(variance)
        for wall in range(4):
            axis, high = divmod(wall, 2)
            room = self._tray.dimensions[axis] - place[axis] if high else place[axis]
            if abs(room - kink.radius) < slack:
                change = float(kink.lines[1, 4 - axis] - kink.lines[0, 4 - axis])
                if abs(change) < FAR * math.hypot(*_errors(kink)) and self._alone(when, [kink]):
                    return self._rebound_from(wall, kink, when, np.array(place))
        return None

    def _rebound_from(
        self, wall: int, kink: Kink, when: Meeting, place: NDArray[np.float64]
    ) -> Rebound | None:
        axis, high = divmod(wall, 2)
        outward = 1.0 if high else -1.0
        motion, motion_error = self._around.motion(when.time)
        incoming_error, outgoing_error = _errors(kink)
        before, after = kink.before.velocity, kink.after.velocity
        rebound = Rebound(
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
        return rebound if rebound.incoming > signal and rebound.outgoing > 0.0 else None

    def _alone(self, when: Meeting, kinks: list[Kink]) -> bool:
        beads = np.empty((len(kinks), 4))
        for bead, kink in zip(beads, kinks, strict=True):
            speed = max(math.hypot(*line[3:5]) for line in kink.lines.tolist())
            bead[:] = *_place(kink.lines, when.time)[:2], kink.radius, speed
        return self._around.alone(when.time, [kink.track for kink in kinks], beads)

    def _pair(self, kinks: tuple[Kink, Kink]) -> PairCollision | None:
        when = Meeting(*when_met(np.array([kink.lines for kink in kinks])))
        if not all(self._between(kink, when) for kink in kinks):
            return None
        (x, y, _), (its_x, its_y, _) = (_place(kink.lines, when.time) for kink in kinks)
        distance = math.hypot(its_x - x, its_y - y)
        reach = kinks[0].radius + kinks[1].radius
        if (
            not _NEAREST * reach < distance < _FURTHEST * reach
            or when.chi_square > FAR**2 + 3.0
            or not self._alone(when, list(kinks))
        ):
            return None
        collision = self._collision(kinks, when)
        return collision if only_these_two(collision) else None

    def _collision(self, kinks: tuple[Kink, Kink], when: Meeting) -> PairCollision:
        places = [_place(kink.lines, when.time) for kink in kinks]
        here, there = (np.array(place[:2]) for place in places)
        before = np.array([kink.before.velocity for kink in kinks])
        approach = before[1] - before[0]
        shared = sum(kink.shared_error**2 for kink in kinks)
        mistimed = when.error**2 * float(approach @ approach)
        temperatures = [self._around.temperature(when.time, kink.species) for kink in kinks]
        errors = np.array([_errors(kink) for kink in kinks])
        return PairCollision(
            stamp_ns=self._stamp_ns(when.time),
            tray=self._tray.number,
            tracks=np.array([kink.track for kink in kinks], dtype=np.int32),
            species=np.array([kink.species for kink in kinks], dtype=np.int32),
            radii=np.array([kink.radius for kink in kinks]),
            radius_errors=np.array([kink.radius_error for kink in kinks]),
            masses=np.array([self._mass(kink) for kink in kinks]),
            before=before,
            after=np.array([kink.after.velocity for kink in kinks]),
            before_errors=errors[:, 0],
            after_errors=errors[:, 1],
            separation=there - here,
            separation_error=math.sqrt(sum(place[2] for place in places) + shared + mistimed),
            temperatures=np.array(temperatures),
            height=self._tray.dimensions[2],
            place=here - np.array(self._around.displacement(when.time)),
        )


@compiled
def _place(lines: NDArray[np.float64], time: float) -> tuple[float, float, float]:
    """Where the bead was at the contact, by both flights, and the variance of a coordinate."""
    before, after = lines[0], lines[1]
    since, to = time - before[0], time - after[0]
    variance = before[5] + before[6] * since * since
    its = after[5] + after[6] * to * to
    share = its / (variance + its)
    x = share * (before[1] + before[3] * since) + (1.0 - share) * (after[1] + after[3] * to)
    y = share * (before[2] + before[4] * since) + (1.0 - share) * (after[2] + after[4] * to)
    return x, y, share * variance


def _errors(kink: Kink) -> tuple[float, float]:
    """Of a component of the velocities before and after, [m/s]."""
    return math.sqrt(kink.lines[0, 6]), math.sqrt(kink.lines[1, 6])


@compiled
def _straight(lines: NDArray[np.float64]) -> bool:
    for k in range(2):
        freedom = 2.0 * lines[k, 8] - 4.0
        if lines[k, 7] > freedom + _STRAIGHT * math.sqrt(2.0 * freedom):
            return False
    return True
