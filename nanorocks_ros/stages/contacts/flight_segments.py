"""The ways of the beads of a tray, cut into straight flights, and the kinks between them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.stages.contacts.line_fits import LINE, Line
from nanorocks_ros.stages.contacts.residual_variance import Scatter
from nanorocks_ros.stages.contacts.segmentation_kernels import (
    KINK,
    LONGEST,
    Places,
    Ways,
    begin,
    finish,
    follow,
)

if TYPE_CHECKING:
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Tracks

__all__ = ['LONGEST', 'Histories', 'Kink']

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
        # Collisions of grains with corners do not follow from their tracks.
        self._round = np.array([beads.properties.shape != 'grain' for beads in species])
        alike = [one.diameter_low == one.diameter_high for one in species]
        self._known_radii = np.array(
            [0.5 * one.diameter if same else math.nan
             for one, same in zip(species, alike, strict=True)]
        )  # fmt: skip
        self._scatter = Scatter.unknown(len(species))
        self._slots: dict[int, int] = {}
        self._free = list(range(_SLOTS))[::-1]
        self._ways = Ways.empty(_SLOTS)
        # Of each slot; sizes are radii and the errors they were measured with.
        self._species = np.zeros(_SLOTS, dtype=np.int32)
        self._sizes = np.zeros((_SLOTS, 2))
        # Tracks and their species in the last picture, and where they are; -1 is nowhere.
        self._named = b'', b''
        self._rows = np.empty(0, dtype=np.int64)

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
        gone = self._assigned(tracks)
        lines = np.empty((tracks.ids.size, KINK))
        turned = follow(
            self._ways,
            self._scatter,
            time,
            gap,
            self._rows,
            Places(
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
            lines,
        )
        kinks = [self._kink(int(tracks.ids[k]), lines[k].copy()) for k in turned.tolist()]
        return kinks + self._finished(gone)

    def flush(self) -> list[Kink]:
        """The kinks whose flights afterwards end with the recording."""
        return self._finished(sorted(self._slots))

    def _assigned(self, tracks: Tracks) -> list[int]:
        """Give each round bead a slot, and say which tracks are no more; few pictures differ."""
        named = tracks.ids.tobytes(), tracks.species.tobytes()
        if named == self._named:
            return []
        self._named = named
        numbers = tracks.ids.tolist()
        rounds = self._round[tracks.species].tolist()
        rows = [
            self._slot(number) if fit else -1 for number, fit in zip(numbers, rounds, strict=True)
        ]
        self._rows = np.array(rows, dtype=np.int64)
        used = self._rows >= 0
        self._species[self._rows[used]] = tracks.species[used]
        return sorted(self._slots.keys() - set(numbers))

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

    def _kink(self, number: int, row: NDArray[np.float64]) -> Kink:
        slot = self._slots[number]
        radius, measured = self._sizes[slot].tolist()
        species = int(self._species[slot])
        # The size of a species whose beads are alike is known.
        alike = not math.isnan(self._known_radii[species])
        error = 0.0 if alike else float(np.hypot(measured, _OUTLINE * radius))
        lines, rest = row[: 2 * LINE].reshape(2, LINE), row[2 * LINE :].tolist()
        return Kink(number, species, radius, error, lines, *rest)

    def _finished(self, numbers: list[int]) -> list[Kink]:
        """The last kinks of tracks that have ended."""
        kinks = []
        for number in numbers:
            slot, row = self._slots[number], np.empty(KINK)
            variance = float(self._scatter.variances[self._species[slot]])
            if finish(self._ways, slot, variance, float(self._sizes[slot, 0]), row):
                kinks.append(self._kink(number, row))
            self._free.append(self._slots.pop(number))
        return kinks
