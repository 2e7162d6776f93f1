"""Which method measures the speed of a tray, as of each image."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from nanorocks_ros.records import Measured, Quality, SpeedEstimate, SpeedMethod, TrayImage
from nanorocks_ros.stages.tracking.bead_distances import HIDDEN_ERROR

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nanorocks_ros.settings import SpeedSettings
    from nanorocks_ros.stages.speed.track_reliability import TrackReliability

# Relative error of a speed beyond which it is flagged; unless the beads are known to be slower
# than this [m/s], and rest.
_LARGEST_ERROR = 0.2
_REST = 5e-5
# Speeds from unreliable tracks that are kept while no other method measures.
_MOST_SPARE = 3000


class SpeedSelector:
    """Gives out the speeds of one method, in order of time.

    With the setting `speed.method` at `auto` these are the speeds from tracks while the tracks
    are reliable, and otherwise those from the structure function. Where that never comes to know
    the beads, such as of a gas that cools at once, these are in the end speeds from unreliable
    tracks, flagged.

    Parameters
    ----------
    settings : SpeedSettings
    tracks : TrackReliability
    """

    def __init__(self, settings: SpeedSettings, tracks: TrackReliability) -> None:
        self._method = settings.method
        self._tracks = tracks
        self.reset()

    def reset(self, stamp_ns: int | None = None) -> None:
        """Start afresh."""
        del stamp_ns
        self._held: list[SpeedEstimate] = []
        self._spare: list[SpeedEstimate] = []
        self._last_ns: int | None = None

    @property
    def uses_tracks(self) -> bool:
        """Whether the beads are to be tracked."""
        return self._method == 'tracking' or (self._auto and not self._tracks.hopeless)

    @property
    def uses_contacts(self) -> bool:
        """Whether contacts and bodies found in the tracks are to be given out."""
        return self.uses_tracks and (self._method == 'tracking' or self._tracks.reliable_contacts)

    @property
    def uses_structure(self) -> bool:
        """Whether the structure function is to measure the image."""
        return self._method == 'structure_function' or (self._auto and not self._tracks.reliable)

    @property
    def watches_images(self) -> bool:
        """Whether the structure function may be needed later, while it is not used."""
        return self._auto

    @property
    def _auto(self) -> bool:
        return self._method == 'auto'

    def flagged(self, image: TrayImage) -> TrayImage:
        """The image for the structure function: flagged when too few beads could be tracked.

        A picture of the tracks, when it is asked for, must not change what a forced method gives.
        """
        if not (self._tracks.judged and self._auto):
            return image
        return replace(image, quality=image.quality | Quality.FEW_BEADS)

    def push(self, speeds: Iterable[SpeedEstimate]) -> tuple[SpeedEstimate, ...]:
        """Take the speeds of all methods that follow from one image; there may be none.

        Returns
        -------
        tuple of SpeedEstimate
            Each later than the one before, by whatever method. Those whose error is more than
            20 % are flagged.
        """
        chosen: list[SpeedEstimate] = []
        from_tracks: list[SpeedEstimate] = []
        structure_counts = self._method == 'structure_function' or self._tracks.judged
        for speed in speeds:
            if speed.method is SpeedMethod.TRACKING:
                from_tracks.append(speed)
            elif speed.method is SpeedMethod.BINARISED_AREA:
                chosen.append(speed)
            elif structure_counts:
                self._spare.clear()
                chosen.append(self._with_hidden_beads(speed))
        chosen += self._from_tracks(from_tracks)
        return tuple(_flag_uncertain(speed) for speed in chosen if self._in_order(speed))

    def flush(self, last: Iterable[SpeedEstimate] = ()) -> tuple[SpeedEstimate, ...]:
        """Take the last speeds of all methods, and give out what is held back."""
        chosen = self.push(last)
        spare, self._spare = self._spare, []
        unreliable = Quality.FEW_BEADS | Quality.UNCERTAIN
        flagged = (replace(speed, quality=speed.quality | unreliable) for speed in spare)
        return (*chosen, *filter(self._in_order, flagged))

    def _from_tracks(self, speeds: list[SpeedEstimate]) -> list[SpeedEstimate]:
        """Speeds from tracks, held back until it is known whether the tracks are reliable."""
        if not self._auto:
            return speeds if self._method == 'tracking' else []
        self._held += speeds
        if not self._tracks.judged:
            return []
        held, self._held = self._held, []
        if self._tracks.reliable:
            self._spare.clear()
            return held
        if not self._tracks.hopeless:
            self._spare += held
            del self._spare[:-_MOST_SPARE]
        return []

    def _with_hidden_beads(self, speed: SpeedEstimate) -> SpeedEstimate:
        """A speed from images, with the error of those beads that lie under others, and are slow.

        With a method that is set nothing is known of them.
        """
        relative = HIDDEN_ERROR * self._tracks.hidden if self._auto else 0.0
        if not relative:
            return speed
        mean, *species = (
            Measured(each.value, math.hypot(each.error, relative * each.value))
            for each in (speed.mean_projected_speed, *speed.species_speeds)
        )
        return replace(speed, mean_projected_speed=mean, species_speeds=tuple(species))

    def _in_order(self, speed: SpeedEstimate) -> bool:
        """Whether a speed is later than the last one, which another method may have given."""
        if self._last_ns is not None and speed.stamp_ns <= self._last_ns:
            return False
        self._last_ns = speed.stamp_ns
        return True


def _flag_uncertain(estimate: SpeedEstimate) -> SpeedEstimate:
    """The estimate, flagged where its error is more than 20 % or not known."""
    speed, error = estimate.mean_projected_speed.value, estimate.mean_projected_speed.error
    if error <= _LARGEST_ERROR * abs(speed) or abs(speed) + error <= _REST:
        return estimate
    return replace(estimate, quality=estimate.quality | Quality.UNCERTAIN)
