"""Mean projected speed of the beads of one tray, from its gray images."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.moving_area import mean_displacement
from nanorocks_ros.records import MotionMask, SpeedEstimate, SpeedMethod, TrayImage
from nanorocks_ros.stages.motion_mask import MotionMasker
from nanorocks_ros.stages.shaking import NS, CycleFollower
from nanorocks_ros.stages.structure_function import Displacement, StructureFunction

if TYPE_CHECKING:
    from nanorocks_ros.experiment.settings import PipelineSettings
    from nanorocks_ros.experiment.trays import Tray

# Standard deviation of a Rayleigh distribution over its mean.
_RAYLEIGH_SPREAD = math.sqrt(4.0 / math.pi - 1.0)


class SpeedEstimator:
    """Measures the mean projected speed of one tray.

    Estimates come with the stamp of the middle of their window, in order of time; they are
    held back until the appearance of the beads is known, some seconds after the first
    shaking event.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray

    Attributes
    ----------
    emit_mask : bool
        Also emit a :class:`MotionMask` per image; off by default since few look at it.
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings.speed
        self._scale = settings.preprocess.pixels_per_metre
        self._tray = tray
        self.emit_mask = False
        self._restart()

    def _restart(self) -> None:
        self._shakes = CycleFollower(self._settings.shake_ratio, self._settings.shortest_cycle)
        self._masker = MotionMasker(self._settings)
        self._structure = StructureFunction(
            self._settings, self._tray.diameter * self._scale, self._tray.count
        )
        self._last_stamp_ns: int | None = None
        self._last_area_ns: int | None = None

    def push(self, image: TrayImage) -> tuple[SpeedEstimate | MotionMask, ...]:
        """Take the next image of the tray.

        Returns
        -------
        tuple of SpeedEstimate or MotionMask
            Empty while a window is filling. A stamp that goes back starts all afresh.
        """
        if self._last_stamp_ns is not None and image.stamp_ns <= self._last_stamp_ns:
            self._restart()
        self._last_stamp_ns = image.stamp_ns
        shaken = self._shakes.push(image)
        by_area = self._settings.method == 'binarised_area'
        if shaken:
            self._masker.clear()
            if not by_area:
                self._structure.shaken()
        self._masker.push(image.stamp_ns, image.gray)
        noise = self._shakes.noise_power
        found: list[SpeedEstimate | MotionMask] = []
        if self._masker.full and (by_area or self.emit_mask):
            mask = self._masker.mask(noise)
            if self.emit_mask:
                found.append(MotionMask(stamp_ns=image.stamp_ns, tray=image.tray, mask=mask))
            if by_area and self._area_due(image.stamp_ns, shaken):
                found.append(self._by_area(int(np.count_nonzero(mask))))
        if not by_area:
            cycle = (self._shakes.cycle, self._shakes.cycle_start_ns)
            moves = self._structure.push(image.stamp_ns, image.gray, cycle, noise)
            found += [self._by_structure(one) for one in moves]
        return tuple(found)

    def _by_structure(self, moved: Displacement) -> SpeedEstimate:
        window = moved.window_ns / NS
        per_pixel = 1.0 / (self._scale * window)
        return SpeedEstimate(
            stamp_ns=moved.stamp_ns,
            tray=self._tray.number,
            cycle=moved.cycle,
            cycle_start_ns=moved.cycle_start_ns,
            mean_projected_speed=moved.pixels * per_pixel,
            mean_projected_speed_error=moved.pixels_error * per_pixel,
            window=window,
            method=SpeedMethod.STRUCTURE_FUNCTION,
        )

    def _area_due(self, stamp_ns: int, shaken: bool) -> bool:
        last = self._last_area_ns
        if not shaken and last is not None and stamp_ns - last < self._settings.interval * NS:
            return False
        self._last_area_ns = stamp_ns
        return True

    def _by_area(self, moving_pixels: int) -> SpeedEstimate:
        area = moving_pixels / self._scale**2 / self._tray.count
        radius = 0.5 * self._tray.diameter
        step = self._masker.time_step
        speed = mean_displacement(area, radius, self._settings.geometry) / step
        first, last = self._masker.span_ns
        return SpeedEstimate(
            stamp_ns=(first + last) // 2,
            tray=self._tray.number,
            cycle=self._shakes.cycle,
            cycle_start_ns=self._shakes.cycle_start_ns,
            mean_projected_speed=speed,
            # The spread over so many beads; the bias of the method is larger (docs/physics.md).
            mean_projected_speed_error=speed * _RAYLEIGH_SPREAD / math.sqrt(self._tray.count),
            window=(last - first) / NS,
            method=SpeedMethod.BINARISED_AREA,
        )
