"""Tracks of one species: which bead of this picture is which of the last."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.stages.tracking.assignment import assign
from nanorocks_ros.stages.tracking.flight import KEPT, median_square_speed
from nanorocks_ros.stages.tracking.pairs import (
    SIZE_JITTER_PX,
    SLOWEST_PX_S,
    count_lost,
    extend_all,
    in_view,
    most_finite,
    pair_costs,
    predict,
)

if TYPE_CHECKING:
    from nanorocks_ros.stages.tracking.detect import Detections

# Collisions of a bead that nobody sees.
_COLLIDING_A_SECOND = 5.0
# Of a usual velocity component, how much a collision changes one.
_COLLISION = 1.4
# Share of the beads that must be out of reach of collisions for a tray to have been shaken.
_LOST = 0.3
# Pictures in a row that a new bead must be seen in.
_CONFIRM = 3
# Share of a new mean speed taken over in each picture.
_SPEED_SHARE = 0.1
# The size of a bead is measured with an error that pictures share, [px].
_SIZE_FLOOR_PX = 0.03


class InView(NamedTuple):
    """Beads that are believed; lengths in pixels, NaN where a velocity is not known.

    Parameters
    ----------
    ids : ndarray of int32, (n,)
    places, velocities : ndarray (n, 2), [px], [px/s]
    errors, velocity_errors, radii, radius_errors : ndarray (n,)
    seen : ndarray of bool, (n,)
        In this picture; of others the place is where they should be.
    """

    ids: NDArray[np.int32]
    places: NDArray[np.float64]
    errors: NDArray[np.float64]
    velocities: NDArray[np.float64]
    velocity_errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    seen: NDArray[np.bool_]


class Linker:
    """Keeps the tracks of one species; lengths in pixels, times in seconds.

    Parameters
    ----------
    expected : int
        Beads there are.
    size : tuple of 2 floats, [px]
        Columns and rows of the tray.
    fastest : float, [px/s]
    longest_gap, window : float, [s]
    systematic : float, [px]
        Error of all places of a bead together.
    """

    def __init__(
        self,
        expected: int,
        size: tuple[float, float],
        fastest: float,
        longest_gap: float,
        window: float,
        systematic: float,
    ) -> None:
        self.systematic = systematic
        self._expected = expected
        self._size = np.array(size)
        self._fastest = fastest
        self._longest_gap = longest_gap
        self._window = window
        self._speed = 0.0
        self._started = False
        self.numbers = np.empty(0, dtype=np.int32)
        self.last = np.empty(0)
        self.hits = np.empty(0, dtype=np.int64)
        self.radii = np.empty(0)
        self.radius_weights = np.empty(0)
        self._shares = np.empty(0)
        self._times = np.empty((0, KEPT))
        self._places = np.empty((0, KEPT, 2))
        self._errors = np.empty((0, KEPT))
        self._counts = np.empty(0, dtype=np.int64)
        self._lines = np.empty((0, 9))
        self._last_predicted: tuple[float, NDArray[np.float64], NDArray[np.float64]] | None = None

    def push(
        self, time: float, found: Detections, shift: NDArray[np.float64], first_number: int
    ) -> int:
        """Take the beads of the next picture.

        Parameters
        ----------
        time : float, [s]
        found : Detections
        shift : ndarray (2,), [px]
            Where the corner of the tray is now.
        first_number : int
            Of the first new track.

        Returns
        -------
        int
            New tracks.
        """
        places, variances = self.predicted(time, shift)
        costs = self._pair_costs(time, found, (places, variances))
        # Any pair within reach is better than none.
        alone = most_finite(costs) + 1.0
        chosen = assign(costs, alone)
        extend_all(
            chosen,
            self._times,
            self._places,
            self._errors,
            self._counts,
            self._lines,
            time,
            found.places,
            found.place_errors,
            self._window,
        )
        self._last_predicted = None
        hit = chosen >= 0
        self._update_sizes(hit, chosen[hit], found)
        self.last[hit] = time
        self._shares[hit] = found.area_seen[chosen[hit]]
        self._shares[~hit] *= 0.5
        self.hits[hit] += 1
        self._learn_speed()
        self._drop(time, hit)
        left = np.ones(found.radii.size, dtype=bool)
        left[chosen[hit]] = False
        new = np.flatnonzero(left)
        self._add(time, found, new, first_number)
        self._started = True
        return int(new.size)

    def _pair_costs(
        self,
        time: float,
        found: Detections,
        predicted: tuple[NDArray[np.float64], NDArray[np.float64]],
    ) -> NDArray[np.float64]:
        """Costs of all pairs, (tracks, detections).

        Any bead may collide, but when many are not where even a collision could have sent
        them, the tray was shaken.
        """
        costs = np.empty((self.last.size, found.radii.size))
        waits = time - self.last
        collided = max(_COLLISION * self._speed, SLOWEST_PX_S)
        latest: float = waits.min() if waits.size else 0.0
        fresh = waits <= 1.5 * latest
        for shaken_now in (False, True):
            pair_costs(
                *predicted,
                self._places[:, 0].copy(),
                waits,
                self.radii,
                found.places,
                found.place_errors,
                found.radii,
                found.radius_errors,
                collided,
                self._fastest,
                shaken_now,
                costs,
            )
            if count_lost(costs, fresh) <= _LOST * int(np.count_nonzero(fresh)):
                break
        return costs

    @property
    def confirmed(self) -> NDArray[np.bool_]:
        """Which tracks are believed, (n,)."""
        return self.hits >= _CONFIRM

    def predicted(
        self, time: float, shift: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where the beads should be, (n, 2), [px], and the variance of a coordinate, (n,).

        Beads that would have reached a wall come back from it.
        """
        # Asked for twice before the next picture is known.
        if self._last_predicted is None or self._last_predicted[0] != time:
            places, variances = np.empty((self.last.size, 2)), np.empty(self.last.size)
            predict(self._lines, self.radii, time, shift, shift + self._size, places, variances)
            self._last_predicted = time, places, variances
        return self._last_predicted[1:]

    def hints(self, time: float, shift: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where beads should be: column, row, radius and its error, (n, 4), [px].

        Those of which most was seen come first: they lie on top.
        """
        places, _ = self.predicted(time, shift)
        sizes = np.maximum(self.radius_errors(), SIZE_JITTER_PX)
        order = np.argsort(-self._shares, kind='stable')
        return np.column_stack([places - shift, self.radii, sizes])[order]

    def places(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Last place of each bead, (n, 2), and the error of a coordinate, (n,), [px]."""
        return self._places[:, 0], self._errors[:, 0]

    def in_view(self, time: float, shift: NDArray[np.float64]) -> InView:
        """The beads that are believed, as they are now."""
        predicted, variances = self.predicted(time, shift)
        return InView(
            self.numbers[self.confirmed],
            *in_view(
                self.confirmed,
                self.last,
                self._places,
                self._errors,
                self._lines,
                self.radii,
                self.radius_errors(),
                predicted,
                variances,
                time,
                self.systematic,
                (_COLLIDING_A_SECOND, _COLLISION * self._speed),
            ),
        )

    def radius_errors(self) -> NDArray[np.float64]:
        """Standard errors of the radii, (n,), [px]."""
        return np.sqrt(1.0 / self.radius_weights + _SIZE_FLOOR_PX**2)

    def _update_sizes(
        self, hit: NDArray[np.bool_], chosen: NDArray[np.int64], found: Detections
    ) -> None:
        weights = 1.0 / np.square(found.radius_errors[chosen])
        total = self.radius_weights[hit] + weights
        step = (found.radii[chosen] - self.radii[hit]) * weights / total
        self.radii[hit] += step
        self.radius_weights[hit] = total

    def _learn_speed(self) -> None:
        """A usual component of a velocity: half of the beads are faster."""
        known = (self._counts >= 2) & self.confirmed
        if known.any():
            square = median_square_speed(self._lines, known)
            # Of a Maxwellian gas; the median does not heed beads that were confused.
            usual = math.sqrt(square / (2.0 * math.log(2.0)))
            share = 1.0 if usual > self._speed else _SPEED_SHARE
            self._speed += share * (usual - self._speed)

    def _drop(self, time: float, hit: NDArray[np.bool_]) -> None:
        if hit.all():
            return
        waits = time - self.last
        keep = hit | (self.confirmed & (waits <= self._longest_gap))
        surplus = int(np.count_nonzero(keep & self.confirmed)) - self._expected
        if surplus > 0:
            # There are no more beads than that: those lost for longest came back as others.
            lost = np.flatnonzero(keep & ~hit)
            keep[lost[np.argsort(-waits[lost], kind='stable')[:surplus]]] = False
        if not keep.all():
            for name in _STATE:
                setattr(self, name, getattr(self, name)[keep])

    def _add(
        self, time: float, found: Detections, new: NDArray[np.int64], first_number: int
    ) -> None:
        n = new.size
        if n == 0:
            return
        times = np.zeros((n, KEPT))
        times[:, 0] = time
        places = np.zeros((n, KEPT, 2))
        places[:, 0] = found.places[new]
        errors = np.zeros((n, KEPT))
        errors[:, 0] = found.place_errors[new]
        lines = np.zeros((n, 9))
        lines[:, 0] = time
        lines[:, 1:3] = found.places[new]
        lines[:, 5] = np.square(found.place_errors[new])
        lines[:, 6] = np.inf
        hits = np.full(n, 1 if self._started else _CONFIRM)
        added = (
            np.arange(first_number, first_number + n, dtype=np.int32),
            np.full(n, time),
            hits,
            found.radii[new],
            1.0 / np.square(found.radius_errors[new]),
            found.area_seen[new],
            times,
            places,
            errors,
            np.ones(n, dtype=np.int64),
            lines,
        )
        for name, values in zip(_STATE, added, strict=True):
            setattr(self, name, np.concatenate([getattr(self, name), values]))


_STATE = (
    'numbers',
    'last',
    'hits',
    'radii',
    'radius_weights',
    '_shares',
    '_times',
    '_places',
    '_errors',
    '_counts',
    '_lines',
)
