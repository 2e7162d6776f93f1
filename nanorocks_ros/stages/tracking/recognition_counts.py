"""How well the beads of a tray are recognised, counted over a film."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import Quality
from nanorocks_ros.stages.tracking.recognition_kernels import (
    SUMS_OF_TRACK,
    Discs,
    add_displacements,
    add_frame,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Tracks

# A disc at rest stays within this part of its radius, or this many errors of its position.
_REST_RADII, _REST_ERRORS = 0.25, 8.0
# A track tells whether its disc moves when it lasts for this part of the film.
_LONG_SHARE = 0.25
# Frames of the longer displacements; how many tell, and their squares over those of errors.
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
        self._species = [
            _SpeciesCounter(_least_distance(tray, k)) for k in range(len(tray.species))
        ]

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
        for k, (counter, species) in enumerate(
            zip(self._species, self._tray.species, strict=True)
        ):
            counter.push(tracks, k, species.count, max_speed)

    def counts(self) -> tuple[SpeciesCounts, ...]:
        """What was counted so far, for each species; empty before the first image."""
        if self._frames == 0:
            return ()
        return tuple(self._counts_of(counter, k) for k, counter in enumerate(self._species))

    def _counts_of(self, counter: _SpeciesCounter, k: int) -> SpeciesCounts:
        species = self._tray.species[k]
        frames = self._frames
        return SpeciesCounts(
            tray=self._tray.number,
            material=species.material,
            expected=species.expected,
            followed=not (self._crowded and counter.tracked == 0),
            frames=frames,
            seen=counter.seen / frames,
            tracked=counter.tracked / frames,
            complete=counter.complete / frames,
            tracks=len(counter.tracks),
            track_length=counter.median_length(),
            at_rest=counter.share_at_rest(_LONG_SHARE * frames),
            overlapping=counter.overlapping / max(counter.seen, 1),
            near_limit=counter.fast / max(counter.speeds, 1),
            max_speed=self._max_speed,
            wrong_scale=self._wrong_scale / frames,
            spread_exponent=counter.spread.exponent,
            learnt=species.appearance is not None,
        )


class _SpeciesCounter:
    """Sums over the images for one species."""

    def __init__(self, least_distance: float) -> None:
        self._least_distance = least_distance
        self.seen = self.tracked = self.complete = self.overlapping = 0
        self.fast = self.speeds = 0
        # By number of the track: images, least and largest place, sums of radius and error.
        self._sums = np.empty((0, SUMS_OF_TRACK))
        self.spread = _Spread()

    def push(self, tracks: Tracks, species: int, expected: int, max_speed: float) -> None:
        """Count the discs of the species with this index in the tracks of an image."""
        discs = Discs(
            tracks.ids,
            tracks.species,
            tracks.positions,
            tracks.position_errors,
            tracks.radii,
            tracks.velocities,
            tracks.seen,
        )
        # The numbers of the tracks rise.
        last = int(tracks.ids[-1]) if tracks.ids.size else -1
        tracked, seen, overlapping, speeds, fast = add_frame(
            discs, species, self._least_distance, max_speed, self._sums_up_to(last)
        )
        self.tracked += tracked
        self.seen += seen
        self.complete += seen >= expected
        self.overlapping += overlapping
        self.speeds += speeds
        self.fast += fast
        self.spread.push(discs, species)

    def _sums_up_to(self, bead: int) -> NDArray[np.float64]:
        if bead >= len(self._sums):
            more = np.zeros((bead + 1, SUMS_OF_TRACK))
            more[:, 1:3], more[:, 3:5] = math.inf, -math.inf
            self._sums = np.concatenate([self._sums, more])
        return self._sums

    @property
    def tracks(self) -> NDArray[np.float64]:
        """The sums of the tracks that were seen."""
        return self._sums[self._sums[:, 0] > 0.0]

    def median_length(self) -> float:
        """Images in the track of a disc, median over the discs."""
        lengths = np.sort(self.tracks[:, 0])
        if lengths.size == 0:
            return math.nan
        return float(lengths[np.searchsorted(np.cumsum(lengths), 0.5 * lengths.sum())])

    def share_at_rest(self, least_images: float) -> float:
        """Share of the discs in tracks of at least so many images that never move."""
        rows = self.tracks[self.tracks[:, 0] >= least_images]
        if len(rows) == 0:
            return math.nan
        images = rows[:, 0]
        extent = np.hypot(*(rows[:, 3:5] - rows[:, 1:3]).T)
        rest = np.maximum(_REST_RADII * rows[:, 5], _REST_ERRORS * rows[:, 6]) / images
        return float(images[extent < rest].sum() / images.sum())


class _Spread:
    """How squared displacements grow from one frame to several."""

    def __init__(self) -> None:
        self._frames: deque[Discs] = deque(maxlen=_LONG_LAG + 1)
        # By lag: displacements, sum of their squares, and what errors add to it.
        self._sums = {lag: np.zeros(3) for lag in (1, _LONG_LAG)}

    def push(self, discs: Discs, species: int) -> None:
        """Add the displacements of the discs of a species up to the next image."""
        self._frames.append(discs)
        for lag, sums in self._sums.items():
            if len(self._frames) > lag:
                add_displacements(discs, self._frames[-1 - lag], species, sums)

    @property
    def exponent(self) -> float:
        """Power of the time; NaN where it is not known."""
        (short, squares, noise), (long, far, far_noise) = self._sums.values()
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
