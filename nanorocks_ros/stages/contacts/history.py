"""The ways of the beads of a tray, cut into straight flights, and the kinks between them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.stages.contacts.flights import LINE, Line
from nanorocks_ros.stages.contacts.ways import KINK, LONGEST, Scatter, Ways, begin, finish, follow

if TYPE_CHECKING:
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Tracks

__all__ = ['LONGEST', 'Histories', 'Kink']

# Of grains with corners a collision says nothing of the kind.
_NOT_ROUND = ('JSC-1',)
# Error of a measured radius, over it, that outlines leave besides the stated one.
_OUTLINE = 0.02
_SLOTS = 64


class Kink(NamedTuple):
    """Where one flight of a bead ends and the next begins.

    Parameters
    ----------
    track, species : int
    radius, radius_error : float, [m]
    lines : ndarray (2, LINE)
        Numbers of the flights before and after, through places past the camera.
    last, first : float, [s]
        Times of the last picture before and of the first after.
    shared_error : float, [m]
        Of a coordinate of all places alike, which their scatter does not show.
    """

    track: int
    species: int
    radius: float
    radius_error: float
    lines: NDArray[np.float64]
    last: float
    first: float
    shared_error: float

    @property
    def before(self) -> Line:
        """The flight before."""
        return Line.of(self.lines[0])

    @property
    def after(self) -> Line:
        """The flight after."""
        return Line.of(self.lines[1])


class Histories:
    """The last flights of all tracks of a tray that are of round beads.

    Parameters
    ----------
    tray : Tray
    """

    def __init__(self, tray: Tray) -> None:
        species = tray.species
        self._round = np.array([one.material not in _NOT_ROUND for one in species])
        alike = [one.diameter_low == one.diameter_high for one in species]
        self._known_radii = np.array(
            [0.5 * one.diameter if same else math.nan
             for one, same in zip(species, alike, strict=True)]
        )  # fmt: skip
        self._scatter = Scatter.unknown(len(species))
        self._slots: dict[int, int] = {}
        self._free = list(range(_SLOTS))[::-1]
        self._ways = Ways.empty(_SLOTS)
        # Of each slot.
        self._species = np.zeros(_SLOTS, dtype=np.int32)
        self._sizes = np.zeros((_SLOTS, 2))

    def push(self, time: float, tracks: Tracks, gap: float) -> list[Kink]:
        """Take the next picture, at a time in s.

        Parameters
        ----------
        time : float, [s]
        tracks : Tracks
        gap : float, [s]
            Without a place for longer, what happened to a bead is not known.

        Returns
        -------
        list of Kink
            Those of which the flights before and after are both known now.
        """
        rows = np.flatnonzero(tracks.seen & self._round[tracks.species])
        species, numbers = tracks.species[rows], tracks.ids[rows].tolist()
        slots = np.array([self._slot(one) for one in numbers], dtype=np.int64)
        self._species[slots] = species
        sizes = self._measured(species, tracks.radii[rows], tracks.radius_errors[rows])
        self._sizes[slots] = sizes
        lines = np.empty((rows.size, KINK))
        places = (tracks.positions + tracks.displacement)[rows]
        errors = tracks.position_errors[rows]
        radii = sizes[:, 0].copy()
        turned = follow(
            self._ways, self._scatter, time, gap, slots, species, places, errors, radii, lines
        )
        found = [self._kink(numbers[k], lines[k].copy()) for k in np.flatnonzero(turned).tolist()]
        gone = self._slots.keys() - set(tracks.ids.tolist())
        return found + self._finished(sorted(gone))

    def flush(self) -> list[Kink]:
        """The kinks whose flights afterwards end with the recording."""
        return self._finished(sorted(self._slots))

    def _slot(self, number: int) -> int:
        slot = self._slots.get(number)
        if slot is None:
            if not self._free:
                self._grow()
            slot = self._slots[number] = self._free.pop()
            begin(self._ways, slot)
        return slot

    def _grow(self) -> None:
        slots = self._species.size
        self._ways = self._ways.larger()
        self._species = np.concatenate([self._species, np.zeros_like(self._species)])
        self._sizes = np.concatenate([self._sizes, np.zeros_like(self._sizes)])
        self._free = list(range(slots, 2 * slots))[::-1]

    def _measured(
        self, species: NDArray[np.int32], radii: NDArray[np.float64], errors: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Radii and their errors, (n, 2); those of a species that are alike are known."""
        known = self._known_radii[species]
        alike = ~np.isnan(known)
        return np.column_stack(
            [
                np.where(alike, known, radii),
                np.where(alike, 0.0, np.hypot(errors, _OUTLINE * radii)),
            ]
        )

    def _kink(self, number: int, row: NDArray[np.float64]) -> Kink:
        slot = self._slots[number]
        radius, error = self._sizes[slot].tolist()
        lines, rest = row[: 2 * LINE].reshape(2, LINE), row[2 * LINE :].tolist()
        return Kink(number, int(self._species[slot]), radius, error, lines, *rest)

    def _finished(self, numbers: list[int]) -> list[Kink]:
        """The last kinks of tracks that have ended."""
        found = []
        for number in numbers:
            slot, row = self._slots[number], np.empty(KINK)
            variance = float(self._scatter.variances[self._species[slot]])
            if finish(self._ways, slot, variance, float(self._sizes[slot, 0]), row):
                found.append(self._kink(number, row))
            self._free.append(self._slots.pop(number))
        return found
