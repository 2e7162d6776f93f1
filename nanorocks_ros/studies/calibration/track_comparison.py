"""How tracks made by hand, or the truth of a simulation, compare with ours."""

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
# Steps of the inversion of a view, each of which gains a factor of three or more, and what
# is left then, [px].
_STEPS = 60
_EXACT_PX = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Beads of one picture that are known from elsewhere.

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
    """Tracks against tracks.

    Parameters
    ----------
    beads, places : int
        Of the reference: beads, and places of them in pictures.
    found : float
        Share of those places where we saw a bead.
    links, links_correct : int
        Of two pictures in a row, beads that we followed from one to the other, and that are
        the same bead in the reference.
    switches : int
        How often a bead of the reference got another number.
    switches_per_minute : float, [1/min]
        For each bead; NaN when no time passes.
    rms_distance : float, [m]
        Between places, of both coordinates together.
    offset : tuple of 2 floats, [m]
        Mean of ours less theirs.
    speed_ratio : float
        Our mean speed from picture to picture of the reference, over theirs; NaN when unknown.
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
    reference: Mapping[int, Place],
    *,
    reach: float,
    species: int | None = None,
) -> TrackComparison:
    """Compare tracks with a reference.

    Parameters
    ----------
    tracks : sequence of Tracks
        Of one tray, in order.
    reference : mapping of int to Place
        By the stamp of the picture, [ns].
    reach : float, [m]
        Places further apart are not of the same bead.
    species : int or None
        Of ours, compare this one alone.

    Raises
    ------
    RecordingError
        When no picture of the reference is one of ours.
    """
    count = _Count()
    stamps = []
    for record in tracks:
        known = reference.get(record.stamp_ns)
        shown = record.seen if species is None else record.seen & (record.species == species)
        if known is not None:
            stamps.append(record.stamp_ns)
            count.add(record.stamp_ns, record.ids[shown], record.positions[shown], known, reach)
    if not stamps:
        raise RecordingError(
            'the reference',
            'none of its pictures is one of the recording',
            'say with --first-frame which number the first frame has',
        )
    return count.result((stamps[-1] - stamps[0]) / _NS)


class _Count:
    """Adds up picture after picture."""

    def __init__(self) -> None:
        self._beads: set[int] = set()
        self._places = 0
        self._links = self._correct = self._switches = 0
        self._apart: list[NDArray[np.float64]] = []
        self._number: dict[int, int] = {}
        self._last: dict[int, tuple[int, NDArray[np.float64], NDArray[np.float64]]] = {}
        self._ways = [0.0, 0.0]

    def add(
        self,
        stamp_ns: int,
        ids: NDArray[np.int32],
        positions: NDArray[np.float64],
        known: Place,
        reach: float,
    ) -> None:
        self._beads.update(known.ids.tolist())
        self._places += known.ids.size
        apart = cdist(known.positions, positions)
        rows, columns = linear_sum_assignment(np.minimum(apart, reach))
        near = apart[rows, columns] < reach
        now = {}
        for i, j in zip(rows[near].tolist(), columns[near].tolist(), strict=True):
            bead, number = int(known.ids[i]), int(ids[j])
            here, there = positions[j], known.positions[i]
            self._apart.append(here - there)
            now[number] = (bead, here, there)
            self._switches += self._number.get(bead, number) != number
            self._number[bead] = number
            if number in self._last:
                before, was_here, was_there = self._last[number]
                self._links += 1
                self._correct += before == bead
                if before == bead:
                    self._ways[0] += float(np.hypot(*(here - was_here)))
                    self._ways[1] += float(np.hypot(*(there - was_there)))
        self._last = now

    def result(self, seconds: float) -> TrackComparison:
        apart = np.array(self._apart).reshape(-1, 2)
        some = apart.shape[0] > 0
        minutes = seconds * len(self._beads) / 60.0
        ours, theirs = self._ways
        return TrackComparison(
            beads=len(self._beads),
            places=self._places,
            found=apart.shape[0] / max(self._places, 1),
            links=self._links,
            links_correct=self._correct,
            switches=self._switches,
            switches_per_minute=self._switches / minutes if minutes > 0.0 else np.nan,
            rms_distance=float(np.sqrt(np.mean(np.sum(apart**2, axis=1)))) if some else np.nan,
            offset=(float(apart[:, 0].mean()), float(apart[:, 1].mean()))
            if some
            else (np.nan, np.nan),
            speed_ratio=ours / theirs if theirs > 0.0 else np.nan,
        )


class TrayPicture(Protocol):
    """What has to be known of a picture of a tray; `Tracks` are of one."""

    @property
    def stamp_ns(self) -> int:
        """Instant of exposure, [ns]."""

    @property
    def displacement(self) -> NDArray[np.float64]:
        """Of the tray in the picture, (2,), [m]; 0 where nobody measured it."""


def manual_reference(
    manual: ManualTracks,
    tracks: Sequence[TrayPicture],
    numbers: Sequence[int],
    *,
    region: Region,
    pixels_per_metre: float,
    view: View | None = None,
    first_frame: int = 0,
) -> dict[int, Place]:
    """Tracks made by hand, in the coordinates of the tray.

    Parameters
    ----------
    manual : ManualTracks
        Places in the frames as the camera gave them.
    tracks : sequence of Tracks or other TrayPicture
        Of the tray, for stamps and the displacement of the tray.
    numbers : sequence of int
        Which frame, counted from 0, each of them is of.
    region : Region
        Of the tray in the rectified frame.
    pixels_per_metre : float, [px/m]
    view : View, optional
        What is known of the lens.
    first_frame : int
        Number that the file gives to the first frame.

    Returns
    -------
    dict of int to Place
        By stamp; places beyond the tray are left out.
    """
    straight = manual.places if view is None else _straight(view, manual.places)
    positions = (straight - (region.x, region.y)) / pixels_per_metre
    size = np.array([region.width, region.height]) / pixels_per_metre
    found = {}
    for record, number in zip(tracks, numbers, strict=True):
        here = manual.frames == number + first_frame
        places = positions[here] - record.displacement
        inside = ((places >= 0.0) & (places <= size)).all(axis=1)
        if inside.any():
            found[record.stamp_ns] = Place(ids=manual.ids[here][inside], positions=places[inside])
    return found


def _straight(view: View, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where points of the camera's frame are in the rectified frame; NaN where nowhere."""
    found = np.array(places, dtype=np.float64)
    for _ in range(_STEPS):
        found = found + (places - view.source(found))
    lost = np.abs(view.source(found) - places).max(axis=1) > _EXACT_PX
    found[lost] = np.nan
    return found
