"""The width of a tray by the places where beads turn back: at a wall many turn at one place.

Tested by ``test/stages/scale/test_scale_check.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

# A bead has turned when it came back by this share of its radius: more than noise.
_BACK = 0.2
# Width of a wall in the places of turning, in radii of the bead: that of the path of a fast bead
# between two pictures.
_WALL = 0.15
# Least number of turns at a wall and of beads that took part; share of the turns beyond it, by
# beads that were confused with others.
_LEAST_TURNS, _LEAST_BEADS, _BEYOND = 6, 3, 0.1
# A wall stands out of the turns by collisions in the interior by so many standard deviations.
_STANDS_OUT = 4.0
# Part of the tray on each side in which walls are looked for.
_OUTER = 0.3
# Places of turning that are kept for each side, and pictures whose outermost beads are.
_KEPT = 2000
# Share of the pictures that may show a bead beyond a wall, by more than this share of a radius:
# beads that rest on the wall turn nowhere, and others turn at them.
_BEYOND_RADII = 0.4


@compiled
def _turns(
    slots: NDArray[np.int64],
    places: NDArray[np.float64],
    radii: NDArray[np.float64],
    state: NDArray[np.float64],
    turns: NDArray[np.float64],
) -> int:
    """Follow the beads of a picture; write those that have turned back since, and count them.

    Parameters
    ----------
    slots : ndarray of int64, (n,)
        Row of each bead in `state`.
    places : ndarray (n, 2), [m]
    radii : ndarray (n,), [m]
    state : ndarray (m, 2, 2)
        For each bead and axis the direction, 0 at first, and the outermost place since it last
        turned; changed.
    turns : ndarray (2 n, 4)
        Written: axis, 1 for the high side, place of the side of the bead there, slot.
    """
    count = 0
    for k in range(slots.size):
        back = _BACK * radii[k]
        for axis in range(2):
            own, place = state[slots[k], axis], places[k, axis]
            if own[0] == 0.0:
                own[0], own[1] = 1.0, place
            elif own[0] * (place - own[1]) > 0.0:
                own[1] = place
            elif own[0] * (own[1] - place) > back:
                turns[count, 0], turns[count, 1] = axis, 1.0 if own[0] > 0.0 else 0.0
                turns[count, 2] = own[1] + own[0] * radii[k]
                turns[count, 3] = slots[k]
                count += 1
                own[0], own[1] = -own[0], place
    return count


class TurningPoints:
    """Places at which the beads of a tray turned back, on each of its four sides.

    Parameters
    ----------
    radius : float, [m]
        Of a usual bead.
    """

    def __init__(self, radius: float) -> None:
        self._radius = radius
        # Row of each bead in the state by its number, in the order in which they were seen first;
        # -1 before.
        self._slots = np.full(256, -1)
        self._beads = 0
        self._state = np.zeros((256, 2, 2))
        self._turns: dict[tuple[int, int], list[tuple[float, float]]] = {
            (axis, high): [] for axis in range(2) for high in range(2)
        }
        self._outermost: dict[tuple[int, int], list[float]] = {key: [] for key in self._turns}

    def push(self, tracks: Tracks) -> None:
        """Follow the beads that are seen."""
        seen = tracks.seen
        slots = self._slots_of(tracks.ids)[seen]
        places, radii = tracks.positions[seen], tracks.radii[seen]
        self._add_outermost(places, radii)
        turns = np.empty((2 * slots.size, 4))
        count = _turns(slots, places, radii, self._state, turns)
        for axis, high, place, slot in turns[:count].tolist():
            side = self._turns[int(axis), int(high)]
            if len(side) < _KEPT:
                side.append((place, slot))

    def _add_outermost(self, places: NDArray[np.float64], radii: NDArray[np.float64]) -> None:
        if not radii.size or len(self._outermost[0, 0]) >= _KEPT:
            return
        low = (places - radii[:, np.newaxis]).min(axis=0).tolist()
        high = (places + radii[:, np.newaxis]).max(axis=0).tolist()
        for axis in range(2):
            self._outermost[axis, 0].append(low[axis])
            self._outermost[axis, 1].append(high[axis])

    def _slots_of(self, ids: NDArray[np.int32]) -> NDArray[np.int64]:
        """Row of each bead in the state."""
        largest = int(ids.max(initial=0))
        if largest >= self._slots.size:
            further = np.full(largest + self._slots.size, -1)
            self._slots = np.concatenate([self._slots, further])
        slots = self._slots[ids]
        if slots.min(initial=0) < 0:
            new = ids[slots < 0]
            self._slots[new] = self._beads + np.arange(new.size)
            self._beads += new.size
            slots = self._slots[ids]
        while self._beads > len(self._state):
            self._state = np.concatenate([self._state, np.zeros_like(self._state)])
        return slots

    def width(self, axis: int, expected: float) -> tuple[float, float] | None:
        """Distance of the two walls across an axis, and its error, [m]; None when unknown.

        Parameters
        ----------
        axis : int
        expected : float, [m]
            What it should be.
        """
        low = self._wall(axis, 0, expected)
        high = self._wall(axis, 1, expected)
        if low is None or high is None:
            return None
        return high[0] - low[0], math.hypot(low[1], high[1])

    def _wall(self, axis: int, high: int, expected: float) -> tuple[float, float] | None:
        """Place of a wall and its error, [m]."""
        turns = np.array(self._turns[axis, high]).reshape(-1, 2)
        # Measured inwards from where the wall should be.
        inwards = expected - turns[:, 0] if high else turns[:, 0]
        order = np.argsort(inwards)
        inwards, beads = inwards[order], turns[order, 1]
        width = _WALL * self._radius
        ends = np.searchsorted(inwards, inwards + width, side='right')
        counts = ends - np.arange(inwards.size)
        counts[inwards > _OUTER * expected] = 0
        if not counts.size or counts.max() < _LEAST_TURNS:
            return None
        first = int(counts.argmax())
        end = int(ends[first])
        inside = inwards[first:end]
        if np.unique(beads[first:end]).size < _LEAST_BEADS or first > _BEYOND * inside.size:
            return None
        further = inwards[end:]
        usual = width * further.size / max(expected - float(inside[-1]), width)
        if inside.size < usual + _STANDS_OUT * math.sqrt(usual):
            return None
        # Between two pictures a bead may have come nearer to the wall than in any: the outer
        # half counts.
        outer, middle = np.quantile(inside, [0.1, 0.5])
        place = float(np.quantile(inside, 0.25))
        outermost = np.array(self._outermost[axis, high])
        beyond = (
            expected - outermost if high else outermost
        ) < place - _BEYOND_RADII * self._radius
        if beyond.mean() > _BEYOND:
            return None
        return (expected - place if high else place), float(middle - outer)
