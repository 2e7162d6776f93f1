"""The crop of one tray: its region, its motion and its pixels at rest.

Tested by ``test/stages/preprocess/test_frame_preprocessor.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.numerics.picture_jitter import JitterMeter
from nanorocks_ros.records import NS, UNKNOWN, Quality
from nanorocks_ros.stages.preprocess.rectify import (
    mix_weights,
    nodes_of,
    resample_color,
    resample_gray,
)
from nanorocks_ros.stages.preprocess.shaking.shake_detection import MotionMeter
from nanorocks_ros.stages.preprocess.stabilise import Shift, TrayRegistration

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.plate import Region
    from nanorocks_ros.experiment.view import View
    from nanorocks_ros.settings import PipelineSettings

# A smaller shift is ignored, since an interpolation blurs the picture.
_NEGLIGIBLE_PX = 0.04
_SIGNIFICANT = 2.0
_WHOLE = (0.0, 0.0)
_NOT_REGISTERED = Shift(UNKNOWN, UNKNOWN, UNKNOWN)
# Largest distance from the plate: beyond it something that moves beside the tray was registered.
_STRAYED_PX = 1.0


class TrayCrop:
    """Cuts one tray out of every frame, at rest.

    Parameters
    ----------
    settings : PipelineSettings
    tray : int
    region : Region
        Its floor in the rectified picture.
    view : View
    bent : bool
        Whether the frame must be rectified.
    encoding : str
        Of the frames: ``bgr8``, ``rgb8`` or ``mono8``.

    Attributes
    ----------
    shift : Shift or None
        Of the tray in the last frame; None when it is not known.
    velocity, velocity_error : tuple of 2 floats and float, [m/s]
    pending : Quality
        Flags for the next image of the tray.
    """

    def __init__(
        self,
        settings: PipelineSettings,
        tray: int,
        region: Region,
        view: View,
        *,
        bent: bool,
        encoding: str,
    ) -> None:
        self.tray = tray
        self.region = region
        self._scale = settings.preprocess.pixels_per_metre
        self._mix = settings.preprocess.gray_mix[:: -1 if encoding == 'rgb8' else 1]
        self._bgr_mix = np.array([settings.preprocess.gray_mix], dtype=np.float32)
        self._weights = mix_weights(self._mix)
        self._encoding = encoding
        self._bent = bent
        self._nodes = nodes_of(region, view)
        mono = encoding == 'mono8'
        channel_mix = np.ones(1) if mono else np.array(self._mix, dtype=np.float64)
        # In the picture of a microscope the width for trays of the flight would be enormous.
        wall = min(settings.preprocess.wall_width * self._scale, *region[2:])
        stabilise = settings.preprocess.stabilise
        self._registration = (
            TrayRegistration(region, view, wall, channel_mix) if stabilise else None
        )
        self.meter = MotionMeter(settings.speed.shake_ratio)
        self.shift: Shift | None = None
        self.velocity = (UNKNOWN, UNKNOWN)
        self.velocity_error = UNKNOWN
        self.pending = Quality(0)
        self._jitter = JitterMeter()
        self._last: Shift | None = None
        self._last_ns = 0

    @property
    def lowest_row(self) -> float:
        """The lowest row of the frame that the crop needs, [px]."""
        return float(self._nodes[:-1, :-1, 1].max()) + 1.0

    @property
    def grows(self) -> bool:
        """Whether the tray has grown or shrunk in the picture since the start."""
        return self._registration is not None and self._registration.grows

    @property
    def jitters(self) -> bool:
        """Whether the motion in the last frames is no swing of a tray on springs."""
        return self._jitter.jitters

    @property
    def displacement(self) -> tuple[float, float]:
        """Of the tray in the picture, [m]."""
        if self.shift is None:
            return UNKNOWN, UNKNOWN
        return self.shift.x / self._scale, self.shift.y / self._scale

    @property
    def displacement_error(self) -> float:
        """One standard error of each component, [m]."""
        return UNKNOWN if self.shift is None else self.shift.error / self._scale

    def register(self, image: NDArray[np.uint8], hint: Shift | None) -> Shift | None:
        """Register the tray in the next frame.

        Parameters
        ----------
        image : ndarray of uint8, (height, width, channels)
        hint : Shift or None
            Of another tray in the same frame.
        """
        if self._registration is None:
            return None
        self.shift = self._registration.push(image, hint)
        if self.shift is None and self._registration.has_walls:
            self.pending |= Quality.STABILISATION_LOST
        return self.shift

    def update_motion(self, stamp_ns: int, plate: Shift | None) -> None:
        """Correct the displacement by that of the plate, and update the velocity.

        Parameters
        ----------
        stamp_ns : int
        plate : Shift or None
            Median of the trays on the plate; None when there are too few.
        """
        own = self.shift
        if plate is not None and self._registration is not None:
            strayed = (
                own is not None and math.hypot(own.x - plate.x, own.y - plate.y) > _STRAYED_PX
            )
            if own is None or strayed:
                self.pending |= Quality.STABILISATION_LOST
                self.shift = plate
                self._registration.set_shift(plate)
        moved = self.shift or _NOT_REGISTERED
        self._jitter.push(stamp_ns / NS, moved.x, moved.y, moved.error)
        last, last_ns = self._last, self._last_ns
        self._last, self._last_ns = self.shift, stamp_ns
        self.velocity, self.velocity_error = (UNKNOWN, UNKNOWN), UNKNOWN
        if self.shift is not None and last is not None and stamp_ns > last_ns:
            rate = NS / ((stamp_ns - last_ns) * self._scale)
            self.velocity = (self.shift.x - last.x) * rate, (self.shift.y - last.y) * rate
            self.velocity_error = math.hypot(self.shift.error, last.error) * rate

    def crop(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.uint8] | None]:
        """The gray mix and the colours of the tray at rest.

        Parameters
        ----------
        image : ndarray of uint8, (height, width, channels)
            In one piece.
        """
        shift = self._significant_shift()
        if not self._bent and shift == _WHOLE:
            return self._cut(image)
        size = (self.region.height, self.region.width)
        gray = np.empty(size, dtype=np.uint8)
        if image.shape[2] == 1:
            resample_gray(image[:, :, 0], self._nodes, shift, gray)
            return gray, None
        color = np.empty((*size, 3), dtype=np.uint8)
        resample_color(image, self._nodes, shift, self._weights, color, gray)
        return gray, self._as_bgr(color)

    def _significant_shift(self) -> tuple[float, float]:
        """The shift to remove: zero where it is not significant."""
        if self.shift is None:
            return _WHOLE
        least = max(_NEGLIGIBLE_PX, _SIGNIFICANT * self.shift.error)
        if math.hypot(self.shift.x, self.shift.y) < least:
            return _WHOLE
        return self.shift.x, self.shift.y

    def _cut(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.uint8] | None]:
        x, y, width, height = self.region
        part = np.ascontiguousarray(image[y : y + height, x : x + width])
        if image.shape[2] == 1:
            return part[:, :, 0], None
        color = self._as_bgr(part)
        gray = np.asarray(cv2.transform(color, self._bgr_mix), dtype=np.uint8)
        return gray.reshape(part.shape[:2]), color

    def _as_bgr(self, color: NDArray[np.uint8]) -> NDArray[np.uint8]:
        if self._encoding != 'rgb8':
            return color
        return np.asarray(cv2.cvtColor(color, cv2.COLOR_RGB2BGR), dtype=np.uint8)
