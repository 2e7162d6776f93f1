"""From the images of one tray to its tracks, contacts, bodies and speeds."""

from __future__ import annotations

from dataclasses import replace
from operator import attrgetter
from typing import TYPE_CHECKING

from nanorocks_ros.records import (
    BodyEstimate,
    Merge,
    MotionMask,
    PairCollision,
    Rebound,
    SpeedEstimate,
    Tracks,
    TrayImage,
)
from nanorocks_ros.stages.bodies.body_counter import BodyCounter
from nanorocks_ros.stages.contacts.contact_finder import ContactFinder
from nanorocks_ros.stages.preprocess.shake_detection import CycleFollower
from nanorocks_ros.stages.speed.area_speed import AreaSpeed
from nanorocks_ros.stages.speed.speed_selector import SpeedSelector
from nanorocks_ros.stages.speed.structure_speed import StructureSpeed
from nanorocks_ros.stages.speed.track_speed import TrackSpeed
from nanorocks_ros.stages.speed.tray_oscillation import TrayOscillation
from nanorocks_ros.stages.stage import RestartingStage
from nanorocks_ros.stages.tracking.tracker import Tracker

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings

Event = Rebound | PairCollision | BodyEstimate | Merge
TrayRecord = SpeedEstimate | MotionMask | Tracks | Event


class TrayMeasurement(RestartingStage[TrayImage, TrayRecord]):
    """Measures one tray: tracks, contacts and bodies, and the speed by every method needed.

    Speeds have the stamp of the middle of their window and come in order of time; those by the
    structure function are held back until the appearance of the beads is known, some seconds
    after the first shaking event. A stamp that goes back starts all afresh.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray

    Attributes
    ----------
    emit_mask : bool
        Also emit a :class:`MotionMask` per image; off by default.
    emit_tracks : bool
        Also emit the :class:`Tracks` of each image, where they are made; off by default.
    """

    clock = TrayImage

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings
        self._tray = tray
        self.emit_mask = False
        self.emit_tracks = False
        self.reset()

    def _restart(self, stamp_ns: int | None = None) -> None:
        del stamp_ns
        settings, tray = self._settings, self._tray
        self._cycles = CycleFollower(settings.speed.shake_ratio, settings.speed.min_cycle_duration)
        self._oscillation = TrayOscillation()
        self._tracker = Tracker(settings, tray)
        self._contacts = ContactFinder(tray)
        self._bodies = BodyCounter(settings, tray)
        self._track_speed = TrackSpeed(settings, tray, crowded=self._tracker.crowded)
        self._structure_speed = StructureSpeed(settings, tray, crowded=self._tracker.crowded)
        self._area_speed = AreaSpeed(settings, tray)
        self._selector = SpeedSelector(settings.speed, self._track_speed.reliability)

    def _process(self, record: TrayImage) -> tuple[TrayRecord, ...]:
        self._cycles.push(record)
        image = self._cycles.counted(record)
        self._oscillation.push(image)
        self._area_speed.emit_mask = self.emit_mask
        pictures: list[MotionMask | Tracks] = []
        speeds: list[SpeedEstimate] = []
        events: list[Event] = []
        for measured in self._area_speed.push(image):
            if isinstance(measured, SpeedEstimate):
                speeds.append(measured)
            else:
                pictures.append(measured)
        if self._selector.uses_tracks or self.emit_tracks:
            speeds += self._track_speed.push(image)
            for tracks in self._tracker.push(image):
                pictures += [tracks] if self.emit_tracks else []
                events += self._contacts_in(tracks)
                events += self._bodies.push(tracks)
                speeds += self._track_speed.push(tracks)
        speeds += self._structure_speeds(image)
        return (*pictures, *self._selected(speeds), *self._reliable(events))

    def flush(self) -> tuple[TrayRecord, ...]:
        """Contacts and bodies of the last seconds, and speeds that were still held back."""
        self._track_speed.flush()
        speeds = self._structure_speed.flush() if self._selector.uses_structure else ()
        contacts = sorted(self._contacts.flush(), key=attrgetter('stamp_ns'))
        events = [*self._in_cycle(contacts), *self._bodies.flush()]
        return (*self._selected(speeds), *self._reliable(events))

    def _structure_speeds(self, image: TrayImage) -> tuple[SpeedEstimate, ...]:
        if self._selector.uses_structure:
            return self._structure_speed.push(self._selector.flagged(image))
        if self._selector.watches_noise:
            self._structure_speed.watch_noise(image)
        self._structure_speed.pause()
        return ()

    def _contacts_in(self, tracks: Tracks) -> list[Event]:
        cooling = self._settings.cooling
        if not (cooling.rebounds or cooling.collisions):
            return []
        return self._in_cycle(self._contacts.push(tracks))

    def _in_cycle(self, contacts: Iterable[Rebound | PairCollision]) -> list[Event]:
        """The contacts with their cycle: some before a shaking event are known only after it."""
        cycle, start_ns = self._cycles.cycle, self._cycles.cycle_start_ns
        return [
            replace(
                contact, cycle=cycle - int(start_ns is not None and contact.stamp_ns < start_ns)
            )
            for contact in contacts
        ]

    def _selected(self, speeds: Iterable[SpeedEstimate]) -> list[SpeedEstimate]:
        return [
            replace(speed, tray_speed=self._oscillation.speed(speed))
            for speed in self._selector.push(speeds)
        ]

    def _reliable(self, events: list[Event]) -> list[Event]:
        return events if self._selector.uses_contacts else []
