"""Mean projected speed of the beads of one tray, from its images."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from nanorocks_ros.records import (
    BodyEstimate,
    Merge,
    MotionMask,
    PairCollision,
    Quality,
    Rebound,
    SpeedEstimate,
    Tracks,
    TrayImage,
)
from nanorocks_ros.stages.preprocess.shake_detection import CycleFollower
from nanorocks_ros.stages.speed.area_speed import AreaSpeed
from nanorocks_ros.stages.speed.structure_speed import StructureSpeed
from nanorocks_ros.stages.speed.track_speed import TrackSpeed
from nanorocks_ros.stages.speed.tray_oscillation import SwingMeter

if TYPE_CHECKING:
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings


# Of a speed, an error beyond which it carries a flag; unless beads are known to be slower than
# this [m/s], and rest.
_CERTAIN = 0.2
_REST = 5e-5

Seen = Rebound | PairCollision | BodyEstimate | Merge
Measured = SpeedEstimate | MotionMask | Tracks | Seen


class SpeedEstimator:
    """Measures the mean projected speed of one tray.

    Estimates come with the stamp of the middle of their window, in order of time; those by the
    structure function are held back until the appearance of the beads is known, some seconds
    after the first shaking event.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray

    Attributes
    ----------
    emit_mask : bool
        Also emit a :class:`MotionMask` per image; off by default since few look at it.
    emit_tracks : bool
        Also emit the :class:`Tracks` of each image, where they are made.
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings
        self._tray = tray
        self.emit_mask = False
        self.emit_tracks = False
        self._restart()

    def _restart(self) -> None:
        speed = self._settings.speed
        self._shakes = CycleFollower(speed.shake_ratio, speed.min_cycle_duration)
        self._area = AreaSpeed(self._settings, self._tray)
        self._area.emit_speed = speed.method == 'binarised_area'
        self._structure = StructureSpeed(self._settings, self._tray)
        self._tracks = TrackSpeed(self._settings, self._tray)
        self._idle = False
        self._held: list[SpeedEstimate] = []
        self._last_emitted_ns: int | None = None
        self._last_stamp_ns: int | None = None
        self._swing = SwingMeter()

    def push(self, image: TrayImage) -> tuple[Measured, ...]:
        """Take the next image of the tray.

        Returns
        -------
        tuple of SpeedEstimate, MotionMask, Tracks, contacts, BodyEstimate or Merge
            Empty while a window is filling. A stamp that goes back starts all afresh.
        """
        if self._last_stamp_ns is not None and image.stamp_ns <= self._last_stamp_ns:
            self._restart()
        self._last_stamp_ns = image.stamp_ns
        self._swing.push(image)
        shaken = self._shakes.push(image)
        self._area.emit_mask = self.emit_mask
        found: list[Measured] = []
        found += self._area.push(image, self._shakes, shaken)
        method = self._settings.speed.method
        of_use = method == 'tracking' or (method == 'auto' and not self._tracks.hopeless)
        if of_use or self.emit_tracks:
            records = self._tracks.push(image, self._shakes, shaken)
            found += [
                record for record in records if isinstance(record, Tracks) and self.emit_tracks
            ]
            found += self._by_tracks(
                [record for record in records if isinstance(record, SpeedEstimate)]
            )
            if of_use and (method == 'tracking' or self._tracks.reliable):
                found += [record for record in records if isinstance(record, Seen)]
        if method == 'structure_function' or (method == 'auto' and not self._tracks.reliable):
            # Who looks at the tracks must not change what is said of a forced method.
            if self._tracks.judged and method == 'auto':
                image = replace(image, quality=image.quality | Quality.FEW_BEADS)
            # After a while without images those from before are of no use.
            speeds = self._structure.push(image, self._shakes, shaken or self._idle)
            self._idle = False
            if method == 'structure_function' or self._tracks.judged:
                found += speeds
        else:
            if method == 'auto':
                self._structure.watch(image)
            if not self._idle:
                self._structure.rest()
            self._idle = True
        return tuple(self._finished(record) for record in found if self._in_order(record))

    def _finished(self, record: Measured) -> Measured:
        if not isinstance(record, SpeedEstimate):
            return record
        return replace(_judged(record), tray_speed=self._swing.speed(record))

    def _by_tracks(self, speeds: list[SpeedEstimate]) -> list[SpeedEstimate]:
        """Those to be given out: kept until it is known whether tracks can be relied upon."""
        method = self._settings.speed.method
        if method != 'auto':
            return speeds if method == 'tracking' else []
        self._held += speeds
        if not self._tracks.judged:
            return []
        held, self._held = self._held, []
        return held if self._tracks.reliable else []

    def _in_order(self, record: Measured) -> bool:
        """Whether a speed is later than the one before it, which another method may have given."""
        if not isinstance(record, SpeedEstimate):
            return True
        last = self._last_emitted_ns
        if last is not None and record.stamp_ns <= last:
            return False
        self._last_emitted_ns = record.stamp_ns
        return True


def _judged(record: SpeedEstimate) -> SpeedEstimate:
    """The same, and flagged where it says itself that it may be off by more than 20 %."""
    speed, error = record.mean_projected_speed.value, record.mean_projected_speed.error
    if error <= _CERTAIN * abs(speed) or abs(speed) + error <= _REST:
        return record
    # Also what is not known at all.
    return replace(record, quality=record.quality | Quality.UNCERTAIN)
