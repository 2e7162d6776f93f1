"""Segmentation of tracks into straight flights, with the velocity jumps between them.

Tested by ``test/stages/contacts/test_contact_finder.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.stages.contacts.line_fits import LINE_SIZE, Line
from nanorocks_ros.stages.contacts.residual_variance import ResidualVariance
from nanorocks_ros.stages.contacts.segmentation_kernels import (
    JUMP_SIZE,
    FrameBeads,
    append_positions,
    finish_flight,
)
from nanorocks_ros.stages.contacts.track_buffer import TrackBuffer, reset_slot
from nanorocks_ros.stages.flights.bend_fits import BEND_SIZE
from nanorocks_ros.stages.flights.relative_drag import relative_drags

if TYPE_CHECKING:
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Tracks

# Largest difference of the radii that show from those told; beyond it the scale is told wrong, and
# flagged.
_MOST_ENLARGED = 0.02
# Relative error of a measured radius from the shape of the outline, beside the stated error.
_OUTLINE_ERROR = 0.02
_INITIAL_SLOTS = 64


class VelocityJump(NamedTuple):
    """A change of velocity between two straight flights of a bead.

    Parameters
    ----------
    track, species : int
    radius, radius_error : float, [m]
    lines : ndarray (2, LINE)
        Lines of the flights before and after, in the camera frame.
    last, first : float, [s]
        Times of the last frame before the jump and of the first after it.
    shared_error : float, [m]
        Error of a coordinate that all positions share; their residuals do not show it.
    origin : float, [s]
        Time at which the slopes of the lines are velocities, where beads accelerate.
    """

    track: int
    species: int
    radius: float
    radius_error: float
    lines: NDArray[np.float64]
    last: float
    first: float
    shared_error: float
    origin: float

    def at(self, origin: float, acceleration: NDArray[np.float64]) -> VelocityJump:
        """The jump with lines whose slopes are velocities at another time.

        Parameters
        ----------
        origin : float, [s]
        acceleration : ndarray (2,), [m/s^2]
            Of the beads between contacts.
        """
        if not acceleration.any():
            return self
        later, lines = origin - self.origin, self.lines.copy()
        middles = lines[:, :1] - 0.5 * (origin + self.origin)
        lines[:, 1:3] += later * middles * acceleration
        lines[:, 3:5] += later * acceleration
        return self._replace(lines=lines, origin=origin)

    @property
    def before(self) -> Line:
        """Line of the flight before."""
        return Line.from_row(self.lines[0])

    @property
    def after(self) -> Line:
        """Line of the flight after."""
        return Line.from_row(self.lines[1])


class FlightBend(NamedTuple):
    """A free flight of a bead, with its mean acceleration.

    Parameters
    ----------
    track, species : int
    radius : float, [m]
    bend : ndarray (BEND_SIZE,)
        As `write_bend` leaves it.
    """

    track: int
    species: int
    radius: float
    bend: NDArray[np.float64]


class FlightSegments:
    """The last flights of the tracks of all round beads of a tray.

    Parameters
    ----------
    tray : Tray
    acceleration : tuple of 2 floats, optional, [m/s^2]
        Of all beads between contacts, along columns and rows.

    Attributes
    ----------
    drag : float, [1/s]
        Of beads of the first species: lines are fitted in the clock of a gas with that.
    """

    def __init__(self, tray: Tray, acceleration: tuple[float, float] = (0.0, 0.0)) -> None:
        species = tray.species
        # When angular grains collide, the change of velocity does not follow the line of centres.
        self._is_round = np.array([kind.properties.shape != 'grain' for kind in species])
        equal_sizes = [kind.diameter_low == kind.diameter_high for kind in species]
        self._known_radii = np.array(
            [0.5 * kind.diameter if equal_size else math.nan
             for kind, equal_size in zip(species, equal_sizes, strict=True)]
        )  # fmt: skip
        self._residuals = ResidualVariance.initial(len(species))
        self._slots: dict[int, int] = {}
        self._free = list(range(_INITIAL_SLOTS))[::-1]
        self._buffer = TrackBuffer.empty(_INITIAL_SLOTS)
        self._buffer.acceleration[:] = acceleration
        # Species, radius and measurement error of the radius of each slot.
        self._species = np.zeros(_INITIAL_SLOTS, dtype=np.int32)
        self._sizes = np.zeros((_INITIAL_SLOTS, 2))
        # Of each species, sums of weights and of weighted measured radii.
        self._seen_radii = np.zeros((len(species), 2))
        # Tracks and species in the last frame, and the slot of each; -1 without a slot.
        self._last_tracks = b'', b''
        self._track_slots = np.empty(0, dtype=np.int64)
        self._flights: list[FlightBend] = []
        self._relative_drags = relative_drags(tray)
        self._mean_radii = np.array([0.5 * kind.diameter for kind in species])
        self.drag = 0.0

    def take_flights(self) -> list[FlightBend]:
        """The free flights that ended since the last call."""
        flights, self._flights = self._flights, []
        return flights

    @property
    def noise(self) -> NDArray[np.float64]:
        """Variance of positions about flights over that by their errors, (species,)."""
        return self._residuals.variances

    def seen_radius(self, jump: VelocityJump) -> float:
        """Radius of a bead in the scale in which distances of beads show, [m].

        Beads above the floor are nearer to the camera: it shows them larger, and farther apart. So
        distances at contacts are compared with the radii that show, also where all beads of a
        species are alike: their mean.
        """
        told = self._known_radii[jump.species]
        weights, weighted = self._seen_radii[jump.species].tolist()
        if math.isnan(told) or weights == 0.0:
            return jump.radius
        low, high = (1.0 - _MOST_ENLARGED) * told, (1.0 + _MOST_ENLARGED) * told
        return float(np.clip(weighted / weights, low, high))

    def use_drag(self, drag: float) -> None:
        """Fit lines in the clock of a gas from now on.

        Parameters
        ----------
        drag : float, >= 0, [1/s]
            Of beads of the first species.
        """
        self.drag = drag
        radii = self._sizes[:, 0]
        larger = np.divide(
            radii, self._mean_radii[self._species], out=np.ones_like(radii), where=radii > 0.0
        )
        self._buffer.drags[:] = drag * self._relative_drags[self._species] / larger**2

    def push(self, time: float, tracks: Tracks, max_gap: float) -> list[VelocityJump]:
        """Append the positions of the next frame.

        Parameters
        ----------
        time : float, [s]
        tracks : Tracks
        max_gap : float, [s]
            A track without a position for longer is cut.

        Returns
        -------
        list of VelocityJump
            Jumps whose flights before and after are complete now.
        """
        ended = self._assign_slots(tracks)
        lines = np.empty((tracks.ids.size, JUMP_SIZE))
        bends = np.empty((tracks.ids.size, BEND_SIZE))
        rows = append_positions(
            self._buffer,
            self._residuals,
            time,
            max_gap,
            self._track_slots,
            FrameBeads(
                tracks.species,
                tracks.positions,
                tracks.displacement,
                tracks.position_errors,
                tracks.radii,
                tracks.radius_errors,
                tracks.seen,
            ),
            self._known_radii,
            self._sizes,
            self._seen_radii,
            lines,
            bends,
        )
        for k in np.flatnonzero(bends[:, 2]).tolist():
            self._add_flight(int(tracks.ids[k]), bends[k])
        jumps = [self._velocity_jump(int(tracks.ids[k]), lines[k].copy()) for k in rows.tolist()]
        return jumps + self._finish(ended)

    def flush(self) -> list[VelocityJump]:
        """End all flights and return the jumps before them; later positions begin new flights."""
        jumps = self._finish(sorted(self._slots))
        # No track has a slot now: the next frame assigns new ones, even to the same tracks.
        self._last_tracks = b'', b''
        self._track_slots = np.empty(0, dtype=np.int64)
        return jumps

    def _assign_slots(self, tracks: Tracks) -> list[int]:
        """Assign a slot to each round bead; return the tracks that ended. Few frames differ."""
        tracks_now = tracks.ids.tobytes(), tracks.species.tobytes()
        if tracks_now == self._last_tracks:
            return []
        self._last_tracks = tracks_now
        track_ids = tracks.ids.tolist()
        is_round = self._is_round[tracks.species].tolist()
        slots = [
            self._slot_of(track) if round_bead else -1
            for track, round_bead in zip(track_ids, is_round, strict=True)
        ]
        self._track_slots = np.array(slots, dtype=np.int64)
        used = self._track_slots >= 0
        self._species[self._track_slots[used]] = tracks.species[used]
        self.use_drag(self.drag)
        return sorted(self._slots.keys() - set(track_ids))

    def _slot_of(self, track: int) -> int:
        slot = self._slots.get(track)
        if slot is None:
            if not self._free:
                self._grow()
            slot = self._slots[track] = self._free.pop()
            reset_slot(self._buffer, slot)
        return slot

    def _grow(self) -> None:
        slots = self._species.size
        self._buffer = self._buffer.doubled()
        self._species = np.concatenate([self._species, np.zeros_like(self._species)])
        self._sizes = np.concatenate([self._sizes, np.zeros_like(self._sizes)])
        self._free = list(range(slots, 2 * slots))[::-1]

    def _velocity_jump(self, track: int, numbers: NDArray[np.float64]) -> VelocityJump:
        slot = self._slots[track]
        radius, measured_error = self._sizes[slot].tolist()
        species = int(self._species[slot])
        # The size is known where all beads of a species have the same.
        alike = not math.isnan(self._known_radii[species])
        error = 0.0 if alike else float(np.hypot(measured_error, _OUTLINE_ERROR * radius))
        lines, times_and_error = (
            numbers[: 2 * LINE_SIZE].reshape(2, LINE_SIZE),
            numbers[2 * LINE_SIZE :].tolist(),
        )
        last, first, shared_error = times_and_error
        origin = 0.5 * (last + first)
        return VelocityJump(
            track, species, radius, error, lines, last, first, shared_error, origin
        )

    def _add_flight(self, track: int, bend: NDArray[np.float64]) -> None:
        species = int(self._species[self._slots[track]])
        radius = float(self._sizes[self._slots[track], 0])
        self._flights.append(FlightBend(track, species, radius, bend.copy()))

    def _finish(self, track_ids: list[int]) -> list[VelocityJump]:
        """Free the slots of tracks that ended; return their last jumps."""
        jumps = []
        for track in track_ids:
            slot, row, bend = self._slots[track], np.empty(JUMP_SIZE), np.zeros(BEND_SIZE)
            variance = float(self._residuals.variances[self._species[slot]])
            radius = float(self._sizes[slot, 0])
            if finish_flight(self._buffer, slot, variance, radius, (row, bend)):
                jumps.append(self._velocity_jump(track, row))
            if bend[2]:
                self._add_flight(track, bend)
            self._free.append(self._slots.pop(track))
        return jumps
