"""Records of free flights from their fits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from nanorocks_ros.records import NS, FreeFlight
from nanorocks_ros.stages.flights.relative_drag import relative_drag

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray


class Bend(Protocol):
    """A fit of `write_bend` to a flight of a bead."""

    @property
    def track(self) -> int:
        """Number of its track."""

    @property
    def species(self) -> int:
        """Of the bead."""

    @property
    def radius(self) -> float:
        """Of the bead, [m]."""

    @property
    def bend(self) -> NDArray[np.float64]:
        """As `write_bend` leaves it, (BEND_SIZE,)."""


def free_flight(tray: Tray, flight: Bend, first_ns: int, temperature: float) -> FreeFlight:
    """The record of a flight.

    Parameters
    ----------
    tray : Tray
    flight : Bend
    first_ns : int, [ns]
        Stamp of time 0 of the fit.
    temperature : float, [m^2/s^2]
        Of the species, in the middle of the flight.
    """
    row = flight.bend
    middle, duration, points = row[:3].tolist()
    return FreeFlight(
        stamp_ns=first_ns + round((middle + 0.5 * duration) * NS),
        tray=tray.number,
        track=flight.track,
        species=flight.species,
        duration=duration,
        points=int(points),
        mean_velocity=row[3:5],
        mean_acceleration=row[5:7],
        acceleration_error=float(row[7]),
        relative_drag=relative_drag(tray, flight.species, flight.radius),
        temperature=temperature,
        reduced_chi_square=float(row[8]) / (2.0 * points - 6.0),
    )
