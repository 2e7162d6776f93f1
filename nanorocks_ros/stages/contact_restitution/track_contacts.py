"""Contacts and restitutions from the tracks of a recording, whatever moves the beads."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.inference.contacts_alone import ContactsAlone, contacts_alone
from nanorocks_ros.records import FreeFlight, Measured, PairCollision, Rebound
from nanorocks_ros.stages.contact_restitution.collision_reach import (
    ANY_HEIGHT,
    with_seen_reach,
)
from nanorocks_ros.stages.contacts.contact_finder import ContactFinder
from nanorocks_ros.stages.contacts.seen_walls import SeenWalls, seen_walls
from nanorocks_ros.stages.flights.steady_acceleration import (
    SteadyAcceleration,
    steady_acceleration,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import ContactOrFlight, Tracks
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
    """Find the contacts in all tracks of a tray, and what they say of the restitutions.

    Parameters
    ----------
    tracks : sequence of Tracks
        Of one tray, in order of time.
    tray : Tray
        Of unknown height: how far collisions are tilted out of the picture follows from them.
    settings : PipelineSettings
    container_known : bool
        Whether the sides of the tray are those of the container. If not, walls are where beads
        turn back.
    progress : callable, optional
        Called with the frames done and the frames there are.
    """
    scene = contact_scene(tracks, tray, container_known=container_known)
    finder = scene.finder(settings)
    results: list[ContactOrFlight] = []
    for number, record in enumerate(scene.tracks, start=1):
        results += finder.push(record)
        if progress is not None:
            progress(number, len(tracks))
    results += finder.flush()
    return scene.summary(results, settings, frames=len(tracks))


class ContactScene(NamedTuple):
    """Where and how beads move: what is to be known before contacts are searched.

    Parameters
    ----------
    tracks : sequence of Tracks
        Places from the corner of the walls.
    tray : Tray
        With the sides between the walls.
    acceleration : SteadyAcceleration
    walls : SeenWalls or None
    corner : tuple of 2 floats, [m]
        As of `TrackContacts`.
    height_told : bool
        Whether the height of the tray is; else radii follow from the collisions.
    """

    tracks: Sequence[Tracks]
    tray: Tray
    acceleration: SteadyAcceleration
    walls: SeenWalls | None = None
    corner: tuple[float, float] = (0.0, 0.0)
    height_told: bool = True

    def finder(self, settings: PipelineSettings) -> ContactFinder:
        """A new stage that finds contacts in these tracks."""
        drag = Measured(settings.prior.drag, settings.prior.drag_error)
        return ContactFinder(self.tray, drag, self.acceleration.correction)

    def summary(
        self, results: Iterable[ContactOrFlight], settings: PipelineSettings, *, frames: int
    ) -> TrackContacts:
        """What contacts and flights of so many frames say."""
        in_order = sorted(results, key=attrgetter('stamp_ns'))
        contacts = [result for result in in_order if not isinstance(result, FreeFlight)]
        flights = [result for result in in_order if isinstance(result, FreeFlight)]
        probability = settings.cooling.probability
        own = contacts if self.height_told else with_seen_reach(contacts)
        return TrackContacts(
            contacts=tuple(contacts),
            alone=contacts_alone(
                own,
                flights,
                settings.prior,
                probability,
                sides=self.tray.dimensions[:2],
                height_known=self.height_told,
            ),
            acceleration=self.acceleration,
            walls=self.walls,
            frames=frames,
            corner=self.corner,
        )


def contact_scene(
    tracks: Sequence[Tracks],
    tray: Tray,
    *,
    container_known: bool = True,
    earlier: SeenWalls | None = None,
) -> ContactScene:
    """Acceleration and walls by the tracks; parameters as of `track_contacts`.

    Walls that were seen in `earlier` tracks count where they are not seen in these.
    """
    is_told = not math.isnan(tray.dimensions[2])
    if not is_told:
        height = ANY_HEIGHT * max(species.diameter_high for species in tray.species)
        tray = replace(tray, dimensions=(*tray.dimensions[:2], height))
    acceleration = steady_acceleration(tracks)
    if container_known:
        return ContactScene(tracks, tray, acceleration, height_told=is_told)
    walls = seen_walls(tracks, tray, acceleration.correction)
    if earlier is not None:
        walls = walls.completed(earlier)
    moved, between, corner = _between(walls, tracks, tray)
    return ContactScene(moved, between, acceleration, walls, corner, is_told)


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
