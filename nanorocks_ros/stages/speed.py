"""Mean projected speed of the beads of one tray, from its images."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.records import MotionMask, SpeedEstimate, TrayImage
from nanorocks_ros.stages.shaking import CycleFollower
from nanorocks_ros.stages.speed_by_area import AreaSpeed
from nanorocks_ros.stages.speed_by_structure import StructureSpeed

if TYPE_CHECKING:
    from nanorocks_ros.experiment.settings import PipelineSettings
    from nanorocks_ros.experiment.trays import Tray


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
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings
        self._tray = tray
        self.emit_mask = False
        self._restart()

    def _restart(self) -> None:
        speed = self._settings.speed
        self._shakes = CycleFollower(speed.shake_ratio, speed.shortest_cycle)
        self._area = AreaSpeed(self._settings, self._tray)
        self._area.emit_speed = speed.method == 'binarised_area'
        self._structure = StructureSpeed(self._settings, self._tray)
        self._last_stamp_ns: int | None = None

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
        self._area.emit_mask = self.emit_mask
        found = self._area.push(image, self._shakes, shaken)
        if self._settings.speed.method == 'structure_function':
            found += self._structure.push(image, self._shakes, shaken)
        return found
