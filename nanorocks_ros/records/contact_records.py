"""Single contacts, rebounds from walls and collisions of two beads, and flights between them.

Tested by ``test/wire/test_array_layouts.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records.quality_flags import freeze_arrays

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.records.values import Measured

WALL_NAMES = 'left', 'right', 'top', 'bottom'
"""Of the walls 0 to 3, as they lie in the picture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rebound:
    """A rebound of a bead from a side wall, measured on its track.

    Speeds are past the wall, which may swing; each has the error of its own straight line.

    Parameters
    ----------
    stamp_ns : int
        Of the contact, between two pictures.
    tray, cycle, track, species : int
    wall : int
        0 to 3: low and high along columns, low and high along rows.
    incoming, outgoing : Measured, [m/s]
        Speeds along the normal, to the wall before and from it after.
    tangential_incoming, tangential_outgoing, tangential_error : float, [m/s]
        Along the wall; the error is that of their difference.
    wall_velocity : Measured, [m/s]
        Of the wall along the normal, to the outside; its error is in both speeds.
    place : ndarray (2,), [m]
        Of the centre of the bead, from the corner of the tray.
    drag : float, [1/s]
        Of the gas, for the first species: taken out of both speeds, which are those at the
        contact.
    incoming_drag_time, outgoing_drag_time : float, [s]
        From the middle of each flight to the contact, times the drag of the bead over that of the
        first species: by how much a change of the drag changes the logarithm of each speed.
    friction_length : float, [m]
        Time from the middle of one flight to that of the other, times the temperature of the
        species, over the speed of the bead: what friction of floor and lid takes off beside the
        contact, over the friction rate.
    temperature : float, [m^2/s^2]
        Of the species at that time: mean square of a horizontal component.
    free_height : float, [m]
        Height of the tray less the diameter of the bead: its way from floor to lid.
    beads : int
        Of the body that rebounds: 1 for a free bead. Of a body `track` is the bead that touches.
    """

    stamp_ns: int
    tray: int
    cycle: int = 0
    track: int
    species: int
    wall: int
    incoming: Measured
    outgoing: Measured
    tangential_incoming: float
    tangential_outgoing: float
    tangential_error: float
    wall_velocity: Measured
    place: NDArray[np.float64]
    drag: float = 0.0
    incoming_drag_time: float = 0.0
    outgoing_drag_time: float = 0.0
    friction_length: float = 0.0
    temperature: float = 0.0
    free_height: float = 0.0
    beads: int = 1

    def __post_init__(self) -> None:
        freeze_arrays(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class PairCollision:
    """A collision of two beads, measured on their tracks.

    Parameters
    ----------
    stamp_ns : int
        Of the contact, between two pictures.
    tray, cycle : int
    tracks, species : ndarray of int32, (2,)
    radii, masses : ndarray (2,), [m], [kg]
        Radii as they show, in the scale of the distances.
    radius_errors : ndarray (2,), [m]
        0 where all beads of the species are alike.
    before, after : ndarray (2, 2), [m/s]
        Projected velocity of each bead.
    before_errors, after_errors : ndarray (2,), [m/s]
        Of each component.
    separation : ndarray (2,), [m]
        Projected, from the first centre to the second at the contact.
    separation_error : float, [m]
        Of each component.
    temperatures : ndarray (2,), [m^2/s^2]
        Of the species of each bead at that time: mean square of a horizontal component.
    height : float, [m]
        Of the tray, which limits how far beads can be above each other.
    place : ndarray (2,), [m]
        Of the first centre, from the corner of the tray.
    drag : float, [1/s]
        As of `Rebound`.
    before_drag_times, after_drag_times : ndarray (2,), [s]
        Of each bead, as `Rebound.incoming_drag_time`.
    friction_length : float, [m]
        Mean of both beads, as of `Rebound`.
    """

    stamp_ns: int
    tray: int
    cycle: int = 0
    tracks: NDArray[np.int32]
    species: NDArray[np.int32]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    masses: NDArray[np.float64]
    before: NDArray[np.float64]
    after: NDArray[np.float64]
    before_errors: NDArray[np.float64]
    after_errors: NDArray[np.float64]
    separation: NDArray[np.float64]
    separation_error: float
    temperatures: NDArray[np.float64]
    height: float
    place: NDArray[np.float64]
    drag: float = 0.0
    before_drag_times: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    after_drag_times: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    friction_length: float = 0.0

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def normal_speeds(self) -> tuple[float, float]:
        """Speeds of approach and of parting along the projected line of centres, [m/s]."""
        normal = self.separation / np.hypot(*self.separation)
        before, after = self.before[1] - self.before[0], self.after[1] - self.after[0]
        return -float(before @ normal), float(after @ normal)


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeFlight:
    """A flight of a bead without contacts, long enough to show how it is bent.

    Parameters
    ----------
    stamp_ns : int
        Of its last position.
    tray, cycle, track, species : int
    duration : float, [s]
    points : int
        Number of positions.
    mean_velocity, mean_acceleration : ndarray (2,), [m/s], [m/s^2]
        Of a parabola: in its middle, and everywhere.
    acceleration_error : float, [m/s^2]
        Of each component.
    relative_drag : float
        Drag of the bead over that of the first species: as the inverse of density times diameter
        squared.
    reduced_chi_square : float
        Of a parabola.
    temperature : float, [m^2/s^2]
        Of the species in the middle: mean square of a horizontal component.
    """

    stamp_ns: int
    tray: int
    cycle: int = 0
    track: int
    species: int
    duration: float
    points: int
    mean_velocity: NDArray[np.float64]
    mean_acceleration: NDArray[np.float64]
    acceleration_error: float
    relative_drag: float
    reduced_chi_square: float
    temperature: float

    def __post_init__(self) -> None:
        freeze_arrays(self)


Contact = Rebound | PairCollision
"""A contact of a bead, with a wall or with another bead."""
ContactOrFlight = Contact | FreeFlight
"""What the tracks of beads tell of the contacts and of the time between them."""
