"""Tracks that begin over a body and stay there: most likely beads of it that were hidden."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Set as AbstractSet

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

# Sums of radii within which a bead is over another, or beside it.
_REACH = 1.15


class Clinging:
    """Follows beads that were first seen at a body, until they are seen apart from it.

    All beads are seen after a shaking event. Who turns up later was hidden, and clusters hide
    their beads: counted as bodies of their own, they would make clusters too small.
    """

    def __init__(self) -> None:
        self._known: set[int] = set()
        self._over: dict[int, int] = {}
        self._last: NDArray[np.int64] | None = None

    def push(
        self, tracks: Tracks, ids: NDArray[np.int64], members: AbstractSet[int]
    ) -> tuple[tuple[int, int], ...]:
        """Take the next picture.

        Parameters
        ----------
        tracks : Tracks
        ids : ndarray (n,)
            Numbers of its beads.
        members : set of int
            Beads of bodies of two and more.

        Returns
        -------
        tuple of (int, int)
            Each bead that clings, and the bead of the body that is nearest to it.
        """
        # Nobody turned up, and nobody clings.
        if ids is self._last and not self._over:
            return ()
        self._last = ids
        numbers = ids.tolist()
        rows = {number: row for row, number in enumerate(numbers)}
        asked = [number for number in numbers if number in self._over or number not in self._known]
        self._known.update(numbers)
        bodies = np.array(
            [row for row, number in enumerate(numbers) if number in members], dtype=int
        )
        over: dict[int, int] = {}
        for one in asked:
            row = rows[one]
            others = bodies[bodies != row]
            if not others.size:
                continue
            apart = np.hypot(*(tracks.positions[others] - tracks.positions[row]).T)
            ratio = apart / (tracks.radii[others] + tracks.radii[row])
            nearest = int(np.argmin(ratio))
            if ratio[nearest] < _REACH:
                over[one] = numbers[others[nearest]]
        self._over = over
        return tuple(over.items())
