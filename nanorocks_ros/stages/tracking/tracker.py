"""Particle tracking: positions of the beads of a tray, linked from frame to frame."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import Quality, Tracks, TrayImage
from nanorocks_ros.stages.stage import RestartingStage
from nanorocks_ros.stages.tracking.camera_motion import CameraMotion
from nanorocks_ros.stages.tracking.detection.bead_detector import BeadDetector
from nanorocks_ros.stages.tracking.linking.flight_deviations import FlightDeviations
from nanorocks_ros.stages.tracking.linking.track_linker import Linker
from nanorocks_ros.stages.tracking.linking.track_snapshot import (
    allocate_snapshot,
    write_in_metres,
)
from nanorocks_ros.stages.tracking.scene.scene_detector import SceneDetector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.materials import Material
    from nanorocks_ros.experiment.trays import Species, Tray
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.stages.tracking.camera_motion import TrayMotion
    from nanorocks_ros.stages.tracking.detection.bead_detector import Detections

_NS = 1e9
# Visible share of a species below which speeds and counts are unreliable.
_MIN_VISIBLE_SHARE = 0.85
# Systematic error of a position in a tray with grains too crowded to track, [px]. It is the same
# in successive frames and does not affect velocities.
_CROWDED_PX = 0.6
# Largest speed of beads of the flight, [m/s]; and largest step of others over the distance of
# neighbours.
_FLIGHT_MAX_SPEED = 0.05
_NEIGHBOUR_SHARE = 0.5


class Tracker(RestartingStage[TrayImage, Tracks]):
    """Tracks the beads of one tray.

    An image gives one record of tracks; a gray image none, since colour separates the species,
    unless the look of the beads is learnt from the film.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    """

    clock = TrayImage

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings.tracking
        self._scale = settings.preprocess.pixels_per_metre
        self._tray = tray
        self._expected = np.array(
            [species.expected or 0 for species in tray.species], dtype=np.int32
        )
        self._lesson: tuple[NDArray[np.uint8], ...] = ()
        self.reset()

    def _restart(self, stamp_ns: int | None = None) -> None:
        """Forget the tracks and the background: the next image is the first one."""
        del stamp_ns
        self._detector = self._new_detector()
        self._camera = CameraMotion()
        self._linkers: list[Linker] = []
        self._first_ns: int | None = None
        self._next_id = 0
        self._own_max_speed = _FLIGHT_MAX_SPEED
        self._last_time = math.nan

    def learn(self, frames: Sequence[NDArray[np.uint8]]) -> None:
        """Learn the look of the beads from frames of the whole film, where it is not known.

        Parameters
        ----------
        frames : sequence of ndarrays of uint8, (rows, columns, 3), bgr
            Of the tray, spread over the film; without them the look is learnt on the way.
        """
        self._lesson = tuple(frames)
        self._detector = self._new_detector()

    def _new_detector(self) -> BeadDetector | SceneDetector:
        if not self._tray.is_learnt:
            return BeadDetector(self._settings, self._tray, self._scale)
        detector = SceneDetector(self._tray, self._scale)
        if self._lesson:
            detector.learn(self._lesson)
        return detector

    @property
    def max_speed(self) -> float:
        """Largest speed at which beads are linked, [m/s]."""
        return self._settings.max_speed or self._own_max_speed

    def _update_max_speed(self, time: float, detected: Sequence[Detections]) -> None:
        """Of beads that are learnt: half of the distance of neighbours between two frames."""
        count = sum(detections.radii.size for detections in detected)
        interval, self._last_time = time - self._last_time, time
        if not self._tray.is_learnt or count == 0 or not interval > 0.0:
            return
        spacing = math.sqrt(math.prod(self._tray.dimensions[:2]) / count)
        reach = max(_NEIGHBOUR_SHARE * spacing, self._tray.species[0].diameter_low)
        self._own_max_speed = reach / interval
        for linker in self._linkers:
            linker.max_speed = self.max_speed * self._scale

    @property
    def darkness(self) -> NDArray[np.uint8] | None:
        """Darkness map of the last image: 0 background, 255 black; None before the first image."""
        return self._detector.darkness

    @property
    def camera_moves(self) -> bool:
        """Whether the motion of the picture is that of the camera, not of the tray."""
        return self._camera.camera_moves

    @property
    def crowded(self) -> bool:
        """Whether a species has too many grains to be tracked."""
        return self._detector.crowded

    def _process(self, record: TrayImage) -> tuple[Tracks, ...]:
        """Detect and link the beads of an image."""
        color = self.color_of(record)
        if color is None:
            self.watch(record)
            return ()
        time = self._time(record)
        if not self._linkers:
            self._linkers = [
                self._linker_of(species, record.gray.shape) for species in self._tray.species
            ]
        # Beads fly straight in space, not in the frame of a swinging tray.
        registration = _zero_if_nan(record.displacement_error) * self._scale
        rest = self._camera.camera_moves or math.isnan(record.displacement[0])
        expected = np.zeros(2) if rest else self._scale * np.array(record.displacement)
        hints = [linker.hints(time, expected) for linker in self._linkers]
        detected = self._detector.detect(color, hints)
        motion = self._motion(
            record,
            np.concatenate([detections.positions for detections in detected]),
            np.concatenate([detections.radii for detections in detected]),
        )
        if motion.changed:
            self._linkers = [
                self._linker_of(species, record.gray.shape) for species in self._tray.species
            ]
        self._update_max_speed(time, detected)
        shift = motion.displacement
        for linker, detections in zip(self._linkers, detected, strict=True):
            errors = np.hypot(detections.position_errors, registration)
            shifted = replace(
                detections, positions=detections.positions + shift, position_errors=errors
            )
            self._next_id += linker.push(time, shifted, shift, self._next_id)
        return (self._tracks(record, time, motion),)

    def color_of(self, image: TrayImage) -> NDArray[np.uint8] | None:
        """The colours of an image; those of a gray one where beads are learnt, None otherwise."""
        if image.color is None and self._tray.is_learnt:
            return np.repeat(image.gray[:, :, None], 3, axis=2)
        return image.color

    def watch(self, image: TrayImage) -> None:
        """Follow the motion of the picture alone, where beads are not tracked."""
        self._motion(image, np.empty((0, 2)), np.empty(0))

    def _time(self, image: TrayImage) -> float:
        """Time since the first image, [s]."""
        if self._first_ns is None:
            self._first_ns = image.stamp_ns
        return (image.stamp_ns - self._first_ns) / _NS

    def _motion(
        self, image: TrayImage, places: NDArray[np.float64], radii: NDArray[np.float64]
    ) -> TrayMotion:
        """Motion of the tray in space, from its motion in the picture and the beads, [px]."""
        if math.isnan(image.displacement[0]):
            return self._camera.of_lost_tray()
        moved = self._scale * np.array(image.displacement)
        error = self._scale * image.displacement_error
        return self._camera.push(self._time(image), places, radii, moved, error)

    def _linker_of(self, species: Species, shape: tuple[int, ...]) -> Linker:
        linker = Linker(
            species.count,
            (float(shape[1]), float(shape[0])),
            self.max_speed * self._scale,
            self._settings.memory,
            self._settings.window,
            FlightDeviations(
                0.5 * species.diameter * self._scale,
                assumed=self._systematic_error(species.properties),
                hidden=self._tray.chalk,
            ),
        )
        linker.follows_struck_beads = self._tray.is_learnt
        return linker

    def _systematic_error(self, material: Material) -> float:
        if self._tray.chalk:
            return material.chalk_position_error_px
        return _CROWDED_PX if self._detector.crowded else material.position_error_px

    def _tracks(self, image: TrayImage, time: float, motion: TrayMotion) -> Tracks:
        shift = motion.displacement
        displacement = shift / self._scale
        doubt = Quality.STABILISATION_LOST if motion.uncertain else Quality(0)
        snapshot = allocate_snapshot(sum(len(linker) for linker in self._linkers))
        end = 0
        for k, linker in enumerate(self._linkers):
            end = linker.write_snapshot(time, shift, k, snapshot, end)
        beads = allocate_snapshot(end)
        counts = np.empty(self._expected.size, dtype=np.int64)
        write_in_metres(snapshot, 1.0 / self._scale, displacement, beads, counts)
        return Tracks(
            stamp_ns=image.stamp_ns,
            tray=self._tray.number,
            ids=beads.ids,
            species=beads.species,
            displacement=displacement,
            positions=beads.positions,
            position_errors=beads.errors,
            velocities=beads.velocities,
            velocity_errors=beads.velocity_errors,
            radii=beads.radii,
            radius_errors=beads.radius_errors,
            seen=beads.seen,
            expected=self._expected,
            quality=image.quality | doubt | self._quality_of(counts),
            cycle=image.cycle or 0,
        )

    def _quality_of(self, counts: NDArray[np.int64]) -> Quality:
        """FEW_BEADS if too few beads of a species are visible."""
        is_short = (counts < _MIN_VISIBLE_SHARE * self._expected).any()
        return Quality.FEW_BEADS if is_short else Quality(0)


def _zero_if_nan(value: float) -> float:
    """The value, or 0 for NaN."""
    return 0.0 if math.isnan(value) else value
