"""From the images of one tray to its tracks, contacts, bodies and speeds."""

from __future__ import annotations

from dataclasses import replace
from operator import attrgetter
from typing import TYPE_CHECKING

from nanorocks_ros.records import (
    BodyEstimate,
    ContactOrFlight,
    Measured,
    Merge,
    MotionMask,
    Notice,
    PairCollision,
    Quality,
    SpeedEstimate,
    Tracks,
    TrayImage,
)
from nanorocks_ros.stages.bodies.body_counter import BodyCounter
from nanorocks_ros.stages.contacts.body_rebounds import BodyRebounds
from nanorocks_ros.stages.contacts.contact_finder import ContactFinder
from nanorocks_ros.stages.preprocess.shaking.shaking_cycles import CycleFollower
from nanorocks_ros.stages.scale.scale_check import ScaleCheck
from nanorocks_ros.stages.speed.area_speed import AreaSpeed
from nanorocks_ros.stages.speed.speed_selector import SpeedSelector
from nanorocks_ros.stages.speed.structure_speed import StructureSpeed
from nanorocks_ros.stages.speed.track_speed import TrackSpeed
from nanorocks_ros.stages.speed.tray_oscillation import TrayOscillation
from nanorocks_ros.stages.stage import RestartingStage
from nanorocks_ros.stages.tracking.recognition_counts import RecognitionCounter
from nanorocks_ros.stages.tracking.tracker import Tracker

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings

Event = ContactOrFlight | BodyEstimate | Merge
TrayRecord = SpeedEstimate | MotionMask | Tracks | Event | Notice

_LONG_DOUBT_NS = 1_000_000_000
_CAMERA_MOVES = (
    'the camera moves, not the tray; its motion is removed, and the tray is taken to be at rest'
)
_UNCERTAIN = (
    'the motion of camera and tray cannot be told apart for some time; speeds there carry '
    'stabilisation_lost, and rebounds miss the speed of the wall; mount the camera firmly'
)
_LATE = (
    'pictures were taken {:.2g} ms off the times of their stamps; contacts are found by the times '
    'that beads in flight show; let the camera stamp pictures when it takes them'
)


class TrayMeasurement(RestartingStage[TrayImage, TrayRecord]):
    """Measures one tray: tracks, contacts and bodies, and the speed by every method needed.

    Speeds have the stamp of the middle of their window and come in order of time; those by the
    structure function are held back until the appearance of the beads is known, some seconds
    after the first shaking event. Speeds are flagged while the rulers of the image scale disagree,
    and a notice says which. A stamp that goes back starts all afresh.

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
    recognition : RecognitionCounter
        How well the beads have been recognised since the start.
    """

    clock = TrayImage

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings
        self._tray = tray
        self.emit_mask = False
        self.emit_tracks = False
        self._lesson: Sequence[NDArray[np.uint8]] = ()
        self.reset()

    def learn(self, frames: Sequence[NDArray[np.uint8]]) -> None:
        """Learn the look of the beads from frames of the whole film; see `Tracker.learn`."""
        self._lesson = frames
        self._tracker.learn(frames)

    def _restart(self, stamp_ns: int | None = None) -> None:
        del stamp_ns
        settings, tray = self._settings, self._tray
        self._noticed: set[str] = set()
        self._certain_ns: int | None = None
        self._cycles = CycleFollower(settings.speed.shake_ratio, settings.speed.min_cycle_duration)
        self._cycle: tuple[int, int | None] = (0, None)
        self._oscillation = TrayOscillation()
        self._tracker = Tracker(settings, tray)
        if self._lesson:
            self._tracker.learn(self._lesson)
        drag = Measured(settings.prior.drag, settings.prior.drag_error)
        self.recognition = RecognitionCounter(tray, crowded=self._tracker.crowded)
        self._contacts = ContactFinder(tray, drag)
        self._bodies = BodyCounter(settings, tray)
        self._body_rebounds = BodyRebounds(tray)
        self._scale = ScaleCheck(settings, tray)
        self._track_speed = TrackSpeed(settings, tray, crowded=self._tracker.crowded)
        self._structure_speed = StructureSpeed(settings, tray, crowded=self._tracker.crowded)
        self._area_speed = AreaSpeed(settings, tray)
        self._selector = SpeedSelector(settings.speed, self._track_speed.reliability)

    def _process(self, record: TrayImage) -> tuple[TrayRecord, ...]:
        return tuple(
            result for image in self._cycles.push(record) for result in self._measured(image)
        )

    def _measured(self, image: TrayImage) -> tuple[TrayRecord, ...]:
        """Everything that follows from an image whose cycle is known."""
        self._cycle = image.cycle or 0, image.cycle_start_ns
        self._area_speed.emit_mask = self.emit_mask
        pictures: list[MotionMask | Tracks] = []
        speeds: list[SpeedEstimate] = []
        events: list[Event] = []
        notices: list[Notice] = []
        for measured in self._area_speed.push(image):
            if isinstance(measured, SpeedEstimate):
                speeds.append(measured)
            else:
                pictures.append(measured)
        if self._selector.uses_tracks or self.emit_tracks:
            speeds += self._track_speed.push(image)
            for tracks in self._tracker.push(image):
                pictures += [tracks] if self.emit_tracks else []
                self.recognition.push(tracks, self._tracker.max_speed)
                notices += self._camera_notices(image, tracks)
                contacts = self._contacts_in(tracks)
                notices += self._late_notices(image.stamp_ns)
                notices += self._scale_notices(tracks, contacts)
                events += contacts
                events += self._bodies_in(tracks)
                speeds += self._track_speed.push(tracks)
        else:
            self._tracker.watch(image)
        in_space = self._in_space(image)
        self._oscillation.push(in_space)
        speeds += self._structure_speeds(in_space)
        chosen = self._completed(self._selector.push(speeds))
        return (*notices, *pictures, *chosen, *self._reliable(events))

    def flush(self) -> tuple[TrayRecord, ...]:
        """Contacts and bodies of the last seconds, and speeds that were still held back."""
        last = [result for image in self._cycles.flush() for result in self._measured(image)]
        self._track_speed.flush()
        speeds = self._structure_speed.flush() if self._selector.uses_structure else ()
        contacts = self._in_cycle(sorted(self._contacts.flush(), key=attrgetter('stamp_ns')))
        notices = [*self._scale_notices(None, contacts), *self._scale.flush()]
        events = [*contacts, *self._bodies.flush(), *self._body_rebounds.flush()]
        chosen = self._completed(self._selector.flush(speeds))
        return (*last, *notices, *chosen, *self._reliable(events))

    @property
    def scale_flag(self) -> Quality:
        """What the rulers of the image scale say by now: 0 while they agree."""
        return self._scale.flag

    def _scale_notices(self, tracks: Tracks | None, contacts: Iterable[Event]) -> list[Notice]:
        """Compare the rulers of the scale with the tracks of a frame and new contacts."""
        for contact in contacts:
            if isinstance(contact, PairCollision):
                self._scale.push(contact)
        return [] if tracks is None else list(self._scale.push(tracks))

    def _in_space(self, image: TrayImage) -> TrayImage:
        """The image with the motion of its tray in space: none where the camera moves."""
        if not self._tracker.camera_moves:
            return image
        return replace(image, displacement=(0.0, 0.0), velocity=(0.0, 0.0))

    def _camera_notices(self, image: TrayImage, tracks: Tracks) -> list[Notice]:
        """What to say of a camera that moves, once."""
        uncertain = Quality.STABILISATION_LOST in tracks.quality & ~image.quality
        if self._certain_ns is None or not uncertain:
            self._certain_ns = image.stamp_ns
        # A decision takes some tenths of a second.
        doubt = image.stamp_ns - self._certain_ns >= _LONG_DOUBT_NS
        texts = {_CAMERA_MOVES: self._tracker.camera_moves, _UNCERTAIN: doubt}
        new = [text for text, holds in texts.items() if holds and text not in self._noticed]
        self._noticed.update(new)
        return [
            Notice(stamp_ns=image.stamp_ns, text=f'tray {self._tray.number}: {text}')
            for text in new
        ]

    def _late_notices(self, stamp_ns: int) -> list[Notice]:
        """What to say of pictures that are not of the times of their stamps, once."""
        late = self._contacts.late
        if not late or _LATE in self._noticed:
            return []
        self._noticed.add(_LATE)
        text = f'tray {self._tray.number}: {_LATE.format(1e3 * late)}'
        return [Notice(stamp_ns=stamp_ns, text=text)]

    def _structure_speeds(self, image: TrayImage) -> tuple[SpeedEstimate, ...]:
        if self._selector.uses_structure:
            return self._structure_speed.push(self._selector.flagged(image))
        if self._selector.watches_images:
            self._structure_speed.watch(image, self._track_speed.last_in(image.cycle))
        self._structure_speed.pause()
        return ()

    def _contacts_in(self, tracks: Tracks) -> list[Event]:
        cooling = self._settings.cooling
        if not (cooling.rebounds or cooling.collisions):
            return []
        return self._in_cycle(self._contacts.push(tracks))

    def _bodies_in(self, tracks: Tracks) -> list[Event]:
        """Merges and counts of bodies in the tracks of a frame, and rebounds of bodies."""
        bodies = self._bodies.push(tracks)
        if not self._settings.cooling.rebounds:
            return list(bodies)
        for merge in bodies:
            if isinstance(merge, Merge):
                self._body_rebounds.push(merge)
        self._body_rebounds.noise = self._contacts.noise
        return [*bodies, *self._body_rebounds.push(tracks)]

    def _in_cycle(self, contacts: Iterable[ContactOrFlight]) -> list[Event]:
        """The contacts with their cycle: some before a shaking event are known only after it."""
        cycle, start_ns = self._cycle
        return [
            replace(
                contact, cycle=cycle - int(start_ns is not None and contact.stamp_ns < start_ns)
            )
            for contact in contacts
        ]

    def _completed(self, speeds: Iterable[SpeedEstimate]) -> list[SpeedEstimate]:
        """The speeds, with that of the tray and the flag of the scale."""
        return [
            replace(
                speed,
                tray_speed=self._oscillation.speed(speed),
                quality=speed.quality | self._scale.flag,
            )
            for speed in speeds
        ]

    def _reliable(self, events: list[Event]) -> list[Event]:
        return events if self._selector.uses_contacts else []
