"""Contacts and restitutions from the tracks of a recording, whatever moves the beads."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.contacts.contacts_alone import ContactsAlone, contacts_alone
from nanorocks_ros.records import FreeFlight, Measured, PairCollision, Rebound
from nanorocks_ros.stages.contacts.contact_finder import ContactFinder
from nanorocks_ros.stages.contacts.seen_walls import SeenWalls, seen_walls
from nanorocks_ros.stages.flights.steady_acceleration import (
    SteadyAcceleration,
    steady_acceleration,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Tracks
    from nanorocks_ros.settings import PipelineSettings

# A wall that is not seen lies so many diameters beyond all beads.
_BEYOND = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackContacts:
    """Contacts of a tray, and what follows from them alone.

    Parameters
    ----------
    contacts : tuple of Rebound or PairCollision
        In order of time.
    alone : ContactsAlone
    acceleration : SteadyAcceleration
        Of free beads; contacts are corrected for it where it is seen.
    walls : SeenWalls or None
        Where the walls were found; None where the container is known.
    frames : int
    corner : tuple of 2 floats, [m]
        Of the walls, from the corner of the tracks: places of contacts count from it.
    """

    contacts: tuple[Rebound | PairCollision, ...]
    alone: ContactsAlone
    acceleration: SteadyAcceleration
    walls: SeenWalls | None
    frames: int
    corner: tuple[float, float] = (0.0, 0.0)

    @property
    def rebounds(self) -> tuple[Rebound, ...]:
        """Rebounds from walls."""
        return tuple(contact for contact in self.contacts if isinstance(contact, Rebound))

    @property
    def collisions(self) -> tuple[PairCollision, ...]:
        """Collisions of two beads."""
        return tuple(contact for contact in self.contacts if isinstance(contact, PairCollision))


def track_contacts(
    tracks: Sequence[Tracks],
    tray: Tray,
    settings: PipelineSettings,
    *,
    container_known: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> TrackContacts:
    """Find the contacts in the tracks of a tray, and what they say of the restitutions.

    Parameters
    ----------
    tracks : sequence of Tracks
        Of one tray, in order of time.
    tray : Tray
    settings : PipelineSettings
    container_known : bool
        Whether the sides of the tray are those of the container. If not, walls are where beads
        turn back.
    progress : callable, optional
        Called with the frames done and the frames there are.
    """
    if math.isnan(tray.dimensions[2]):
        # One layer of beads.
        layer = max(species.diameter_high for species in tray.species)
        tray = replace(tray, dimensions=(*tray.dimensions[:2], layer))
    acceleration = steady_acceleration(tracks)
    walls, corner = None, (0.0, 0.0)
    if not container_known:
        walls = seen_walls(tracks, tray, acceleration.correction)
        tracks, tray, corner = _between(walls, tracks, tray)
    drag = Measured(settings.prior.drag, settings.prior.drag_error)
    finder = ContactFinder(tray, drag, acceleration.correction)
    results: list[Rebound | PairCollision | FreeFlight] = []
    for number, record in enumerate(tracks, start=1):
        results += finder.push(record)
        if progress is not None:
            progress(number, len(tracks))
    results += finder.flush()
    contacts = sorted(
        (result for result in results if not isinstance(result, FreeFlight)),
        key=lambda contact: contact.stamp_ns,
    )
    flights = [result for result in results if isinstance(result, FreeFlight)]
    probability = settings.cooling.probability
    return TrackContacts(
        contacts=tuple(contacts),
        alone=contacts_alone(contacts, flights, settings.prior, probability),
        acceleration=acceleration,
        walls=walls,
        frames=len(tracks),
        corner=corner,
    )


def _between(
    walls: SeenWalls, tracks: Sequence[Tracks], tray: Tray
) -> tuple[list[Tracks], Tray, tuple[float, float]]:
    """Tracks and tray with the sides where the walls are, and their corner; others are far."""
    filled = [record.positions for record in tracks if record.ids.size]
    if not filled:
        return list(tracks), tray, (0.0, 0.0)
    places = np.concatenate(filled)
    far = _BEYOND * tray.diameter
    outside = [
        bound
        for axis in range(2)
        for bound in (float(places[:, axis].min()) - far, float(places[:, axis].max()) + far)
    ]
    x0, x1, y0, y1 = (
        other if math.isnan(own) else own for own, other in zip(walls.places, outside, strict=True)
    )
    corner = np.array([x0, y0])
    moved = [replace(record, positions=record.positions - corner) for record in tracks]
    return moved, replace(tray, dimensions=(x1 - x0, y1 - y0, tray.dimensions[2])), (x0, y0)
