"""Tracks of grains, cut where they jump.

A grain that others hide in part is found beside its place, or where two of them overlap, and
found elsewhere a few pictures later; its track jumps with it. Such jumps made the mean speed of
the grains of tray 7 up to 16 % too high in drawn films.

Tested by ``test/stages/speed/grains/test_jumping_tracks.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import BEAD_FIELDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

# Longest step between two pictures, over the median step of the species; in an equilibrium gas
# one bead of 3 x 10^7 moves more than 5 times as fast. And what is added for errors of places.
_LONGEST_STEP, _LONGEST_ERROR_PX = 5.0, 0.5
# Frames from one in which a bead is seen to the next one.
_LONGEST_GAP = 3


class JumpingTracks:
    """Gives a track a new number where it jumps, or was not seen for more than two pictures.

    Parameters
    ----------
    pixels_per_metre : float

    Attributes
    ----------
    steps : dict of int to float, [m]
        Of each species: mean step between the last two pictures, with the jumps.
    """

    def __init__(self, pixels_per_metre: float) -> None:
        self._error = _LONGEST_ERROR_PX / pixels_per_metre
        self.steps: dict[int, float] = {}
        self._next = self._frame = 0
        # Of each track that may go on: its number, that of the unbroken one, frame and place.
        self._ids = np.empty(0, dtype=np.int32)
        self._numbers = np.empty(0, dtype=np.int32)
        self._frames = np.empty(0, dtype=np.int64)
        self._positions = np.empty((0, 2))

    def cut(self, tracks: Tracks) -> Tracks:
        """The same tracks of the next picture with ascending numbers of unbroken tracks."""
        self._frame += 1
        seen = np.flatnonzero(tracks.seen)
        ids = tracks.ids[seen]
        positions = (tracks.positions + tracks.displacement)[seen]
        _, own, last = np.intersect1d(ids, self._ids, assume_unique=True, return_indices=True)
        gap = self._frame - self._frames[last]
        step = np.hypot(*(positions[own] - self._positions[last]).T) / gap
        steady = step <= self._longest(step, tracks.species[seen][own]) + self._error / gap
        numbers = np.full(ids.size, -1, dtype=np.int32)
        numbers[own[steady]] = self._numbers[last[steady]]
        new = np.flatnonzero(numbers < 0)
        numbers[new] = self._next + np.arange(new.size)
        self._next += new.size
        self._remember(ids, numbers, positions)
        order = np.argsort(numbers)
        rows = seen[order]
        return replace(
            tracks,
            **{name: getattr(tracks, name)[rows] for name in BEAD_FIELDS}
            | {'ids': numbers[order]},
        )

    def _remember(
        self,
        ids: NDArray[np.int32],
        numbers: NDArray[np.int32],
        positions: NDArray[np.float64],
    ) -> None:
        """Keep these beads, and the hidden ones for a while, with ascending `ids`."""
        hidden = ~np.isin(self._ids, ids) & (self._frame - self._frames < _LONGEST_GAP)
        all_ids = np.concatenate([ids, self._ids[hidden]])
        order = np.argsort(all_ids)
        frames = np.concatenate([np.full(ids.size, self._frame), self._frames[hidden]])
        self._ids = all_ids[order]
        self._numbers = np.concatenate([numbers, self._numbers[hidden]])[order]
        self._frames = frames[order]
        self._positions = np.concatenate([positions, self._positions[hidden]])[order]

    def _longest(
        self, step: NDArray[np.float64], species: NDArray[np.int32]
    ) -> NDArray[np.float64]:
        """Longest step for a picture of each bead that is no jump, without errors, [m]."""
        longest = np.empty(step.size)
        for kind in np.unique(species):
            own = species == kind
            longest[own] = _LONGEST_STEP * np.median(step[own])
            self.steps[int(kind)] = float(step[own].mean())
        return longest
