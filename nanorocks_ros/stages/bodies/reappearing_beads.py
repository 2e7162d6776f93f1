"""Tracks that begin at a body and stay there: most likely beads of it that reappear.

Tested by ``test/stages/bodies/test_comoving_bodies.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Set as AbstractSet

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

# Largest distance of a bead that is at a body, in sums of radii.
_MAX_DISTANCE = 1.15


class ReappearingBeads:
    """Attaches beads that were first seen at a body to it, until they are seen apart from it.

    All beads are visible after a shaking event. A track that begins later is of a bead that a
    cluster had hidden. Counted as a body of its own, it would make the mean cluster too small.
    """

    def __init__(self) -> None:
        self._known: set[int] = set()
        self._attached: dict[int, int] = {}
        self._last: NDArray[np.int64] | None = None

    def push(
        self, tracks: Tracks, ids: NDArray[np.int64], members: AbstractSet[int]
    ) -> tuple[tuple[int, int], ...]:
        """Add the next frame.

        Parameters
        ----------
        tracks : Tracks
        ids : ndarray (n,)
            Numbers of the beads.
        members : set of int
            Beads of bodies of two or more.

        Returns
        -------
        tuple of (int, int)
            Each attached bead, and the nearest bead of the body.
        """
        # No new track, and no attached bead.
        if ids is self._last and not self._attached:
            return ()
        self._last = ids
        numbers = ids.tolist()
        rows = {number: row for row, number in enumerate(numbers)}
        candidates = [
            number for number in numbers if number in self._attached or number not in self._known
        ]
        self._known.update(numbers)
        members_rows = np.array(
            [row for row, number in enumerate(numbers) if number in members], dtype=int
        )
        attached: dict[int, int] = {}
        for bead in candidates:
            row = rows[bead]
            body_rows = members_rows[members_rows != row]
            if not body_rows.size:
                continue
            distances = np.hypot(*(tracks.positions[body_rows] - tracks.positions[row]).T)
            ratio = distances / (tracks.radii[body_rows] + tracks.radii[row])
            nearest = int(np.argmin(ratio))
            if ratio[nearest] < _MAX_DISTANCE:
                attached[bead] = numbers[body_rows[nearest]]
        self._attached = attached
        return tuple(attached.items())
