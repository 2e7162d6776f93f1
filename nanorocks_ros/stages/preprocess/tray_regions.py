"""Which part of the frame each tray covers, by the settings, and whether it can.

Tested by ``test/stages/preprocess/test_frame_preprocessor.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.errors import ConfigurationError, FrameError
from nanorocks_ros.experiment.plate import Region, regions_on_plate
from nanorocks_ros.stages.preprocess.scale_advice import misfit_remedy

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.experiment.view import View
    from nanorocks_ros.records import Frame
    from nanorocks_ros.settings import PipelineSettings


class TrayRegions:
    """Finds the regions of the trays in the rectified frame.

    Parameters
    ----------
    settings : PipelineSettings
    trays : tuple of Tray
    camera : str
        Name of the source of the frames in errors.
    view : View or None
        The lens.

    Raises
    ------
    ConfigurationError
        When the settings do not fit the trays.
    """

    def __init__(
        self,
        settings: PipelineSettings,
        trays: tuple[Tray, ...],
        camera: str,
        view: View | None,
    ) -> None:
        self._pipeline = settings
        self._settings = settings.preprocess
        self._trays = trays
        self._camera = camera
        self._view = view
        self._remedy = ''
        self._check_settings()

    def in_frame(self, frame: Frame) -> tuple[Region, ...]:
        """The region of each tray.

        Raises
        ------
        FrameError
            When a tray is not inside, or the lens was calibrated at another size.
        """
        self._check_lens(frame.image.shape)
        height, width = frame.image.shape[:2]
        if self._settings.layout == 'plate' and not self._settings.regions_px:
            scale = self._settings.pixels_per_metre
            on_plate = regions_on_plate(self._trays, (height, width), scale)
            return tuple(on_plate[tray.number] for tray in self._trays)
        flat = self._settings.regions_px or self._centred(width, height)
        regions = tuple(Region(*flat[i : i + 4]) for i in range(0, len(flat), 4))
        for tray, (x, y, w, h) in zip(self._trays, regions, strict=True):
            inside = x >= 0 and y >= 0 and x + w <= width and y + h <= height
            if w < 8 or h < 8 or not (inside or self._settings.calibration):
                raise FrameError(
                    self._camera,
                    f'tray {tray.number} at x={x} y={y} of {w}x{h} px does not lie inside '
                    f'the {width}x{height} px frame',
                    self._misfit_remedy(frame, tray),
                )
        return regions

    def _misfit_remedy(self, frame: Frame, tray: Tray) -> str:
        """What to do about a tray outside the frame; searched once, as all frames are refused."""
        if not self._remedy:
            straight = self._view is None and not self._settings.regions_px
            self._remedy = (
                misfit_remedy(blue_first(frame), tray, self._pipeline)
                if straight
                else 'set preprocess.regions_px or preprocess.pixels_per_metre'
            )
        return self._remedy

    def _centred(self, width: int, height: int) -> tuple[int, ...]:
        sides = self._trays[0].dimensions
        w = round(sides[0] * self._settings.pixels_per_metre)
        h = round(sides[1] * self._settings.pixels_per_metre)
        return ((width - w) // 2, (height - h) // 2, w, h)

    def _check_settings(self) -> None:
        regions = self._settings.regions_px
        count = len(self._trays)
        if regions and len(regions) != 4 * count:
            raise ConfigurationError(
                'preprocess.regions_px',
                f'{len(regions)} numbers for {count} trays',
                'give x, y, width, height for each tray',
            )
        if not regions and count != 1 and self._settings.layout == 'centred':
            raise ConfigurationError(
                'preprocess.regions_px',
                f'empty, with {count} trays',
                'give x, y, width, height for each tray, or layout: plate; only a single tray '
                'can be centred',
            )
        mix = self._settings.gray_mix
        if len(mix) != 3 or not 0.0 < sum(mix) <= 1.0 + 1e-9:
            raise ConfigurationError(
                'preprocess.gray_mix',
                f'{mix}',
                'give three weights (blue, green, red) whose sum is above 0 and at most 1',
            )

    def _check_lens(self, shape: tuple[int, ...]) -> None:
        if self._view is None:
            return
        lens = self._view.camera
        if (lens.height, lens.width) != shape[:2]:
            raise FrameError(
                self._camera,
                f'the frame is {shape[1]}x{shape[0]} px, the calibration of the camera for '
                f'{lens.width}x{lens.height} px',
                'calibrate the camera at this size',
            )


def blue_first(frame: Frame) -> NDArray[np.uint8]:
    """The image of a frame with its channels in the order blue, green, red."""
    image = np.ascontiguousarray(frame.image).reshape(*frame.image.shape[:2], -1)
    if frame.encoding != 'rgb8':
        return image
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2BGR), dtype=np.uint8)
