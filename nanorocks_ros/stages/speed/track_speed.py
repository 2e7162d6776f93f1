"""Mean projected speed, contacts and bodies from tracks, where most beads are tracked."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.quantiles import median
from nanorocks_ros.records import (
    UNKNOWN_MEASURED,
    BodyEstimate,
    Measured,
    Merge,
    PairCollision,
    Quality,
    Rebound,
    SpeedEstimate,
    SpeedMethod,
    Tracks,
    TrayImage,
)
from nanorocks_ros.stages.bodies.body_counter import BodyCounter
from nanorocks_ros.stages.contacts.contact_finder import ContactFinder
from nanorocks_ros.stages.preprocess.shake_detection import NS, CycleFollower
from nanorocks_ros.stages.tracking.mean_speed import (
    NOISE_FRAMES,
    RELIABLE_SHARE,
    mean_speeds_of_series,
)
from nanorocks_ros.stages.tracking.track_window import TrackWindow
from nanorocks_ros.stages.tracking.tracker import Tracker

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings

# A bead should come so many pixels in half of the window: jitter is far less.
_LEAST_PATH_PX = 1.5
# So many where there are grains: as they turn their outlines seem to move, by more than a pixel.
# Speeds from less than this share of it are flagged.
_LEAST_GRAIN_PATH_PX = 2.2
_FAR_ENOUGH = 0.8
# Tracks are looked back upon for so long; slower beads rest.
_LOOK_BACK_NS = 3 * NS
# Share of the beads that must be followed, of each species, to begin and to go on.
_ENOUGH, _STILL_ENOUGH = 0.85, 0.7
# Pictures over which the median of that share is taken; and speeds, for the share of the beads
# that could be followed through the window of a speed.
_MEMORY_FRAMES = 30
_MEMORY_SPEEDS = 10
# Way of a bead between two pictures, over half the distance of beads that lie at random: beyond
# it beads are taken for their neighbours, which are further away. Simulated speeds were right to
# 10 % up to 0.8, and off by 30 % and more from 1.4 on.
_FURTHEST_STEP = 1.0


class TrackSpeed:
    """Measures the speed by tracking every bead that can be seen, and finds its contacts.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray

    Attributes
    ----------
    reliable : bool
        Whether nearly all beads of every species are being followed.
    judged : bool
        Whether enough images were seen to tell.
    hopeless : bool
        Whether a species is too crowded to be followed, so that it will never be reliable.
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._interval_ns = round(settings.speed.interval * NS)
        self._grains = any(species.properties.hue == 0 for species in tray.species)
        least = _LEAST_GRAIN_PATH_PX if self._grains else _LEAST_PATH_PX
        self._least_distance = least / settings.preprocess.pixels_per_metre
        self._tray = tray
        self._counts = np.array([one.count for one in tray.species])
        self._tracker = Tracker(settings, tray)
        wanted = settings.cooling.rebounds or settings.cooling.collisions
        self._contacts = ContactFinder(tray) if wanted else None
        self._bodies = BodyCounter(settings, tray)
        self._recent = TrackWindow()
        self._shares = np.empty((_MEMORY_FRAMES, self._counts.size))
        self._judged_frames = 0
        self._followed: deque[float] = deque(maxlen=_MEMORY_SPEEDS)
        self._steps: deque[float] = deque(maxlen=_MEMORY_SPEEDS)
        # Medians of these two.
        self._usually_followed, self._usual_step = 0.0, math.inf
        area = tray.dimensions[0] * tray.dimensions[1]
        self._neighbours = 0.5 * np.sqrt(area / self._counts)
        self._next_ns: int | None = None
        self._flags = Quality(0)
        self._last_ns: int | None = None
        self.hopeless = self._tracker.crowded
        self.reliable = False
        self.judged = self.hopeless

    def push(
        self, image: TrayImage, shakes: CycleFollower, shaken: bool
    ) -> tuple[SpeedEstimate | Tracks | Rebound | PairCollision | BodyEstimate | Merge, ...]:
        """Take the next image: tracks, what beads do in them, and a speed when one is due."""
        records: list[SpeedEstimate | Tracks | Rebound | PairCollision | BodyEstimate | Merge] = []
        if shaken:
            self._recent.clear()
            self._next_ns = None
        self._flags |= image.quality
        if image.color is None:
            # Nothing can be tracked, and that is known at once.
            self.judged, self.reliable = True, False
        for tracks in self._tracker.push(image):
            records.append(tracks)
            self._recent.push(tracks, tracks.stamp_ns - _LOOK_BACK_NS)
            self._judge(tracks)
            records += self._contacts_in(tracks, shakes)
            records += self._bodies.push(tracks, shakes.cycle)
            if self._next_ns is None or tracks.stamp_ns >= self._next_ns:
                self._next_ns = tracks.stamp_ns + self._interval_ns
                records += self._speeds(shakes, tracks.expected)
        return tuple(records)

    def _contacts_in(self, tracks: Tracks, shakes: CycleFollower) -> list[Rebound | PairCollision]:
        if self._contacts is None:
            return []
        start = shakes.cycle_start_ns
        # Those before the shaking event may be known only after it.
        return [
            replace(
                one,
                cycle=shakes.cycle - int(start is not None and one.stamp_ns < start),
            )
            for one in self._contacts.push(tracks)
        ]

    def _judge(self, tracks: Tracks) -> None:
        place = self._judged_frames % _MEMORY_FRAMES
        frames = min(self._judged_frames + 1, _MEMORY_FRAMES)
        # A track is believed after some pictures only: the first ones show none.
        least = _least_share(
            tracks.species, tracks.seen, self._counts, self._shares, place, frames
        )
        self._judged_frames += 1
        if self.hopeless:
            return
        self.judged = self._judged_frames >= _MEMORY_FRAMES
        enough = least >= (_STILL_ENOUGH if self.reliable else _ENOUGH)
        # Where many beads are lost and found again, others are taken for them.
        followed = self._usually_followed >= RELIABLE_SHARE
        self.reliable = self.judged and enough and followed and self._told_apart()

    def _speeds(self, shakes: CycleFollower, expected: NDArray[np.int32]) -> list[SpeedEstimate]:
        series = self._recent.series()
        mean, *each = mean_speeds_of_series(
            series,
            self._recent.series(NOISE_FRAMES),
            expected,
            least_distance=self._least_distance,
            species=(None, *range(self._counts.size)),
        )
        if mean is None or not np.isfinite(mean.mean_projected_speed):
            return []
        if self._last_ns is not None and mean.stamp_ns <= self._last_ns:
            return []
        self._last_ns = mean.stamp_ns
        species = [
            Measured(one.mean_projected_speed, one.mean_projected_speed_error)
            if one
            else UNKNOWN_MEASURED
            for one in each
        ]
        self._followed.append(min(one.share if one else 0.0 for one in each))
        speeds = np.array([speed.value for speed in species])
        self._steps.append(self._longest_step(speeds, np.diff(series.stamps)))
        self._usually_followed = median(self._followed)
        self._usual_step = median(self._steps)
        flags, self._flags = self._flags, Quality(0)
        if mean.share < RELIABLE_SHARE:
            flags |= Quality.FEW_BEADS
        path = 0.5 * mean.window * mean.mean_projected_speed
        too_short = self._grains and path < _FAR_ENOUGH * self._least_distance
        if too_short or not self._told_apart():
            flags |= Quality.UNCERTAIN
        return [
            SpeedEstimate(
                stamp_ns=mean.stamp_ns,
                tray=self._tray.number,
                cycle=shakes.cycle,
                cycle_start_ns=shakes.cycle_start_ns,
                mean_projected_speed=Measured(
                    mean.mean_projected_speed, mean.mean_projected_speed_error
                ),
                window=mean.window,
                method=SpeedMethod.TRACKING,
                quality=flags,
                species_speeds=tuple(species[:2]),
            )
        ]

    def _told_apart(self) -> bool:
        """Whether beads come less far between two pictures than others are away."""
        return self._usual_step <= _FURTHEST_STEP

    def _longest_step(self, speeds: NDArray[np.float64], intervals_ns: NDArray[np.int64]) -> float:
        """Way of a bead between two pictures over the distance to others, of the worst species."""
        picture = median(intervals_ns.tolist()) / NS
        return float(np.max(np.nan_to_num(speeds) * picture / self._neighbours))


@compiled
def _least_share(
    species: NDArray[np.int32],
    seen: NDArray[np.bool_],
    counts: NDArray[np.int64],
    shares: NDArray[np.float64],
    place: int,
    frames: int,
) -> float:
    """Of the shares of the beads of a species that are seen, usually, the least.

    Parameters
    ----------
    species : ndarray of int32, (n,)
    seen : ndarray of bool, (n,)
    counts : ndarray of int64, (species,)
        Beads that there are.
    shares : ndarray (memory, species)
        Of the last pictures; that of this one is written to its place.
    place, frames : int
        How many pictures there are, with this one.
    """
    shares[place] = 0.0
    for k in range(species.size):
        if seen[k]:
            shares[place, species[k]] += 1.0
    least = np.inf
    for k in range(counts.size):
        shares[place, k] /= counts[k]
        least = min(least, np.median(shares[:frames, k]))
    return least
