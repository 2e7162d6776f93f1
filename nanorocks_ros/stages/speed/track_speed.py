"""Mean projected speed from tracks, where most beads are tracked.

Tested by ``test/pipeline/test_tray_measurement.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import (
    NS,
    UNKNOWN_MEASURED,
    Measured,
    Quality,
    SpeedEstimate,
    SpeedMethod,
    Tracks,
    TrayImage,
)
from nanorocks_ros.stages.speed.grains.jumping_tracks import JumpingTracks
from nanorocks_ros.stages.speed.grains.lost_grains import LostGrains
from nanorocks_ros.stages.speed.skipped_frames import SkippedFrames
from nanorocks_ros.stages.speed.track_reliability import TrackReliability
from nanorocks_ros.stages.tracking.mean_speed import (
    CUT_LOSS_BIAS,
    LOSS_BIAS,
    NOISE_FRAMES,
    mean_speeds_of_series,
)
from nanorocks_ros.stages.tracking.track_window import TrackWindow

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings

# Path of a bead in half of the window, at least. The jitter between frames is far less, but a bead
# that others hide in part is placed 0.4 px (rms) off for as long as they hide it: over 1.5 px,
# speeds below 1 mm/s were 3 to 5 % too high where beads hide each other.
_SHORTEST_PATH_PX = 3.0
# The same where there are grains: as they turn and hide one another their outlines seem to move,
# by a share of their radius and by more than a pixel.
_SHORTEST_GRAIN_PATH_PX, _SHORTEST_GRAIN_PATH_RADII = 4.0, 0.47
# Speeds of trays with grains from shorter paths are flagged.
_FLAGGED_GRAIN_PATH_PX, _FLAGGED_GRAIN_PATH_RADII = 1.8, 0.38
# Longest window; slower beads rest.
_LONGEST_WINDOW_NS = 3 * NS
# Largest share of a species under other beads of speeds without a flag: in a drawn film with a
# share of 0.21 half of the excess of 20 % was left.
_MOST_HIDDEN = 0.3
# Standard errors from 0 below which beads are at rest: they need not move to be sure of that.
_REST_ERRORS = 3.0


class TrackSpeed:
    """Measures the speed from the tracks of all beads that can be seen.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    crowded : bool
        Whether a species has too many grains to be tracked.

    Attributes
    ----------
    reliability : TrackReliability
    """

    def __init__(self, settings: PipelineSettings, tray: Tray, *, crowded: bool) -> None:
        self._interval_ns = round(settings.speed.interval * NS)
        self._pixels_per_metre = settings.preprocess.pixels_per_metre
        self._shortest_path, self._flagged_path = _shortest_paths(tray, self._pixels_per_metre)
        self._tray = tray
        self._crowded = crowded
        self.reset()

    def reset(self, stamp_ns: int | None = None) -> None:
        """Start afresh."""
        del stamp_ns
        self.reliability = TrackReliability(self._tray, crowded=self._crowded)
        self._recent = TrackWindow()
        self._jumps = JumpingTracks(self._pixels_per_metre) if self._flagged_path else None
        self._skipped = SkippedFrames(self._pixels_per_metre)
        self._lost_grains = self._grains()
        self._next_ns: int | None = None
        self._last: SpeedEstimate | None = None
        self._flags = Quality(0)
        self._cycle: int | None = None
        self._cycle_start_ns: int | None = None

    def push(self, record: TrayImage | Tracks) -> tuple[SpeedEstimate, ...]:
        """Take the next image, whose cycle is known, and then its tracks.

        Returns
        -------
        tuple of SpeedEstimate
            Of the middle of the window; empty while none is due.
        """
        if isinstance(record, TrayImage):
            self._begin_image(record)
            return ()
        # The tracker knows whether tray and camera can be told apart.
        self._flags |= record.quality & Quality.STABILISATION_LOST
        unbroken = self._jumps.cut(record) if self._jumps else record
        self._skipped.push(unbroken)
        self._recent.push(unbroken, record.stamp_ns - _LONGEST_WINDOW_NS)
        self.reliability.push(record)
        if self._next_ns is not None and record.stamp_ns < self._next_ns:
            return ()
        self._next_ns = record.stamp_ns + self._interval_ns
        return self._speeds(record)

    def last_in(self, cycle: int | None) -> SpeedEstimate | None:
        """The last speed of a cycle, while the tracks are reliable."""
        last = self._last
        if last is None or last.cycle != (cycle or 0) or not self.reliability.reliable:
            return None
        return last

    def flush(self) -> tuple[SpeedEstimate, ...]:
        """Nothing: a speed is known as soon as its window is."""
        self.reliability.conclude()
        return ()

    def _begin_image(self, image: TrayImage) -> None:
        if self._cycle not in (None, image.cycle):
            self._recent.clear()
            self._skipped = SkippedFrames(self._pixels_per_metre)
            self._lost_grains = self._grains()
            self._next_ns = None
        self._cycle, self._cycle_start_ns = image.cycle, image.cycle_start_ns
        self._flags |= image.quality
        if image.color is None:
            self.reliability.without_colour()

    def _grains(self) -> LostGrains | None:
        """Counts grains that are lost in a cycle; None where there are none."""
        return LostGrains(1 + len(self._tray.species)) if self._flagged_path else None

    def _speeds_told_apart(
        self, speeds: list[Measured], intervals_ns: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Speed of each species that tells how far beads move between pictures, [m/s]."""
        if self._jumps is None:
            return np.array([speed.value for speed in speeds])
        # What was cut from the tracks of fast grains must not make them slow.
        steps = [self._jumps.steps.get(kind, math.nan) for kind in range(len(speeds))]
        return np.array(steps) * NS / float(np.median(intervals_ns))

    def _speeds(self, tracks: Tracks) -> tuple[SpeedEstimate, ...]:
        series = self._recent.series()
        means = mean_speeds_of_series(
            series,
            self._recent.series(NOISE_FRAMES),
            tracks.expected,
            least_distance=self._shortest_path,
            species=(None, *range(len(self._tray.species))),
            loss_bias=CUT_LOSS_BIAS if self._jumps else LOSS_BIAS,
            floor=self._tray.dimensions[:2],
        )
        mean, *of_species = self._lost_grains.counted(means) if self._lost_grains else means
        if mean is None or not np.isfinite(mean.mean_projected_speed):
            return ()
        if self._last is not None and mean.stamp_ns <= self._last.stamp_ns:
            return ()
        speeds = [
            Measured(speed.mean_projected_speed, speed.mean_projected_speed_error)
            if speed
            else UNKNOWN_MEASURED
            for speed in of_species
        ]
        self.reliability.push_speeds(
            min(speed.share_of_visible if speed else 0.0 for speed in of_species),
            max(speed.hidden if speed else 0.0 for speed in of_species),
            self._speeds_told_apart(speeds, np.diff(series.stamps)),
            np.diff(series.stamps),
        )
        flags, self._flags = self._flags, Quality(0)
        if self._skipped.matters:
            flags |= Quality.SKIPPED_FRAMES
        if mean.share < self.reliability.lowest_share or mean.hidden > _MOST_HIDDEN:
            flags |= Quality.FEW_BEADS
        path = 0.5 * mean.window * mean.mean_projected_speed
        at_rest = mean.mean_projected_speed < _REST_ERRORS * mean.mean_projected_speed_error
        is_certain = (mean.beyond_errors or at_rest) and self.reliability.told_apart
        if path < self._flagged_path or not is_certain:
            flags |= Quality.UNCERTAIN
        self._last = SpeedEstimate(
            stamp_ns=mean.stamp_ns,
            tray=self._tray.number,
            cycle=self._cycle or 0,
            cycle_start_ns=self._cycle_start_ns,
            mean_projected_speed=Measured(
                mean.mean_projected_speed, mean.mean_projected_speed_error
            ),
            window=mean.window,
            method=SpeedMethod.TRACKING,
            quality=flags,
            species_speeds=tuple(speeds[:2]),
        )
        return (self._last,)


def _shortest_paths(tray: Tray, pixels_per_metre: float) -> tuple[float, float]:
    """Paths of a bead in half of the window: that aimed at, and the shortest not flagged, [m]."""
    grains = [species for species in tray.species if species.properties.shape == 'grain']
    if not grains:
        return _SHORTEST_PATH_PX / pixels_per_metre, 0.0
    radius = 0.5 * max(species.diameter for species in grains)
    return (
        max(_SHORTEST_GRAIN_PATH_PX / pixels_per_metre, _SHORTEST_GRAIN_PATH_RADII * radius),
        max(_FLAGGED_GRAIN_PATH_PX / pixels_per_metre, _FLAGGED_GRAIN_PATH_RADII * radius),
    )
