"""How well the beads of a tray are recognised, counted over a film."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import Quality
from nanorocks_ros.stages.tracking.recognition_kernels import (
    COUNTS,
    SUMS_OF_TRACK,
    Discs,
    add_image,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Species, Tray
    from nanorocks_ros.records import Tracks

# A disc at rest stays within this part of its radius, or this many errors of its position.
_REST_RADII, _REST_ERRORS = 0.25, 8.0
# A track tells whether its disc moves when it lasts for this part of the film.
_LONG_SHARE = 0.25
# Frames of the longer displacements, beside those of one frame; how many tell, and their squares
# over those of errors.
_LONG_LAG, _LEAST_DISPLACEMENTS, _LEAST_SIGNAL = 4, 100, 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeciesCounts:
    """How well one species of a tray is recognised.

    Parameters
    ----------
    tray : int
    material : str
    expected : int or None
        Beads that the tray holds; None: any number.
    followed : bool
        Whether it is tracked at all: crowded grains are not.
    frames : int
    seen, tracked : float
        Discs seen, and with those that are predicted, mean over the frames.
    complete : float
        Share of the frames in which all expected beads are seen.
    tracks : int
        Numbers that were given out.
    track_length : float, [frames]
        Median over the discs.
    at_rest : float
        Share of the discs, by frames, that never move; NaN: no track is long enough to tell.
    overlapping : float
        Share of the discs seen that overlap another one more than beads can.
    near_limit : float
        Share of the speeds near the largest one at which beads are linked.
    max_speed : float, [m/s]
        That largest speed.
    wrong_scale : float
        Share of the frames that are flagged `WRONG_SCALE`.
    spread_exponent : float
        Power of the time with which squared displacements grow: 2 in free flight, 1 in diffusion;
        NaN: too few displacements above the errors of the positions.
    learnt : bool
        Whether the look of the beads is learnt from the film.
    diameter_ratio : float
        Diameter of the discs, median over these, over the nearest that is told;
        NaN: nothing is seen.
    """

    tray: int
    material: str
    expected: int | None
    followed: bool
    frames: int
    seen: float
    tracked: float
    complete: float
    tracks: int
    track_length: float
    at_rest: float
    overlapping: float
    near_limit: float
    max_speed: float
    wrong_scale: float
    spread_exponent: float = math.nan
    learnt: bool = False
    diameter_ratio: float = math.nan


class RecognitionCounter:
    """Counts over the tracks of a tray.

    Parameters
    ----------
    tray : Tray
    crowded : bool
        Whether some of the species are not tracked, since their grains are too many.
    """

    def __init__(self, tray: Tray, *, crowded: bool = False) -> None:
        self._tray = tray
        self._max_speed = 0.0
        self._crowded = crowded
        self._frames = 0
        self._wrong_scale = 0
        count = len(tray.species)
        self._expected = np.array([species.count for species in tray.species])
        self._least_distances = np.array([_least_distance(tray, k) for k in range(count)])
        self._counts = np.zeros((count, COUNTS), dtype=np.int64)
        self._displacements = np.zeros((count, 2, 3))
        self._track_sums = np.empty((0, SUMS_OF_TRACK))
        self._last_images: deque[Discs] = deque(maxlen=_LONG_LAG)

    def push(self, tracks: Tracks, max_speed: float) -> None:
        """Count the tracks of an image.

        Parameters
        ----------
        tracks : Tracks
        max_speed : float, [m/s]
            Largest speed at which beads were linked.
        """
        self._max_speed = max(self._max_speed, max_speed)
        self._frames += 1
        self._wrong_scale += Quality.WRONG_SCALE in tracks.quality
        image = Discs(
            tracks.ids,
            tracks.species,
            tracks.positions,
            tracks.position_errors,
            tracks.radii,
            tracks.velocities,
            tracks.seen,
        )
        images = self._last_images
        earlier = (
            images[-1] if images else _NO_DISCS,
            images[0] if len(images) == _LONG_LAG else _NO_DISCS,
        )
        # The numbers of the tracks rise.
        self._make_room(int(tracks.ids[-1]) if tracks.ids.size else -1)
        add_image(
            image,
            earlier,
            self._expected,
            self._least_distances,
            max_speed,
            self._track_sums,
            self._counts,
            self._displacements,
        )
        images.append(image)

    def _make_room(self, track: int) -> None:
        if track >= len(self._track_sums):
            more = np.zeros((track + 1, SUMS_OF_TRACK))
            more[:, 1:3], more[:, 3:5] = math.inf, -math.inf
            self._track_sums = np.concatenate([self._track_sums, more])

    def counts(self) -> tuple[SpeciesCounts, ...]:
        """What was counted so far, for each species; empty before the first image."""
        if self._frames == 0:
            return ()
        return tuple(self._counts_of(k) for k in range(len(self._tray.species)))

    def _counts_of(self, k: int) -> SpeciesCounts:
        species = self._tray.species[k]
        frames = self._frames
        tracked, seen, complete, overlapping, speeds, fast = self._counts[k].tolist()
        is_seen = (self._track_sums[:, 0] > 0.0) & (self._track_sums[:, 7] == k)
        track_sums = self._track_sums[is_seen]
        return SpeciesCounts(
            tray=self._tray.number,
            material=species.material,
            expected=species.expected,
            followed=not (self._crowded and tracked == 0),
            frames=frames,
            seen=seen / frames,
            tracked=tracked / frames,
            complete=complete / frames,
            tracks=len(track_sums),
            track_length=_median_length(track_sums),
            at_rest=_share_at_rest(track_sums, _LONG_SHARE * frames),
            overlapping=overlapping / max(seen, 1),
            near_limit=fast / max(speeds, 1),
            max_speed=self._max_speed,
            wrong_scale=self._wrong_scale / frames,
            spread_exponent=_spread_exponent(self._displacements[k]),
            learnt=species.appearance is not None,
            diameter_ratio=_diameter_ratio(track_sums, species),
        )


def _no_discs() -> Discs:
    """An image without discs, of the types of the arrays of `Tracks`, which are read-only."""
    discs = Discs(
        np.empty(0, dtype=np.int32),
        np.empty(0, dtype=np.int32),
        np.empty((0, 2)),
        np.empty(0),
        np.empty(0),
        np.empty((0, 2)),
        np.empty(0, dtype=np.bool_),
    )
    for array in discs:
        array.flags.writeable = False
    return discs


_NO_DISCS = _no_discs()


def _median_length(track_sums: NDArray[np.float64]) -> float:
    """Images in the track of a disc, median over the discs."""
    lengths = np.sort(track_sums[:, 0])
    if lengths.size == 0:
        return math.nan
    return float(lengths[np.searchsorted(np.cumsum(lengths), 0.5 * lengths.sum())])


def _diameter_ratio(track_sums: NDArray[np.float64], species: Species) -> float:
    """Diameter of the discs over the nearest that is told; each track counts by its images."""
    if len(track_sums) == 0:
        return math.nan
    means = 2.0 * track_sums[:, 5] / track_sums[:, 0]
    order = np.argsort(means)
    images = np.cumsum(track_sums[order, 0])
    diameter = float(means[order][np.searchsorted(images, 0.5 * images[-1])])
    return diameter / min(max(diameter, species.diameter_low), species.diameter_high)


def _share_at_rest(track_sums: NDArray[np.float64], least_images: float) -> float:
    """Share of the discs in tracks of at least so many images that never move."""
    rows = track_sums[track_sums[:, 0] >= least_images]
    if len(rows) == 0:
        return math.nan
    images = rows[:, 0]
    extent = np.hypot(*(rows[:, 3:5] - rows[:, 1:3]).T)
    rest = np.maximum(_REST_RADII * rows[:, 5], _REST_ERRORS * rows[:, 6]) / images
    return float(images[extent < rest].sum() / images.sum())


def _spread_exponent(displacements: NDArray[np.float64]) -> float:
    """Power of the time with which squared displacements grow; NaN where it is not known."""
    (short, squares, noise), (long, far, far_noise) = displacements.tolist()
    if min(short, long) < _LEAST_DISPLACEMENTS or squares < _LEAST_SIGNAL * noise:
        return math.nan
    ratio = (far - far_noise) / long / ((squares - noise) / short)
    return math.log(ratio) / math.log(_LONG_LAG) if ratio > 0.0 else math.nan


def _least_distance(tray: Tray, index: int) -> float:
    """Smallest distance of two discs in the picture, over the sum of their radii.

    Beads may lie above one another as far as the height of the tray allows.
    """
    diameter = tray.species[index].diameter_low
    height = tray.dimensions[2]
    free = 0.0 if math.isnan(height) else max(0.0, height - diameter) / diameter
    return math.sqrt(max(0.0, 1.0 - free**2))
