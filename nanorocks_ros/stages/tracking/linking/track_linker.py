"""Linking of detections to tracks for one species.

Tested by ``test/stages/tracking/test_tracker.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.tracking.linking.flight_deviations import FlightPaths, add_places
from nanorocks_ros.stages.tracking.linking.link_probabilities import (
    MIN_VELOCITY_CHANGE_PX_S,
    RADIUS_NOISE_PX,
    DetectedBeads,
    KnownBeads,
    link_detections,
)
from nanorocks_ros.stages.tracking.linking.motion_prediction import Walls, predict, write_hints
from nanorocks_ros.stages.tracking.linking.struck_beads import link_struck_beads
from nanorocks_ros.stages.tracking.linking.track_snapshot import TrackSnapshot, write_snapshot
from nanorocks_ros.stages.tracking.linking.track_store import (
    CONFIRM_FRAMES,
    LinkSettings,
    TrackStore,
    allocate_tracks,
    update_tracks,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.detection.bead_detector import Detections
    from nanorocks_ros.stages.tracking.linking.flight_deviations import FlightDeviations

# Rate of unseen collisions of a bead, [1/s].
_COLLISION_RATE = 5.0
# Change of a velocity component in a collision, over its standard deviation.
_COLLISION_FACTOR = 1.4


class Linker:
    """Links the detections of one species; lengths in pixels, times in seconds.

    Parameters
    ----------
    expected : int
        Number of beads in the tray.
    size : tuple of 2 floats, [px]
        Columns and rows of the tray.
    max_speed : float, [px/s]
    memory, window : float, [s]
    deviations : FlightDeviations
        Of this species, in pixels: it learns the errors of the positions.

    Attributes
    ----------
    max_speed : float, [px/s]
    follows_struck_beads : bool
        Whether a lone bead keeps its number when it is struck, however slow the others are.
    """

    def __init__(
        self,
        expected: int,
        size: tuple[float, float],
        max_speed: float,
        memory: float,
        window: float,
        deviations: FlightDeviations,
    ) -> None:
        self.follows_struck_beads = False
        self._deviations = deviations
        self._size = np.array(size)
        self.max_speed = max_speed
        self._settings = LinkSettings(expected, memory, window)
        self._speed = 0.0
        self._started = False
        self._tracks = allocate_tracks(2 * expected)
        self._n_tracks = 0
        self._last_prediction: tuple[float, NDArray[np.float64], NDArray[np.float64]] | None = None

    def __len__(self) -> int:
        return self._n_tracks

    @property
    def ids(self) -> NDArray[np.int32]:
        """Numbers of the tracks, (n,)."""
        return self._tracks.ids[: self._n_tracks]

    @property
    def last_seen(self) -> NDArray[np.float64]:
        """Time of the last detection of each track, (n,), [s]."""
        return self._tracks.last_seen[: self._n_tracks]

    def push(
        self, time: float, detections: Detections, shift: NDArray[np.float64], first_id: int
    ) -> int:
        """Link the detections of the next frame.

        Parameters
        ----------
        time : float, [s]
        detections : Detections
        shift : ndarray (2,), [px]
            Position of the corner of the tray in the camera frame.
        first_id : int
            Number of the first new track.

        Returns
        -------
        int
            Number of new tracks.
        """
        n_tracks, tracks = self._n_tracks, self._tracks
        positions, variances = self._predicted(time, shift)
        last_seen, radii = tracks.last_seen[:n_tracks], tracks.radii[:n_tracks]
        # A copy: numba compiles strided and contiguous arrays separately.
        last_positions = tracks.positions[:n_tracks, 0].copy()
        detected = DetectedBeads(
            detections.positions,
            detections.position_errors,
            detections.radii,
            detections.radius_errors,
        )
        velocity_change = max(_COLLISION_FACTOR * self._speed, MIN_VELOCITY_CHANGE_PX_S)
        known_beads = KnownBeads(positions, variances, last_positions, time - last_seen, radii)
        links = link_detections(known_beads, detected, velocity_change, self.max_speed)
        if self.follows_struck_beads:
            links = link_struck_beads(links, known_beads, detected, self.max_speed)
        self._grow(n_tracks, detections.radii.size)
        self._n_tracks, n_new, self._speed = _update(
            self._tracks,
            self._deviations.paths,
            n_tracks,
            links,
            detected,
            detections.visible_share,
            time,
            self._settings,
            self._speed,
            first_id,
            1 if self._started else CONFIRM_FRAMES,
        )
        self._started = True
        self._last_prediction = None
        return int(n_new)

    def _grow(self, n_tracks: int, n_new: int) -> None:
        """Enlarge the store if it cannot hold `n_new` more tracks."""
        if n_tracks + n_new <= self._tracks.last_seen.size:
            return
        tracks: tuple[NDArray[Any], ...] = self._tracks
        self._tracks = allocate_tracks(2 * (n_tracks + n_new))
        larger: tuple[NDArray[Any], ...] = self._tracks
        for column, values in zip(larger, tracks, strict=True):
            column[:n_tracks] = values[:n_tracks]

    def _walls(self, shift: NDArray[np.float64]) -> Walls:
        return Walls(shift, shift + self._size)

    def _predicted(
        self, time: float, shift: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Predicted positions, (n, 2), [px], and the variance of a coordinate, (n,).

        Walls reflect.
        """
        # Known from the hints.
        if self._last_prediction is None or self._last_prediction[0] != time:
            positions, variances = np.empty((self._n_tracks, 2)), np.empty(self._n_tracks)
            predict(self._tracks, time, self._walls(shift), positions, variances)
            self._last_prediction = time, positions, variances
        return self._last_prediction[1:]

    def hints(self, time: float, shift: NDArray[np.float64]) -> NDArray[np.float64]:
        """Hints for the detection: column, row, radius and its error, (n, 4), [px].

        Beads with the largest visible share come first: they lie on top.
        """
        count = self._n_tracks
        positions, variances, hints = np.empty((count, 2)), np.empty(count), np.empty((count, 4))
        walls = self._walls(shift)
        write_hints(self._tracks, time, walls, RADIUS_NOISE_PX, positions, variances, hints)
        self._last_prediction = time, positions, variances
        return hints

    def positions(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Last position of each bead, (n, 2), and the error of a coordinate, (n,), [px]."""
        return self._tracks.positions[: self._n_tracks, 0], self._tracks.errors[
            : self._n_tracks, 0
        ]

    def write_snapshot(
        self,
        time: float,
        shift: NDArray[np.float64],
        species: int,
        snapshot: TrackSnapshot,
        first: int,
    ) -> int:
        """Write the confirmed tracks into a snapshot; return the row after the last one."""
        collisions = _COLLISION_RATE, _COLLISION_FACTOR * self._speed
        return write_snapshot(
            self._tracks,
            self._n_tracks,
            time,
            self._walls(shift),
            self._deviations.scaling,
            collisions,
            species,
            snapshot,
            first,
        )


@compiled
def _update(
    tracks: TrackStore,
    paths: FlightPaths,
    n_tracks: int,
    links: NDArray[np.int64],
    detected: DetectedBeads,
    visible_shares: NDArray[np.float64],
    time: float,
    settings: LinkSettings,
    speed: float,
    first_id: int,
    hits: int,
) -> tuple[int, int, float]:
    """Update the tracks, as `update_tracks`, and compare their places with straight flights."""
    n_tracks, n_new, speed = update_tracks(
        tracks, n_tracks, links, detected, visible_shares, time, settings, speed, first_id, hits
    )
    ids, errors = np.empty(n_tracks, dtype=np.int32), np.empty(n_tracks)
    places = np.empty((n_tracks, 2))
    count = 0
    for k in range(n_tracks):
        if tracks.last_seen[k] == time and tracks.hits[k] >= CONFIRM_FRAMES:
            ids[count], errors[count] = tracks.ids[k], tracks.errors[k, 0]
            places[count] = tracks.positions[k, 0]
            count += 1
    add_places(paths, time, ids[:count], places[:count], errors[:count])
    return n_tracks, n_new, speed
