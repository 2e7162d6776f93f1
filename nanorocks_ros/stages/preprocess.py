"""From the camera's frame to the gray crop of each tray, once per frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.errors import ConfigurationError, FrameError
from nanorocks_ros.records import Frame, Notice, TrayImage

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.settings import PipelineSettings
    from nanorocks_ros.experiment.trays import Tray

CHANNELS = {'bgr8': 3, 'rgb8': 3, 'mono8': 1}
NS = 1_000_000_000


class Preprocessor:
    """Crops the trays out of each frame and mixes their gray images.

    Parameters
    ----------
    settings : PipelineSettings
    trays : mapping of int to Tray
        The trays of `settings.trays`.
    camera : str
        What to call the source of the frames in an error.

    Raises
    ------
    ConfigurationError
        When the regions do not fit the trays.
    """

    def __init__(self, settings: PipelineSettings, trays: Mapping[int, Tray], camera: str) -> None:
        self._settings = settings.preprocess
        self._trays = tuple(trays[number] for number in settings.trays)
        self._camera = camera
        self._shape: tuple[int, ...] | None = None
        self._encoding = ''
        self._regions: tuple[tuple[int, int, int, int], ...] = ()
        self._last_stamp_ns: int | None = None
        self._check_regions()

    def push(self, frame: Frame) -> tuple[TrayImage | Notice, ...]:
        """The tray images of a frame; a notice alone when the frame came late.

        Raises
        ------
        FrameError
            For an encoding that is not supported or a size that changed.
        """
        self._check_frame(frame)
        last = self._last_stamp_ns
        if last is not None and frame.stamp_ns <= last:
            late = (last - frame.stamp_ns) / NS
            if late < self._settings.late_tolerance:
                text = f'{self._camera}: a frame came {late:.3f} s late and was dropped'
                return (Notice(stamp_ns=frame.stamp_ns, text=text),)
            self._last_stamp_ns = frame.stamp_ns
            text = f'{self._camera}: time went back by {late:.3f} s; starting afresh'
            notice = Notice(stamp_ns=frame.stamp_ns, text=text)
            return (notice, *self._tray_images(frame))
        self._last_stamp_ns = frame.stamp_ns
        return self._tray_images(frame)

    def _tray_images(self, frame: Frame) -> tuple[TrayImage, ...]:
        images = []
        for tray, (x, y, width, height) in zip(self._trays, self._regions, strict=True):
            crop = frame.image[y : y + height, x : x + width]
            color = None if frame.encoding == 'mono8' else _as_bgr(crop, frame.encoding)
            gray = np.ascontiguousarray(crop) if color is None else self._gray(color)
            images.append(
                TrayImage(stamp_ns=frame.stamp_ns, tray=tray.number, gray=gray, color=color)
            )
        return tuple(images)

    def _gray(self, color: NDArray[np.uint8]) -> NDArray[np.uint8]:
        mix = np.array([self._settings.gray_mix], dtype=np.float32)
        return np.asarray(cv2.transform(color, mix), dtype=np.uint8).reshape(color.shape[:2])

    def _check_frame(self, frame: Frame) -> None:
        if frame.encoding not in CHANNELS:
            raise FrameError(
                self._camera,
                f'encoding {frame.encoding!r} is not supported',
                f'publish {", ".join(CHANNELS)}',
            )
        if self._shape is None:
            self._regions = self._regions_in(frame.image.shape)
            self._shape, self._encoding = frame.image.shape, frame.encoding
        elif frame.encoding != self._encoding:
            raise FrameError(
                self._camera,
                f'the encoding changed from {self._encoding} to {frame.encoding}',
                'record each on its own, or restart after changing the camera',
            )
        elif frame.image.shape != self._shape:
            height, width = frame.image.shape[:2]
            raise FrameError(
                self._camera,
                f'the frame size changed from {self._shape[1]}x{self._shape[0]} to '
                f'{width}x{height} px',
                'record each size on its own, or restart after changing the camera',
            )

    def _check_regions(self) -> None:
        regions = self._settings.regions_px
        count = len(self._trays)
        if regions and len(regions) != 4 * count:
            raise ConfigurationError(
                'preprocess.regions_px',
                f'{len(regions)} numbers for {count} trays',
                'give x, y, width, height for each tray',
            )
        if not regions and count != 1:
            raise ConfigurationError(
                'preprocess.regions_px',
                f'empty, with {count} trays',
                'give x, y, width, height for each tray; only a single tray can be centred',
            )
        if len(self._settings.gray_mix) != 3 or sum(self._settings.gray_mix) > 1.0 + 1e-9:
            raise ConfigurationError(
                'preprocess.gray_mix',
                f'{self._settings.gray_mix}',
                'give three weights (blue, green, red) whose sum is at most 1',
            )

    def _regions_in(self, shape: tuple[int, ...]) -> tuple[tuple[int, int, int, int], ...]:
        height, width = shape[:2]
        flat = self._settings.regions_px or self._centred(width, height)
        regions = tuple(
            (flat[i], flat[i + 1], flat[i + 2], flat[i + 3]) for i in range(0, len(flat), 4)
        )
        for tray, (x, y, w, h) in zip(self._trays, regions, strict=True):
            if w < 8 or h < 8 or x < 0 or y < 0 or x + w > width or y + h > height:
                raise FrameError(
                    self._camera,
                    f'tray {tray.number} at x={x} y={y} of {w}x{h} px does not lie inside '
                    f'the {width}x{height} px frame',
                    'set preprocess.regions_px or preprocess.pixels_per_metre',
                )
        return regions

    def _centred(self, width: int, height: int) -> tuple[int, ...]:
        sides = self._trays[0].dimensions
        w = round(sides[0] * self._settings.pixels_per_metre)
        h = round(sides[1] * self._settings.pixels_per_metre)
        return ((width - w) // 2, (height - h) // 2, w, h)


def _as_bgr(crop: NDArray[np.uint8], encoding: str) -> NDArray[np.uint8]:
    if encoding == 'rgb8':
        return np.ascontiguousarray(crop[:, :, ::-1])
    return np.ascontiguousarray(crop)
