"""Tracks of one species: which bead of this picture is which of the last."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.stages.tracking.linking.link_probabilities import (
    SIZE_JITTER_PX,
    SLOWEST_PX_S,
    Known,
    Seen,
    pair_up,
)
from nanorocks_ros.stages.tracking.linking.motion_prediction import Walls, hint_at, predict
from nanorocks_ros.stages.tracking.linking.track_snapshot import InView, show
from nanorocks_ros.stages.tracking.linking.track_store import (
    CONFIRM,
    Habits,
    advance,
    room_to_follow,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.detection.bead_detector import Detections

# Collisions of a bead that nobody sees.
_COLLIDING_A_SECOND = 5.0
# Of a usual velocity component, how much a collision changes one.
_COLLISION = 1.4


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
        self._size = np.array(size)
        self._fastest = fastest
        self._habits = Habits(expected, longest_gap, window)
        self._speed = 0.0
        self._started = False
        self._followed = room_to_follow(2 * expected)
        self._used = 0
        self._last_predicted: tuple[float, NDArray[np.float64], NDArray[np.float64]] | None = None

    def __len__(self) -> int:
        return self._used

    @property
    def numbers(self) -> NDArray[np.int32]:
        """Of the tracks, (n,)."""
        return self._followed.numbers[: self._used]

    @property
    def last(self) -> NDArray[np.float64]:
        """When each was seen last, (n,), [s]."""
        return self._followed.last[: self._used]

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
        used, followed = self._used, self._followed
        places, variances = self._predicted(time, shift)
        last, sizes = followed.last[:used], followed.radii[:used]
        # A column of many rows is another type for the compiler than one of a single row.
        here = followed.places[:used, 0].copy()
        seen = Seen(found.places, found.place_errors, found.radii, found.radius_errors)
        collided = max(_COLLISION * self._speed, SLOWEST_PX_S)
        known = Known(places, variances, here, time - last, sizes)
        chosen = pair_up(known, seen, collided, self._fastest)
        self._make_room(used, found.radii.size)
        self._used, new, self._speed = advance(
            self._followed,
            used,
            chosen,
            seen,
            found.area_seen,
            time,
            self._habits,
            self._speed,
            first_number,
            1 if self._started else CONFIRM,
        )
        self._started = True
        self._last_predicted = None
        return int(new)

    def _make_room(self, used: int, more: int) -> None:
        """Have room for more tracks than are in use."""
        if used + more <= self._followed.last.size:
            return
        old: tuple[NDArray[Any], ...] = self._followed
        self._followed = room_to_follow(2 * (used + more))
        new: tuple[NDArray[Any], ...] = self._followed
        for column, values in zip(new, old, strict=True):
            column[:used] = values[:used]

    def _walls(self, shift: NDArray[np.float64]) -> Walls:
        return Walls(shift, shift + self._size)

    def _predicted(
        self, time: float, shift: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where the beads should be, (n, 2), [px], and the variance of a coordinate, (n,).

        Beads that would have reached a wall come back from it.
        """
        # Asked for twice before the next picture is known.
        if self._last_predicted is None or self._last_predicted[0] != time:
            places, variances = np.empty((self._used, 2)), np.empty(self._used)
            predict(self._followed, time, self._walls(shift), places, variances)
            self._last_predicted = time, places, variances
        return self._last_predicted[1:]

    def hints(self, time: float, shift: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where beads should be: column, row, radius and its error, (n, 4), [px].

        Those of which most was seen come first: they lie on top.
        """
        places, _ = self._predicted(time, shift)
        order = np.argsort(-self._followed.shares[: self._used], kind='stable')
        hints = np.empty((self._used, 4))
        hint_at(self._followed, order, places, shift, SIZE_JITTER_PX, hints)
        return hints

    def places(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Last place of each bead, (n, 2), and the error of a coordinate, (n,), [px]."""
        return self._followed.places[: self._used, 0], self._followed.errors[: self._used, 0]

    def show(
        self, time: float, shift: NDArray[np.float64], species: int, view: InView, first: int
    ) -> int:
        """Write the beads that are believed, as they are now, and where they end."""
        collisions = _COLLIDING_A_SECOND, _COLLISION * self._speed
        return show(
            self._followed,
            self._used,
            time,
            self._walls(shift),
            self.systematic,
            collisions,
            species,
            view,
            first,
        )
