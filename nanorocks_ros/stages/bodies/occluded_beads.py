"""Occluded beads of a body: they stay in it, and keep their number when they reappear.

Tested by ``test/stages/bodies/test_body_counter.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks
    from nanorocks_ros.stages.bodies.bonds import Bond

# Largest distance in radii between a new track and the expected position of an occluded bead.
_MAX_DISTANCE = 0.5


class OccludedBeads:
    """Assigns bead numbers that survive the loss of a track by occlusion.

    Attributes
    ----------
    hidden : frozenset of int
        Beads without a track whose body has another bead with a track.
    """

    def __init__(self) -> None:
        self.hidden: frozenset[int] = frozenset()
        self._bead_of_track: dict[int, int] = {}
        self._species: dict[int, int] = {}
        self._expected: dict[int, NDArray[np.float64]] = {}
        self._last = b'', np.empty(0, dtype=np.int64)

    def assign_ids(
        self, tracks: Tracks, bonds: Mapping[tuple[int, int], Bond]
    ) -> NDArray[np.int64]:
        """Numbers of the beads of a frame, (n,): the same array while the tracks are the same.

        Parameters
        ----------
        tracks : Tracks
        bonds : mapping
            Bonds by the numbers of both beads.
        """
        key, ids = tracks.ids.tobytes(), self._last[1]
        if key != self._last[0]:
            ids = self._ids_of(tracks)
            self._last = key, ids
        self._expected = _expected_positions(ids, tracks.positions, bonds) if bonds else {}
        self.hidden = frozenset(self._expected)
        return ids

    def _ids_of(self, tracks: Tracks) -> NDArray[np.int64]:
        present = tracks.ids.tolist()
        new_rows = [row for row, track in enumerate(present) if track not in self._bead_of_track]
        if len(self._bead_of_track) + len(new_rows) > len(present):
            still_present = set(present)
            self._bead_of_track = {
                track: bead
                for track, bead in self._bead_of_track.items()
                if track in still_present
            }
        for row in new_rows:
            bead = self._bead_of_track[present[row]] = self._returning_bead(
                tracks, row, present[row]
            )
            self._species[bead] = int(tracks.species[row])
        return np.array([self._bead_of_track[track] for track in present], dtype=np.int64)

    def _returning_bead(self, tracks: Tracks, row: int, track: int) -> int:
        """Number of the occluded bead that a new track belongs to, or the track number itself."""
        for hidden, position in self._expected.items():
            is_near = (
                np.hypot(*(tracks.positions[row] - position)) < _MAX_DISTANCE * tracks.radii[row]
            )
            is_present = hidden in self._bead_of_track.values()
            if is_near and not is_present and self._species[hidden] == tracks.species[row]:
                return hidden
        return track


def _expected_positions(
    ids: NDArray[np.int64],
    positions: NDArray[np.float64],
    bonds: Mapping[tuple[int, int], Bond],
) -> dict[int, NDArray[np.float64]]:
    """Expected positions of beads without a track, from the bonds to their partners."""
    position_of = dict(zip(ids.tolist(), positions, strict=True))
    expected: dict[int, NDArray[np.float64]] = {}
    for (first, second), bond in bonds.items():
        if first in position_of and second not in position_of:
            expected[second] = position_of[first] + np.array(bond.offset)
        elif second in position_of and first not in position_of:
            expected[first] = position_of[second] - np.array(bond.offset)
    return expected
