"""Comparison of tracks with manual tracks, or with the truth of a simulation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from nanorocks_ros.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.plate import Region
    from nanorocks_ros.experiment.view import View
    from nanorocks_ros.records import Tracks
    from nanorocks_ros.studies.calibration.manual_tracks import ManualTracks

_NS = 1e9
# Iterations of the inversion of a view, each of which reduces the error by a factor of three or
# more, and the tolerance after them, [px].
_ITERATIONS = 60
_TOLERANCE_PX = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkedBeads:
    """Reference positions of beads in one image.

    Parameters
    ----------
    ids : ndarray of int64, (n,)
    positions : ndarray (n, 2), [m]
        From the corner of the tray floor.
    """

    ids: NDArray[np.int64]
    positions: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackComparison:
    """Result of a comparison of tracks with a reference.

    Parameters
    ----------
    beads, places : int
        Number of beads of the reference, and of their positions in images.
    found : float
        Fraction of these positions at which the tracks have a bead.
    links, links_correct : int
        Number of links of the tracks between consecutive images, and of those that join the
        same bead of the reference.
    switches : int
        How often the track of a bead of the reference changes.
    switches_per_minute : float, [1/min]
        Switches per bead; NaN for a single image.
    rms_distance : float, [m]
        Root mean square distance between tracks and reference.
    offset : tuple of 2 floats, [m]
        Mean of tracks minus reference.
    speed_ratio : float
        Mean speed of the tracks over that of the reference; NaN when unknown.
    """

    beads: int
    places: int
    found: float
    links: int
    links_correct: int
    switches: int
    switches_per_minute: float
    rms_distance: float
    offset: tuple[float, float]
    speed_ratio: float


def compare_tracks(
    tracks: Sequence[Tracks],
    reference: Mapping[int, MarkedBeads],
    *,
    reach: float,
    species: int | None = None,
) -> TrackComparison:
    """Compare tracks with a reference.

    Parameters
    ----------
    tracks : sequence of Tracks
        Of one tray, in order.
    reference : mapping of int to MarkedBeads
        Beads by the stamp of the image, [ns].
    reach : float, [m]
        Largest distance between positions of the same bead.
    species : int or None
        Compare only tracks of this species.

    Raises
    ------
    RecordingError
        When the reference has no image of the tracks.
    """
    sums = _ComparisonSums()
    stamps = []
    for record in tracks:
        marked = reference.get(record.stamp_ns)
        shown = record.seen if species is None else record.seen & (record.species == species)
        if marked is not None:
            stamps.append(record.stamp_ns)
            sums.add(record.ids[shown], record.positions[shown], marked, reach)
    if not stamps:
        raise RecordingError(
            'the reference',
            'none of its pictures is one of the recording',
            'say with --first-frame which number the first frame has',
        )
    return sums.result((stamps[-1] - stamps[0]) / _NS)


class _ComparisonSums:
    """Sums over images."""

    def __init__(self) -> None:
        self._beads: set[int] = set()
        self._places = 0
        self._links = self._correct = self._switches = 0
        self._differences: list[NDArray[np.float64]] = []
        self._track_ids: dict[int, int] = {}
        self._last: dict[int, tuple[int, NDArray[np.float64], NDArray[np.float64]]] = {}
        self._paths = [0.0, 0.0]

    def add(
        self,
        ids: NDArray[np.int32],
        positions: NDArray[np.float64],
        marked: MarkedBeads,
        reach: float,
    ) -> None:
        self._beads.update(marked.ids.tolist())
        self._places += marked.ids.size
        distances = cdist(marked.positions, positions)
        rows, columns = linear_sum_assignment(np.minimum(distances, reach))
        matched = distances[rows, columns] < reach
        current = {}
        for i, j in zip(rows[matched].tolist(), columns[matched].tolist(), strict=True):
            bead, number = int(marked.ids[i]), int(ids[j])
            position, reference_position = positions[j], marked.positions[i]
            self._differences.append(position - reference_position)
            current[number] = (bead, position, reference_position)
            self._switches += self._track_ids.get(bead, number) != number
            self._track_ids[bead] = number
            if number in self._last:
                last_bead, last_position, last_reference = self._last[number]
                self._links += 1
                self._correct += last_bead == bead
                if last_bead == bead:
                    self._paths[0] += float(np.hypot(*(position - last_position)))
                    self._paths[1] += float(np.hypot(*(reference_position - last_reference)))
        self._last = current

    def result(self, seconds: float) -> TrackComparison:
        differences = np.array(self._differences).reshape(-1, 2)
        any_matched = differences.shape[0] > 0
        minutes = seconds * len(self._beads) / 60.0
        path, reference_path = self._paths
        return TrackComparison(
            beads=len(self._beads),
            places=self._places,
            found=differences.shape[0] / max(self._places, 1),
            links=self._links,
            links_correct=self._correct,
            switches=self._switches,
            switches_per_minute=self._switches / minutes if minutes > 0.0 else np.nan,
            rms_distance=float(np.sqrt(np.mean(np.sum(differences**2, axis=1))))
            if any_matched
            else np.nan,
            offset=(float(differences[:, 0].mean()), float(differences[:, 1].mean()))
            if any_matched
            else (np.nan, np.nan),
            speed_ratio=path / reference_path if reference_path > 0.0 else np.nan,
        )


class TrayView(Protocol):
    """Time and displacement of a tray image; `Tracks` have both."""

    @property
    def stamp_ns(self) -> int:
        """Instant of exposure, [ns]."""

    @property
    def displacement(self) -> NDArray[np.float64]:
        """Displacement of the tray in the image, (2,), [m]; 0 where it is not measured."""


def manual_reference(
    manual: ManualTracks,
    tracks: Sequence[TrayView],
    numbers: Sequence[int],
    *,
    region: Region,
    pixels_per_metre: float,
    view: View | None = None,
    first_frame: int = 0,
) -> dict[int, MarkedBeads]:
    """Manual tracks in the coordinates of the tray.

    Parameters
    ----------
    manual : ManualTracks
        Positions in the frames of the camera.
    tracks : sequence of Tracks or other TrayView
        Of the tray, for time stamps and displacements.
    numbers : sequence of int
        Frame number of each of them, from 0.
    region : Region
        Of the tray in the rectified frame.
    pixels_per_metre : float, [px/m]
    view : View, optional
        Lens and pose of the camera.
    first_frame : int
        Number of the first frame in the file.

    Returns
    -------
    dict of int to MarkedBeads
        Beads by stamp, without positions outside the tray.
    """
    rectified = manual.places if view is None else _rectified_points(view, manual.places)
    positions = (rectified - (region.x, region.y)) / pixels_per_metre
    size = np.array([region.width, region.height]) / pixels_per_metre
    reference = {}
    for record, number in zip(tracks, numbers, strict=True):
        in_frame = manual.frames == number + first_frame
        positions_in_tray = positions[in_frame] - record.displacement
        inside = ((positions_in_tray >= 0.0) & (positions_in_tray <= size)).all(axis=1)
        if inside.any():
            reference[record.stamp_ns] = MarkedBeads(
                ids=manual.ids[in_frame][inside], positions=positions_in_tray[inside]
            )
    return reference


def _rectified_points(view: View, distorted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions in the rectified frame of points in the camera frame; NaN where undefined."""
    rectified = np.array(distorted, dtype=np.float64)
    for _ in range(_ITERATIONS):
        rectified = rectified + (distorted - view.source(rectified))
    failed = np.abs(view.source(rectified) - distorted).max(axis=1) > _TOLERANCE_PX
    rectified[failed] = np.nan
    return rectified
