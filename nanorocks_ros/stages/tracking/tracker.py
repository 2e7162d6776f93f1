"""From the colour crops of a tray to its beads, each with a number that it keeps."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import Quality, Tracks, TrayImage
from nanorocks_ros.stages.tracking.detection.bead_detector import BeadDetector
from nanorocks_ros.stages.tracking.linking.track_linker import Linker
from nanorocks_ros.stages.tracking.linking.track_snapshot import (
    count_seen,
    in_metres,
    room_in_view,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.materials import Material
    from nanorocks_ros.experiment.trays import Species, Tray
    from nanorocks_ros.settings import PipelineSettings

_NS = 1e9
# Of the beads of a species, a share below which speeds and counts are not to be relied upon.
_FEW = 0.85
# Systematic error of a position in a tray with grains too crowded to follow, [px]; the same from
# frame to frame, so that velocities have no part in it.
_CROWDED_PX = 0.6


class Tracker:
    """Follows the beads of one tray.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings.tracking
        self._scale = settings.preprocess.pixels_per_metre
        self._tray = tray
        self._expected = np.array([one.count for one in tray.species], dtype=np.int32)
        self._restart()

    def _restart(self) -> None:
        self._detector = BeadDetector(self._settings, self._tray, self._scale)
        self._linkers: list[Linker] = []
        self._first_ns = 0
        self._last_ns: int | None = None
        self._next_number = 0

    @property
    def darkness(self) -> NDArray[np.uint8] | None:
        """Of the last image, where beads are looked for: 0 floor, 255 black; None before it."""
        return self._detector.darkness

    @property
    def crowded(self) -> bool:
        """Whether a species has too many grains to be followed."""
        return self._detector.crowded

    def push(self, image: TrayImage) -> tuple[Tracks, ...]:
        """The beads of the next image of the tray.

        Returns
        -------
        tuple of Tracks
            One; none for a gray image, in which species cannot be told apart. A stamp that
            goes back starts all afresh.
        """
        if image.color is None:
            return ()
        if self._last_ns is not None and image.stamp_ns <= self._last_ns:
            self._restart()
        if not self._linkers:
            self._first_ns = image.stamp_ns
            self._linkers = [self._linker(one, image.gray.shape) for one in self._tray.species]
        self._last_ns = image.stamp_ns
        time = (image.stamp_ns - self._first_ns) / _NS
        # Beads fly straight past the camera, not past a tray that swings.
        displacement = np.array([_known(one) for one in image.displacement])
        shift = displacement * self._scale
        registration = _known(image.displacement_error) * self._scale
        hints = [linker.hints(time, shift) for linker in self._linkers]
        detected = self._detector.detect(image.color, hints)
        for linker, found in zip(self._linkers, detected, strict=True):
            errors = np.hypot(found.place_errors, registration)
            moved = replace(found, places=found.places + shift, place_errors=errors)
            self._next_number += linker.push(time, moved, shift, self._next_number)
        return (self._tracks(image, time, displacement),)

    def _linker(self, species: Species, shape: tuple[int, ...]) -> Linker:
        return Linker(
            species.count,
            (float(shape[1]), float(shape[0])),
            self._settings.fastest * self._scale,
            self._settings.longest_gap,
            self._settings.window,
            self._systematic(species.properties),
        )

    def _systematic(self, material: Material) -> float:
        if self._tray.chalk:
            return material.chalk_position_error_px
        return _CROWDED_PX if self._detector.crowded else material.position_error_px

    def _tracks(self, image: TrayImage, time: float, displacement: NDArray[np.float64]) -> Tracks:
        shift = displacement * self._scale
        view = room_in_view(sum(len(linker) for linker in self._linkers))
        end = 0
        for k, linker in enumerate(self._linkers):
            end = linker.show(time, shift, k, view, end)
        order = np.argsort(view.ids[:end], kind='stable')
        beads = in_metres(view, order, 1.0 / self._scale, displacement)
        return Tracks(
            stamp_ns=image.stamp_ns,
            tray=self._tray.number,
            ids=beads.ids,
            species=beads.species,
            displacement=displacement,
            positions=beads.places,
            position_errors=beads.errors,
            velocities=beads.velocities,
            velocity_errors=beads.velocity_errors,
            radii=beads.radii,
            radius_errors=beads.radius_errors,
            seen=beads.seen,
            expected=self._expected,
            quality=image.quality | self._few(beads.species, beads.seen),
        )

    def _few(self, species: NDArray[np.int32], seen: NDArray[np.bool_]) -> Quality:
        """What the species of the beads that are seen say of how many are not."""
        counts = count_seen(species, seen, self._expected.size)
        few = (counts < _FEW * self._expected).any()
        return Quality.FEW_BEADS if few else Quality(0)


def _known(value: float) -> float:
    """The value, or 0 where it is not known."""
    return 0.0 if math.isnan(value) else value
