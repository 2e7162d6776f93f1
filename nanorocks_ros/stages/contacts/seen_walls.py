"""Walls of a container that nobody described: where beads turn back, at one place on each side."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.stages.contacts.flight_segments import FlightSegments
from nanorocks_ros.stages.contacts.line_fits import (
    Intersection,
    are_straight,
    contact_position,
    intersect_lines,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Tracks
    from nanorocks_ros.stages.contacts.flight_segments import VelocityJump

_NS = 1e9
# Longest gap within a flight, in intervals between frames, as of contacts.
_MAX_GAP_FRAMES = 3.5
# Width of the places of one wall, in radii; least number of turns at it.
_WIDTH, _LEAST_TURNS = 0.3, 3
# Least cosine between the change of velocity and the normal of a wall.
_ALONG_NORMAL = 0.8


class SeenWalls(NamedTuple):
    """Places of the four walls, [m], NaN where none is seen; and the turns at each.

    Parameters
    ----------
    places : tuple of 4 floats, [m]
        Low and high along columns, low and high along rows.
    turns : tuple of 4 ints
    """

    places: tuple[float, float, float, float]
    turns: tuple[int, int, int, int]

    @property
    def any(self) -> bool:
        """Whether a wall is seen."""
        return any(self.turns)

    def completed(self, earlier: SeenWalls) -> SeenWalls:
        """With walls that were seen earlier where none is seen now."""
        rows = [
            before if math.isnan(now[0]) else now
            for now, before in zip(
                zip(self.places, self.turns, strict=True),
                zip(earlier.places, earlier.turns, strict=True),
                strict=True,
            )
        ]
        places, turns = zip(*rows, strict=True)
        return SeenWalls(places, turns)


def seen_walls(
    tracks: Sequence[Tracks], tray: Tray, acceleration: tuple[float, float] = (0.0, 0.0)
) -> SeenWalls:
    """The outermost place on each side where beads turned back several times.

    Parameters
    ----------
    tracks : sequence of Tracks
        In order of time.
    tray : Tray
        Its species; its sides do not matter.
    acceleration : tuple of 2 floats, optional, [m/s^2]
        Of all beads between contacts.
    """
    sides: dict[int, list[tuple[float, float]]] = {wall: [] for wall in range(4)}
    for jump in _jumps(tracks, tray, acceleration):
        crossing = Intersection(*intersect_lines(jump.lines[None]))
        if not are_straight(jump.lines):
            continue
        turned = jump.at(crossing.time, np.array(acceleration))
        x, y, _ = contact_position(turned.lines, crossing.time)
        _add(sides, np.array([x, y]), turned)
    walls = [_wall(sides[wall], outward=wall % 2 == 1) for wall in range(4)]
    places, turns = zip(*walls, strict=True)
    return SeenWalls(places, turns)


def _jumps(
    tracks: Sequence[Tracks], tray: Tray, acceleration: tuple[float, float]
) -> list[VelocityJump]:
    segments = FlightSegments(tray, acceleration)
    stamps = np.array([record.stamp_ns for record in tracks])
    if stamps.size < 2:
        return []
    interval = float(np.median(np.diff(stamps))) / _NS
    jumps = []
    for record in tracks:
        time = float(record.stamp_ns - stamps[0]) / _NS
        jumps += segments.push(time, record, _MAX_GAP_FRAMES * interval)
        segments.take_flights()
    return jumps + segments.flush()


def _add(
    sides: dict[int, list[tuple[float, float]]], place: NDArray[np.float64], jump: VelocityJump
) -> None:
    """Add the outer edge of a bead, and its radius, to the side that it turned back from."""
    push = jump.lines[1, 3:5] - jump.lines[0, 3:5]
    size = math.hypot(*push.tolist())
    for axis in range(2):
        if abs(push[axis]) > _ALONG_NORMAL * size:
            high = int(push[axis] < 0.0)
            edge = float(place[axis]) + (jump.radius if high else -jump.radius)
            sides[2 * axis + high].append((edge, jump.radius))


def _wall(edges: list[tuple[float, float]], *, outward: bool) -> tuple[float, int]:
    """Place of the outermost wall of a side, and its number of turns."""
    if len(edges) < _LEAST_TURNS:
        return math.nan, 0
    places = np.sort([-edge if outward else edge for edge, _ in edges])
    width = _WIDTH * float(np.median([radius for _, radius in edges]))
    ends = np.searchsorted(places, places + width, side='right')
    counts = ends - np.arange(places.size)
    crowded = np.flatnonzero(counts >= max(_LEAST_TURNS, 0.3 * counts.max()))
    if not crowded.size:
        # Turns everywhere on the side, such as of beads that rattle among others.
        return math.nan, 0
    first = int(crowded[0])
    place = float(np.median(places[first : ends[first]]))
    return (-place if outward else place), int(counts[first])
