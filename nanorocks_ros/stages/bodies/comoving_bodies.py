"""Adjacent bodies that move together: clusters joined by beads that are hidden."""

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

    from nanorocks_ros.stages.bodies.touching_pairs import SeenBeads

# Interval at which bodies are compared, [s].
_COMPARISON_INTERVAL = 0.1
# Largest distance of two beads that may touch, in sums of radii; width in radii of a hidden bead
# that may lie between them.
_MAX_DISTANCE, _GAP_RADII = 1.15, 2.0
# Half of the range of each component of the separation, in its errors; and the smallest error of a
# mean position over the error of one bead, however many beads are averaged.
_TOLERANCE_SIGMAS, _MIN_ERROR_SHARE = 3.0, 0.5
# Smallest age of a bond, [s].
_MIN_AGE = 0.3
# Smallest range, in tolerances: what position noise alone makes.
_MIN_RANGE = 0.25


@dataclass(slots=True)
class _BodyPair:
    """Two bodies: first positions of their beads, and the range of their separation since."""

    start: float
    last: float
    beads: tuple[dict[int, NDArray[np.float64]], dict[int, NDArray[np.float64]]]
    speed: float
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    path: float = 0.0
    tolerance: float = 0.0


class ComovingBodies:
    """Compares adjacent bodies, at least one of them of several beads.

    The mean position of a body is more precise than that of a bead, and beads between two bodies
    need not be visible.

    Parameters
    ----------
    rate : float, [1/m]
        Encounters that part a pair, per path, from `parting_rate`.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._pairs: dict[tuple[int, int], _BodyPair] = {}
        self._next = 0.0

    def due(self, time: float) -> bool:
        """Whether the next comparison is due."""
        return time >= self._next

    def push(
        self,
        time: float,
        beads: SeenBeads,
        body_of: Mapping[int, int],
        hidden: bool,
        max_chance: float,
    ) -> list[Bond]:
        """Compare the bodies of a frame with those of the frames before.

        Parameters
        ----------
        time : float, [s]
        beads : SeenBeads
            With the velocity variances of free bodies of their sizes.
        body_of : mapping of int to int
            For each bead the lowest number of a bead of its body.
        hidden : bool
            Whether beads of the tray are not visible.
        max_chance : float
            Two bodies are one if the probability that free bodies do the same is lower.

        Returns
        -------
        list of Bond
            New bonds, each between the two nearest beads of the bodies.
        """
        self._next = time + _COMPARISON_INTERVAL
        nearest = _nearest_beads(beads, body_of, hidden)
        members: dict[int, list[int]] = {}
        for row, bead in enumerate(beads.ids.tolist()):
            members.setdefault(body_of[bead], []).append(row)
        self._pairs = self._relabelled(body_of, nearest)
        bonds = []
        for key, (first, second) in nearest.items():
            body_pair = self._pairs.get(key)
            if body_pair is None:
                self._pairs[key] = _start_pair(time, beads, members, key)
                continue
            stays = self._update(body_pair, time, beads, members, key)
            if stays and self._is_bonded(body_pair, time, max_chance):
                del self._pairs[key]
                bonds.append(_bond(body_pair, beads, first, second))
        return bonds

    def _relabelled(
        self, body_of: Mapping[int, int], nearest: Mapping[tuple[int, int], tuple[int, int]]
    ) -> dict[tuple[int, int], _BodyPair]:
        """Pairs under the current numbers of the bodies; of several, the longest path."""
        pairs: dict[tuple[int, int], _BodyPair] = {}
        for body_pair in self._pairs.values():
            roots = [
                {body_of[bead] for bead in positions if bead in body_of}
                for positions in body_pair.beads
            ]
            if len(roots[0]) != 1 or len(roots[1]) != 1 or roots[0] == roots[1]:
                continue
            a, b = roots[0].pop(), roots[1].pop()
            if a > b:
                a, b = b, a
                body_pair.beads = body_pair.beads[1], body_pair.beads[0]
                body_pair.low, body_pair.high = -body_pair.high, -body_pair.low
            if (a, b) in nearest and ((a, b) not in pairs or body_pair.path > pairs[a, b].path):
                pairs[a, b] = body_pair
        return pairs

    def _update(
        self,
        body_pair: _BodyPair,
        time: float,
        beads: SeenBeads,
        members: Mapping[int, list[int]],
        pair: tuple[int, int],
    ) -> bool:
        """Update the separation; False if it left its range or no bead is visible."""
        shifts = []
        errors = []
        for start, root in zip(body_pair.beads, pair, strict=True):
            rows = [row for row in members[root] if int(beads.ids[row]) in start]
            if not rows:
                return False
            moves = [beads.positions[row] - start[int(beads.ids[row])] for row in rows]
            shifts.append(np.median(moves, axis=0))
            error = float(np.median(beads.errors[rows]))
            errors.append(error * max(1.25 / np.sqrt(len(rows)), _MIN_ERROR_SHARE))
        separation = shifts[1] - shifts[0]
        body_pair.low, body_pair.high = (
            np.minimum(body_pair.low, separation),
            np.maximum(body_pair.high, separation),
        )
        body_pair.tolerance = _TOLERANCE_SIGMAS * float(np.hypot(*errors))
        body_pair.speed = max(body_pair.speed, _relative_speed(beads, members, pair))
        body_pair.path += body_pair.speed * (time - body_pair.last)
        body_pair.last = time
        if (body_pair.high - body_pair.low > 2.0 * body_pair.tolerance).any():
            self._pairs[pair] = _start_pair(time, beads, members, pair)
            return False
        return True

    def _is_bonded(self, body_pair: _BodyPair, time: float, max_chance: float) -> bool:
        if time - body_pair.start < _MIN_AGE:
            return False
        half_range = max(
            0.5 * float((body_pair.high - body_pair.low).max()), _MIN_RANGE * body_pair.tolerance
        )
        return float(chance_probability(body_pair.path, half_range, self._rate)) < max_chance


def _start_pair(
    time: float, beads: SeenBeads, members: Mapping[int, list[int]], pair: tuple[int, int]
) -> _BodyPair:
    first, second = (
        {int(beads.ids[k]): beads.positions[k].copy() for k in members[root]} for root in pair
    )
    return _BodyPair(
        start=time,
        last=time,
        beads=(first, second),
        speed=_relative_speed(beads, members, pair),
        low=np.zeros(2),
        high=np.zeros(2),
    )


def _relative_speed(
    beads: SeenBeads, members: Mapping[int, list[int]], pair: tuple[int, int]
) -> float:
    """Standard deviation of a component of the relative velocity of two free bodies."""
    return float(np.sqrt(sum(beads.variances[members[root]].mean() for root in pair)))


def _bond(body_pair: _BodyPair, beads: SeenBeads, first: int, second: int) -> Bond:
    offset = beads.positions[second] - beads.positions[first]
    return Bond(
        (int(beads.ids[first]), int(beads.ids[second])),
        body_pair.start,
        (float(offset[0]), float(offset[1])),
        _TOLERANCE_SIGMAS * float(np.hypot(beads.errors[first], beads.errors[second])),
    )


def _nearest_beads(
    beads: SeenBeads, body_of: Mapping[int, int], hidden: bool
) -> dict[tuple[int, int], tuple[int, int]]:
    """Rows of the two nearest beads, for each pair of adjacent bodies."""
    if beads.ids.size < 2:
        return {}
    roots = np.array([body_of[bead] for bead in beads.ids.tolist()])
    bodies = np.unique(roots, return_inverse=True, return_counts=True)
    in_cluster = bodies[2][bodies[1]] > 1
    gap = _GAP_RADII * beads.radii.max() if hidden else 0.0
    max_distance = 2.0 * _MAX_DISTANCE * beads.radii.max() + gap
    pairs = cKDTree(beads.positions).query_pairs(max_distance, output_type='ndarray')
    pairs = pairs[roots[pairs[:, 0]] != roots[pairs[:, 1]]]
    pairs = pairs[in_cluster[pairs[:, 0]] | in_cluster[pairs[:, 1]]]
    gaps = np.hypot(*(beads.positions[pairs[:, 1]] - beads.positions[pairs[:, 0]]).T)
    gaps -= _MAX_DISTANCE * (beads.radii[pairs[:, 0]] + beads.radii[pairs[:, 1]])
    nearest: dict[tuple[int, int], tuple[int, int]] = {}
    for k in np.argsort(-gaps):
        if gaps[k] < gap or gaps[k] < 0.0:
            i, j = pairs[k].tolist()
            first, second = sorted((i, j))
            a, b = int(roots[i]), int(roots[j])
            nearest[min(a, b), max(a, b)] = (first, second)
    return nearest
