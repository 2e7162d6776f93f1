"""Mean projected speed from the area that changed: the paper's recipe ([B19] section 3.2).

Tested by ``test/pipeline/test_tray_measurement.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.physics.moving_area import mean_displacement
from nanorocks_ros.records import (
    NS,
    Measured,
    MotionMask,
    Quality,
    SpeedEstimate,
    SpeedMethod,
    TrayImage,
)
from nanorocks_ros.stages.speed.motion_mask import MotionMasker

if TYPE_CHECKING:
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings

# Standard deviation of a Rayleigh distribution over its mean.
_RAYLEIGH_SPREAD = math.sqrt(4.0 / math.pi - 1.0)
# Range of displacements between the pictures compared that an area can tell: from so many pixels
# to so many bead diameters.
_SHORTEST_PX, _LONGEST_DIAMETERS = 1.0, 1.0


class AreaSpeed:
    """Measures the speed by the binarised area, and makes the motion mask.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray

    Attributes
    ----------
    emit_mask : bool
        Also emit a :class:`MotionMask` per image; off by default.
    emit_speed : bool
        Emit speeds; by default when the setting `speed.method` asks for them.
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings.speed
        self._scale = settings.preprocess.pixels_per_metre
        self._tray = tray
        self.emit_mask = False
        self.emit_speed = settings.speed.method == 'binarised_area'
        self.reset()

    def reset(self, stamp_ns: int | None = None) -> None:
        """Start afresh."""
        del stamp_ns
        self._masker = MotionMasker(self._settings)
        self._last_ns: int | None = None
        self._cycle: int | None = None

    def push(self, image: TrayImage) -> tuple[SpeedEstimate | MotionMask, ...]:
        """Take the next image, whose cycle is known; empty while there are too few for a mask."""
        shaken = self._cycle not in (None, image.cycle)
        self._cycle = image.cycle
        if shaken:
            self._masker.clear()
        self._masker.push(image.stamp_ns, image.gray)
        if not self._masker.full or not (self.emit_mask or self.emit_speed):
            return ()
        mask = self._masker.mask(image.noise_power)
        records: list[SpeedEstimate | MotionMask] = []
        if self.emit_mask:
            records.append(MotionMask(stamp_ns=image.stamp_ns, tray=image.tray, mask=mask))
        if self.emit_speed and self._due(image.stamp_ns, shaken):
            records.append(self._speed(int(np.count_nonzero(mask)), image))
        return tuple(records)

    def flush(self) -> tuple[SpeedEstimate | MotionMask, ...]:
        """Nothing: a speed is known with the last image of its window."""
        return ()

    def _due(self, stamp_ns: int, shaken: bool) -> bool:
        last = self._last_ns
        if not shaken and last is not None and stamp_ns - last < self._settings.interval * NS:
            return False
        self._last_ns = stamp_ns
        return True

    def _speed(self, moving_pixels: int, image: TrayImage) -> SpeedEstimate:
        area = moving_pixels / self._scale**2 / self._tray.count
        radius = 0.5 * self._tray.diameter
        raw = mean_displacement(area, radius, self._settings.geometry)
        speed = self._settings.area_factor * raw / self._masker.time_step
        speed += self._settings.area_offset
        first, last = self._masker.span_ns
        return SpeedEstimate(
            stamp_ns=(first + last) // 2,
            tray=self._tray.number,
            cycle=image.cycle or 0,
            cycle_start_ns=image.cycle_start_ns,
            # The error is the spread over the beads; the bias is larger (docs/method/speed.md).
            mean_projected_speed=Measured(
                speed, abs(speed) * _RAYLEIGH_SPREAD / math.sqrt(self._tray.count)
            ),
            window=(last - first) / NS,
            method=SpeedMethod.BINARISED_AREA,
            quality=image.quality | self._range(raw),
        )

    def _range(self, displacement: float) -> Quality:
        """Flags of a speed from a displacement, [m]."""
        quality = Quality(0)
        if self._settings.area_factor == 1.0 and self._settings.area_offset == 0.0:
            # No form of the recipe is right without manual tracks (docs/method/speed.md).
            quality |= Quality.UNCALIBRATED
        longest = _LONGEST_DIAMETERS * self._tray.diameter
        if not _SHORTEST_PX / self._scale <= displacement <= longest:
            quality |= Quality.UNCERTAIN
        return quality
