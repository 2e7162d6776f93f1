"""Detection of contacts in tracks, rebounds from side walls and collisions, and of flights."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import (
    Contact,
    ContactOrFlight,
    FreeFlight,
    Measured,
    PairCollision,
    Rebound,
    Tracks,
)
from nanorocks_ros.stages.contacts.flight_segments import FlightSegments, VelocityJump
from nanorocks_ros.stages.contacts.line_fits import (
    Intersection,
    are_straight,
    contact_position,
    intersect_lines,
)
from nanorocks_ros.stages.contacts.pair_tests import MAX_SIGMAS, MIN_SIGNAL, is_isolated_collision
from nanorocks_ros.stages.contacts.track_buffer import MAX_FLIGHT_POINTS
from nanorocks_ros.stages.contacts.tray_history import TrayHistory
from nanorocks_ros.stages.contacts.unmatched_jumps import UnmatchedJumps
from nanorocks_ros.stages.flights.frame_times import FrameTimes
from nanorocks_ros.stages.flights.free_flights import free_flight
from nanorocks_ros.stages.flights.relative_drag import relative_drag
from nanorocks_ros.stages.flights.running_drag import RunningDrag
from nanorocks_ros.stages.stage import RestartingStage

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

_NS = 1e9

# In intervals between frames: longest gap within a flight (a bead may collide unseen in a longer
# one), and longest gap at a contact.
_MAX_GAP_FRAMES = 3.5
_MAX_CONTACT_FRAMES = 1.5
# Tolerance of the distance to the wall at a rebound, in radii; and distance of two beads at a
# collision, in sums of radii: nearer beads overlap in the image, and their positions are biased.
_WALL_TOLERANCE = 0.15
_MIN_DISTANCE, _MAX_DISTANCE = 0.9, 1.05
# Tolerance of the time of a contact around its two frames, in intervals between frames.
_TIME_TOLERANCE = 0.3
_UNKNOWN_DRAG = Measured(0.0, 1.0)


class ContactFinder(RestartingStage[Tracks, ContactOrFlight]):
    """Finds rebounds, collisions and the free flights between them in the tracks of one tray.

    A contact is complete when the flight after it ends, or is 48 positions long: at most 1.6 s
    later at 30 frames/s, and five pictures more where stamps are off by chance. Lines are fitted
    in the clock of the gas, by the drag that the flights so far show.

    Parameters
    ----------
    tray : Tray
    drag : Measured, optional, [1/s]
        Prior of the drag of the gas.
    acceleration : tuple of 2 floats, optional, [m/s^2]
        Of all beads between contacts, as by gravity; along columns and rows.
    """

    clock = Tracks

    def __init__(
        self,
        tray: Tray,
        drag: Measured = _UNKNOWN_DRAG,
        acceleration: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self._tray = tray
        self._prior = drag
        self._acceleration = np.array(acceleration)
        self.reset()

    def _restart(self, stamp_ns: int | None = None) -> None:
        """Forget all tracks; contacts that are held back are lost."""
        del stamp_ns
        self._first_ns: int | None = None
        x, y = self._acceleration.tolist()
        self._segments = FlightSegments(self._tray, (x, y))
        self._history = TrayHistory(3 * MAX_FLIGHT_POINTS)
        self._frame_times = FrameTimes()
        self._unmatched = UnmatchedJumps()
        self._drag = RunningDrag(self._prior)
        self._segments.use_drag(self._drag.drag)

    def _process(self, record: Tracks) -> tuple[ContactOrFlight, ...]:
        """Add the tracks of a frame and return the contacts that are complete now."""
        if self._first_ns is None:
            self._first_ns = record.stamp_ns
        time = (record.stamp_ns - self._first_ns) / _NS
        return tuple(
            found
            for taken, tracks in self._frame_times.push(time, record)
            for found in self._follow(taken, tracks)
        )

    def _follow(self, time: float, tracks: Tracks) -> tuple[ContactOrFlight, ...]:
        """Add the tracks of a picture that was taken at a time, [s]."""
        self._history.push(time, tracks)
        jumps = self._segments.push(time, tracks, _MAX_GAP_FRAMES * self._history.interval)
        self._unmatched.drop_before(time - 2 * MAX_FLIGHT_POINTS * self._history.interval)
        contacts = [contact for jump in jumps for contact in self._contact_at(jump)]
        flights = self._flights()
        if self._drag.push(time, flights):
            self._segments.use_drag(self._drag.drag)
        return (*contacts, *flights)

    @property
    def noise(self) -> NDArray[np.float64]:
        """Variance of positions about flights over that by their errors, (species,)."""
        return self._segments.noise

    @property
    def late(self) -> float:
        """How far pictures are off the times of their stamps, [s]; 0 where they are not."""
        return self._frame_times.scatter

    def _flights(self) -> list[FreeFlight]:
        return [
            free_flight(
                self._tray,
                flight,
                self._first_ns or 0,
                self._history.temperature(float(flight.bend[0]), flight.species),
            )
            for flight in self._segments.take_flights()
        ]

    def flush(self) -> tuple[ContactOrFlight, ...]:
        """Give out the contacts that are held back, at the end of a recording.

        A contact is held back until the flight after it ends, or is 48 positions long. Here every
        flight ends with the last frame: the contacts before flights of at least 4 positions are
        given out, as far as they pass the tests of `push`. Tracks that go on begin new flights.
        """
        held = [
            found
            for time, tracks in self._frame_times.flush()
            for found in self._follow(time, tracks)
        ]
        jumps = self._segments.flush()
        contacts = [contact for jump in jumps for contact in self._contact_at(jump)]
        return (*held, *contacts, *self._flights())

    def _mass(self, jump: VelocityJump) -> float:
        """Mass of a bead, [kg]; of density 1 where one is not known, since ratios count."""
        density = self._tray.species[jump.species].density
        if any(math.isnan(species.density) for species in self._tray.species):
            density = 1.0
        return density * 4.0 / 3.0 * math.pi * jump.radius**3

    def _contact_at(self, jump: VelocityJump) -> tuple[Contact, ...]:
        crossing = Intersection(*intersect_lines(jump.lines[None]))
        if not (are_straight(jump.lines) and self._is_between_frames(jump, crossing)):
            return ()
        jump = jump.at(crossing.time, self._acceleration)
        rebound = self._rebound(jump, crossing)
        if rebound is not None:
            return (rebound,)
        for earlier in self._unmatched.candidates(jump, crossing, self._history.interval):
            pair = self._pair((earlier, jump))
            if pair is not None:
                self._unmatched.remove(earlier)
                return (pair,)
        self._unmatched.add(jump, crossing, self._history.interval)
        return ()

    def _is_between_frames(self, jump: VelocityJump, crossing: Intersection) -> bool:
        """Whether the contact lies between two consecutive frames."""
        slack = _TIME_TOLERANCE * self._history.interval + MAX_SIGMAS * crossing.error
        if jump.first - jump.last > _MAX_CONTACT_FRAMES * self._history.interval:
            return False
        return jump.last - slack < crossing.time < jump.first + slack

    def _stamp_ns(self, time: float) -> int:
        return (self._first_ns or 0) + round(time * _NS)

    def _rebound(self, jump: VelocityJump, crossing: Intersection) -> Rebound | None:
        x, y, variance = contact_position(jump.lines, crossing.time)
        shift_x, shift_y = self._history.displacement(crossing.time)
        position = x - shift_x, y - shift_y
        slack = _WALL_TOLERANCE * jump.radius + MAX_SIGMAS * math.sqrt(variance)
        for wall in range(4):
            axis, high = divmod(wall, 2)
            gap = self._tray.dimensions[axis] - position[axis] if high else position[axis]
            if abs(gap - jump.radius) < slack:
                change = float(jump.lines[1, 4 - axis] - jump.lines[0, 4 - axis])
                limit = MAX_SIGMAS * math.hypot(*_velocity_errors(jump))
                if abs(change) < limit and self._is_isolated(crossing, [jump]):
                    return self._rebound_record(wall, jump, crossing, np.array(position))
        return None

    def _rebound_record(
        self, wall: int, jump: VelocityJump, crossing: Intersection, position: NDArray[np.float64]
    ) -> Rebound | None:
        axis, high = divmod(wall, 2)
        outward = 1.0 if high else -1.0
        wall_motion, wall_error = self._history.velocity(crossing.time)
        incoming_error, outgoing_error = _velocity_errors(jump)
        before, after = jump.before.velocity, jump.after.velocity
        drag_before, drag_after = self._drag_times(jump, crossing)
        rebound = Rebound(
            stamp_ns=self._stamp_ns(crossing.time),
            tray=self._tray.number,
            track=jump.track,
            species=jump.species,
            wall=wall,
            incoming=Measured(outward * float(before[axis] - wall_motion[axis]), incoming_error),
            outgoing=Measured(outward * float(wall_motion[axis] - after[axis]), outgoing_error),
            tangential_incoming=float(before[1 - axis]),
            tangential_outgoing=float(after[1 - axis]),
            tangential_error=math.hypot(incoming_error, outgoing_error),
            wall_velocity=Measured(outward * float(wall_motion[axis]), wall_error),
            place=position,
            drag=self._segments.drag,
            incoming_drag_time=drag_before,
            outgoing_drag_time=drag_after,
            friction_length=self._friction_length(jump, crossing.time),
            temperature=self._history.temperature(crossing.time, jump.species),
            free_height=max(self._tray.dimensions[2] - 2.0 * jump.radius, 0.0),
        )
        signal = MIN_SIGNAL * math.hypot(incoming_error, wall_error)
        return (
            rebound if rebound.incoming.value > signal and rebound.outgoing.value > 0.0 else None
        )

    def _drag_times(self, jump: VelocityJump, crossing: Intersection) -> tuple[float, float]:
        """From the middle of both flights to the contact, times the drag of the bead."""
        relative = relative_drag(self._tray, jump.species, jump.radius)
        before, after = jump.lines[:, 0].tolist()
        return relative * (crossing.time - before), relative * (after - crossing.time)

    def _friction_length(self, jump: VelocityJump, time: float) -> float:
        """What floor and lid take off from flight to flight, over their friction rate."""
        temperature = self._history.temperature(time, jump.species)
        speed = float(np.mean(np.hypot(jump.lines[:, 3], jump.lines[:, 4])))
        return float(jump.lines[1, 0] - jump.lines[0, 0]) * temperature / speed

    def _is_isolated(self, crossing: Intersection, jumps: list[VelocityJump]) -> bool:
        beads = np.empty((len(jumps), 4))
        for bead, jump in zip(beads, jumps, strict=True):
            speed = max(math.hypot(*line[3:5]) for line in jump.lines.tolist())
            bead[:] = *contact_position(jump.lines, crossing.time)[:2], jump.radius, speed
        return self._history.is_isolated(crossing.time, [jump.track for jump in jumps], beads)

    def _pair(self, jumps: tuple[VelocityJump, VelocityJump]) -> PairCollision | None:
        middle = 0.5 * (jumps[0].origin + jumps[1].origin)
        jumps = self._both_at(jumps, middle)
        crossing = Intersection(*intersect_lines(np.array([jump.lines for jump in jumps])))
        jumps = self._both_at(jumps, crossing.time)
        if not all(self._is_between_frames(jump, crossing) for jump in jumps):
            return None
        (x, y, _), (second_x, second_y, _) = (
            contact_position(jump.lines, crossing.time) for jump in jumps
        )
        distance = math.hypot(second_x - x, second_y - y)
        reach = jumps[0].radius + jumps[1].radius
        if (
            not _MIN_DISTANCE * reach < distance < _MAX_DISTANCE * reach
            or crossing.chi_square > MAX_SIGMAS**2 + 3.0
            or not self._is_isolated(crossing, list(jumps))
        ):
            return None
        collision = self._collision_record(jumps, crossing)
        return collision if is_isolated_collision(collision) else None

    def _both_at(
        self, jumps: tuple[VelocityJump, VelocityJump], time: float
    ) -> tuple[VelocityJump, VelocityJump]:
        return jumps[0].at(time, self._acceleration), jumps[1].at(time, self._acceleration)

    def _collision_record(
        self, jumps: tuple[VelocityJump, VelocityJump], crossing: Intersection
    ) -> PairCollision:
        positions = [contact_position(jump.lines, crossing.time) for jump in jumps]
        first, second = (np.array(position[:2]) for position in positions)
        before = np.array([jump.before.velocity for jump in jumps])
        approach = before[1] - before[0]
        shared_variance = sum(jump.shared_error**2 for jump in jumps)
        timing_variance = crossing.error**2 * float(approach @ approach)
        temperatures = [self._history.temperature(crossing.time, jump.species) for jump in jumps]
        errors = np.array([_velocity_errors(jump) for jump in jumps])
        drag_times = np.array([self._drag_times(jump, crossing) for jump in jumps])
        return PairCollision(
            stamp_ns=self._stamp_ns(crossing.time),
            tray=self._tray.number,
            tracks=np.array([jump.track for jump in jumps], dtype=np.int32),
            species=np.array([jump.species for jump in jumps], dtype=np.int32),
            radii=np.array([self._segments.seen_radius(jump) for jump in jumps]),
            radius_errors=np.array([jump.radius_error for jump in jumps]),
            masses=np.array([self._mass(jump) for jump in jumps]),
            before=before,
            after=np.array([jump.after.velocity for jump in jumps]),
            before_errors=errors[:, 0],
            after_errors=errors[:, 1],
            separation=second - first,
            separation_error=math.sqrt(
                sum(position[2] for position in positions) + shared_variance + timing_variance
            ),
            temperatures=np.array(temperatures),
            height=self._tray.dimensions[2],
            place=first - np.array(self._history.displacement(crossing.time)),
            drag=self._segments.drag,
            before_drag_times=drag_times[:, 0],
            after_drag_times=drag_times[:, 1],
            friction_length=float(
                np.mean([self._friction_length(jump, crossing.time) for jump in jumps])
            ),
        )


def _velocity_errors(jump: VelocityJump) -> tuple[float, float]:
    """Errors of a component of the velocities before and after, [m/s]."""
    return math.sqrt(jump.lines[0, 6]), math.sqrt(jump.lines[1, 6])
