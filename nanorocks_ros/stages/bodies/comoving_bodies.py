"""Bodies beside each other that move as one: clusters that hang together by beads nobody sees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from nanorocks_ros.inference.sticking.chance_proximity import chance_probability
from nanorocks_ros.stages.bodies.bonds import Bond

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.stages.bodies.bond_kernels import Beads

# Bodies are compared so often, [s].
_INTERVAL = 0.1
# Sums of radii within which beads of two bodies may touch; beads that are not seen may lie
# between, each that many radii wide.
_REACH, _BETWEEN = 1.15, 2.0
# Half of the range in which each component of the separation stays, in errors of it: a place is
# known to no better than this part of its error, however many are averaged.
_TOLERANCE, _IN_COMMON = 3.0, 0.5
# No body is younger, [s].
_YOUNGEST = 0.3
# Of the range, what jitter alone makes.
_LEAST_RANGE = 0.25


@dataclass(slots=True)
class _Row:
    """Two bodies: where their beads were at first, and how their separation changed since."""

    start: float
    last: float
    beads: tuple[dict[int, NDArray[np.float64]], dict[int, NDArray[np.float64]]]
    speed: float
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    way: float = 0.0
    tolerance: float = 0.0


class Companions:
    """Follows all pairs of bodies beside each other, of which one at least has several beads.

    By the means of their beads, bodies are known better than beads, and beads between them need
    not be seen.

    Parameters
    ----------
    rate : float, [1/m]
        Encounters of a bead per way, from `encounter_rate`.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._rows: dict[tuple[int, int], _Row] = {}
        self._next = 0.0

    def due(self, time: float) -> bool:
        """Whether bodies are to be compared again."""
        return time >= self._next

    def push(
        self,
        time: float,
        beads: Beads,
        body: Mapping[int, int],
        hidden: bool,
        largest: float,
    ) -> list[Bond]:
        """Take the beads of the next picture in which bodies are compared.

        Parameters
        ----------
        time : float, [s]
        beads : Beads
            With the variances of free bodies of their sizes.
        body : mapping of int to int
            For each bead the least number of a bead of its body.
        hidden : bool
            Whether there are beads that are not seen.
        largest : float
            Bodies are one when the chance that free ones do the same is lower.

        Returns
        -------
        list of Bond
            New ones, of the two beads that are nearest to each other.
        """
        self._next = time + _INTERVAL
        nearest = _neighbours(beads, body, hidden)
        members: dict[int, list[int]] = {}
        for place, one in enumerate(beads.ids.tolist()):
            members.setdefault(body[one], []).append(place)
        self._rows = self._kept(body, nearest)
        bonds = []
        for pair, (near, other) in nearest.items():
            row = self._rows.get(pair)
            if row is None:
                self._rows[pair] = _begun(time, beads, members, pair)
                continue
            stays = self._follows(row, time, beads, members, pair)
            if stays and self._is_one(row, time, largest):
                del self._rows[pair]
                bonds.append(_bond(row, beads, near, other))
        return bonds

    def _kept(
        self, body: Mapping[int, int], nearest: Mapping[tuple[int, int], tuple[int, int]]
    ) -> dict[tuple[int, int], _Row]:
        """Rows under the names that bodies have now; of several the oldest."""
        rows: dict[tuple[int, int], _Row] = {}
        for row in self._rows.values():
            roots = [{body[one] for one in part if one in body} for part in row.beads]
            if len(roots[0]) != 1 or len(roots[1]) != 1 or roots[0] == roots[1]:
                continue
            a, b = roots[0].pop(), roots[1].pop()
            if a > b:
                a, b = b, a
                row.beads = row.beads[1], row.beads[0]
                row.low, row.high = -row.high, -row.low
            if (a, b) in nearest and ((a, b) not in rows or row.way > rows[a, b].way):
                rows[a, b] = row
        return rows

    def _follows(
        self,
        row: _Row,
        time: float,
        beads: Beads,
        members: Mapping[int, list[int]],
        pair: tuple[int, int],
    ) -> bool:
        """Take the separation as it is now; False when it changed, or cannot be told."""
        moved = []
        errors = []
        for part, root in zip(row.beads, pair, strict=True):
            here = [k for k in members[root] if int(beads.ids[k]) in part]
            if not here:
                return False
            steps = [beads.places[k] - part[int(beads.ids[k])] for k in here]
            moved.append(np.median(steps, axis=0))
            error = float(np.median(beads.errors[here]))
            errors.append(error * max(1.25 / np.sqrt(len(here)), _IN_COMMON))
        apart = moved[1] - moved[0]
        row.low, row.high = np.minimum(row.low, apart), np.maximum(row.high, apart)
        row.tolerance = _TOLERANCE * float(np.hypot(*errors))
        row.speed = max(row.speed, _speed(beads, members, pair))
        row.way += row.speed * (time - row.last)
        row.last = time
        if (row.high - row.low > 2.0 * row.tolerance).any():
            self._rows[pair] = _begun(time, beads, members, pair)
            return False
        return True

    def _is_one(self, row: _Row, time: float, largest: float) -> bool:
        if time - row.start < _YOUNGEST:
            return False
        ranged = max(0.5 * float((row.high - row.low).max()), _LEAST_RANGE * row.tolerance)
        return float(chance_probability(row.way, ranged, self._rate)) < largest


def _begun(
    time: float, beads: Beads, members: Mapping[int, list[int]], pair: tuple[int, int]
) -> _Row:
    first, second = (
        {int(beads.ids[k]): beads.places[k].copy() for k in members[root]} for root in pair
    )
    return _Row(
        start=time,
        last=time,
        beads=(first, second),
        speed=_speed(beads, members, pair),
        low=np.zeros(2),
        high=np.zeros(2),
    )


def _speed(beads: Beads, members: Mapping[int, list[int]], pair: tuple[int, int]) -> float:
    """Standard deviation of a component of the relative velocity of two free bodies."""
    return float(np.sqrt(sum(beads.variances[members[root]].mean() for root in pair)))


def _bond(row: _Row, beads: Beads, first: int, second: int) -> Bond:
    offset = beads.places[second] - beads.places[first]
    return Bond(
        (int(beads.ids[first]), int(beads.ids[second])),
        row.start,
        (float(offset[0]), float(offset[1])),
        _TOLERANCE * float(np.hypot(beads.errors[first], beads.errors[second])),
    )


def _neighbours(
    beads: Beads, body: Mapping[int, int], hidden: bool
) -> dict[tuple[int, int], tuple[int, int]]:
    """For each two bodies beside each other the rows of their nearest beads."""
    if beads.ids.size < 2:
        return {}
    roots = np.array([body[one] for one in beads.ids.tolist()])
    sizes = np.unique(roots, return_inverse=True, return_counts=True)
    many = sizes[2][sizes[1]] > 1
    between = _BETWEEN * beads.radii.max() if hidden else 0.0
    furthest = 2.0 * _REACH * beads.radii.max() + between
    found = cKDTree(beads.places).query_pairs(furthest, output_type='ndarray')
    found = found[roots[found[:, 0]] != roots[found[:, 1]]]
    found = found[many[found[:, 0]] | many[found[:, 1]]]
    apart = np.hypot(*(beads.places[found[:, 1]] - beads.places[found[:, 0]]).T)
    apart -= _REACH * (beads.radii[found[:, 0]] + beads.radii[found[:, 1]])
    nearest: dict[tuple[int, int], tuple[int, int]] = {}
    for k in np.argsort(-apart):
        if apart[k] < between or apart[k] < 0.0:
            i, j = found[k].tolist()
            first, second = sorted((i, j))
            a, b = int(roots[i]), int(roots[j])
            nearest[min(a, b), max(a, b)] = (first, second)
    return nearest
