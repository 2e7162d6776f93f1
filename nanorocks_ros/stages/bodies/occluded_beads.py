"""Beads of a body that are hidden: they stay in it, and come back under their old number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks
    from nanorocks_ros.stages.bodies.bonds import Bond

# In radii, how far from its place in the body a bead may come back.
_NEAR = 0.5


class Ghosts:
    """Numbers of beads that outlive the numbers of their tracks.

    Attributes
    ----------
    hidden : frozenset of int
        Beads whose tracks have ended, in a body of which another bead is still followed.
    """

    def __init__(self) -> None:
        self.hidden: frozenset[int] = frozenset()
        self._names: dict[int, int] = {}
        self._species: dict[int, int] = {}
        self._wanted: dict[int, NDArray[np.float64]] = {}
        self._last = b'', np.empty(0, dtype=np.int64)

    def named(self, tracks: Tracks, bonds: Mapping[tuple[int, int], Bond]) -> NDArray[np.int64]:
        """Numbers of the beads of a picture, (n,): the same array while the tracks are the same.

        Parameters
        ----------
        tracks : Tracks
        bonds : mapping
            By the numbers of both beads.
        """
        key, ids = tracks.ids.tobytes(), self._last[1]
        if key != self._last[0]:
            ids = self._named(tracks)
            self._last = key, ids
        self._wanted = _places_of_hidden(ids, tracks.positions, bonds) if bonds else {}
        self.hidden = frozenset(self._wanted)
        return ids

    def _named(self, tracks: Tracks) -> NDArray[np.int64]:
        present = tracks.ids.tolist()
        fresh = [row for row, number in enumerate(present) if number not in self._names]
        if len(self._names) + len(fresh) > len(present):
            there = set(present)
            self._names = {new: old for new, old in self._names.items() if new in there}
        for row in fresh:
            name = self._names[present[row]] = self._back(tracks, row, present[row])
            self._species[name] = int(tracks.species[row])
        return np.array([self._names[one] for one in present], dtype=np.int64)

    def _back(self, tracks: Tracks, row: int, number: int) -> int:
        """The bead that a new track is, or itself."""
        for hidden, place in self._wanted.items():
            near = np.hypot(*(tracks.positions[row] - place)) < _NEAR * tracks.radii[row]
            taken = hidden in self._names.values()
            if near and not taken and self._species[hidden] == tracks.species[row]:
                return hidden
        return number


def _places_of_hidden(
    ids: NDArray[np.int64],
    positions: NDArray[np.float64],
    bonds: Mapping[tuple[int, int], Bond],
) -> dict[int, NDArray[np.float64]]:
    """Where beads of bodies should be that are not followed, by their partners."""
    places = dict(zip(ids.tolist(), positions, strict=True))
    found: dict[int, NDArray[np.float64]] = {}
    for (first, second), bond in bonds.items():
        if first in places and second not in places:
            found[second] = places[first] + np.array(bond.offset)
        elif second in places and first not in places:
            found[first] = places[second] - np.array(bond.offset)
    return found
