"""From a camera frame to the rectified, stabilised crop of each tray."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.errors import ConfigurationError, FrameError
from nanorocks_ros.experiment.calibration_file import calibrated, load_calibration
from nanorocks_ros.experiment.plate import Region, regions_on_plate
from nanorocks_ros.experiment.view import IdentityLens, View
from nanorocks_ros.numerics.quantiles import median
from nanorocks_ros.records import NS, Frame, Notice, Quality, TrayImage
from nanorocks_ros.stages.preprocess.frame_checks import FrameChecks
from nanorocks_ros.stages.preprocess.gray_image_checks import picture_quality
from nanorocks_ros.stages.preprocess.scale_advice import misfit_remedy
from nanorocks_ros.stages.preprocess.shake_detection import PlateMeter
from nanorocks_ros.stages.preprocess.shaking_cycles import HeldImages, ShakeCounter
from nanorocks_ros.stages.preprocess.stabilise import shift_of_plate
from nanorocks_ros.stages.preprocess.tray_crop import TrayCrop
from nanorocks_ros.stages.preprocess.tray_position_check import position_problem

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.stages.preprocess.stabilise import Shift

CHANNELS = {'bgr8': 3, 'rgb8': 3, 'mono8': 1}
# Frames at which the positions of the trays are checked.
_POSITION_CHECKS = (8, 16)


class Preprocessor:
    """Cuts the trays out of each frame: rectified, stabilised, with their gray mix.

    Parameters
    ----------
    settings : PipelineSettings
    trays : mapping of int to Tray
        The trays of `settings.trays`.
    camera : str
        Name of the source of the frames in errors.
    view : View, optional
        The lens, from camera_info. A calibration file in the settings has priority; without
        either, frames are taken as rectified.

    Raises
    ------
    ConfigurationError
        When the regions do not fit the trays, or the calibration file cannot be used.
    """

    def __init__(
        self,
        settings: PipelineSettings,
        trays: Mapping[int, Tray],
        camera: str,
        view: View | None = None,
    ) -> None:
        self._pipeline = calibrated(settings)
        self._settings = self._pipeline.preprocess
        if self._settings.calibration:
            view = load_calibration(self._settings.calibration).view
        self._trays = tuple(trays[number] for number in settings.trays)
        self._camera = camera
        self._view = view
        self._shape: tuple[int, ...] | None = None
        self._encoding = ''
        self._remedy = ''
        self._regions: tuple[Region, ...] = ()
        self._last_stamp_ns: int | None = None
        self._check_regions()

    @property
    def view(self) -> View | None:
        """The lens; None when it is unknown."""
        return self._view

    @property
    def regions(self) -> dict[int, Region]:
        """Regions of the trays in the rectified frame, by number; empty before the first frame."""
        return {
            tray.number: region for tray, region in zip(self._trays, self._regions, strict=False)
        }

    @property
    def duplicates(self) -> int:
        """Number of frames left out so far because they equalled the one before."""
        return 0 if self._shape is None else self._checks.duplicates

    def push(self, frame: Frame) -> tuple[TrayImage | Notice, ...]:
        """The tray images of a frame; notices alone when it cannot be used.

        While the beginning of a cycle is undecided, images are held back; see
        :mod:`nanorocks_ros.stages.preprocess.shaking_cycles`.

        Raises
        ------
        FrameError
            For an encoding that is not supported or a size that changed.
        """
        self._check_frame(frame)
        last, self._last_stamp_ns = self._last_stamp_ns, frame.stamp_ns
        notices: tuple[Notice, ...] = ()
        held: tuple[TrayImage, ...] = ()
        if last is not None and frame.stamp_ns <= last:
            late = (last - frame.stamp_ns) / NS
            if late < self._settings.late_tolerance:
                self._last_stamp_ns = last
                text = f'{self._camera}: a frame came {late:.3f} s late and was dropped'
                return (Notice(stamp_ns=frame.stamp_ns, text=text),)
            text = f'{self._camera}: time went back by {late:.3f} s; starting afresh'
            held = self.flush()
            notices = (Notice(stamp_ns=frame.stamp_ns, text=text),)
            self._start()
        verdict = self._checks.push(frame)
        if not verdict.usable:
            return (*held, *notices, *verdict.notices)
        images = self._tray_images(frame, verdict.rows, verdict.quality)
        return (*held, *notices, *images, *verdict.notices, *self._check_positions(frame))

    def flush(self) -> tuple[TrayImage, ...]:
        """The tray images that are held back, at the end of the recording."""
        return () if self._shape is None else self._held.flush()

    @property
    def held_from_ns(self) -> float:
        """Stamp of the first image that is held back, [ns]; infinite when none is."""
        return math.inf if self._shape is None else self._held.first_ns

    def _start(self) -> None:
        """Forget everything but the regions of the trays."""
        speed = self._pipeline.speed
        height, width = (self._shape or (1, 1))[:2]
        self._straight = View(camera=IdentityLens(width=width, height=height))
        view = self._view or self._straight
        self._frames = 0
        self._suspects: frozenset[int] = frozenset()
        self._misplaced: frozenset[int] = frozenset()
        self._checks = FrameChecks(self._camera)
        self._counter = ShakeCounter(speed.min_cycle_duration)
        self._held = HeldImages(self._counter)
        self._plate = PlateMeter(speed.shake_ratio, self._settings.shake_speed)
        self._crops = tuple(
            TrayCrop(
                self._pipeline,
                tray.number,
                region,
                view,
                bent=self._view is not None,
                encoding=self._encoding,
            )
            for tray, region in zip(self._trays, self._regions, strict=True)
        )

    def _check_positions(self, frame: Frame) -> tuple[Notice, ...]:
        """Check the positions of the trays, early in the recording and once more."""
        self._frames += 1
        if self._frames not in _POSITION_CHECKS or not self._settings.check_tray_positions:
            return ()
        view = self._view or self._straight
        text, wrong = position_problem(
            _blue_first(frame), view, self._regions, self._trays, self._pipeline
        )
        before, self._suspects = self._suspects, wrong
        if self._frames != _POSITION_CHECKS[-1]:
            return ()
        # A single picture may have been taken during a jolt.
        self._misplaced = before & wrong
        if not self._misplaced:
            return ()
        return (Notice(stamp_ns=frame.stamp_ns, text=f'{self._camera}: {text}'),)

    def _tray_images(self, frame: Frame, rows: int, quality: Quality) -> tuple[TrayImage, ...]:
        image = np.ascontiguousarray(frame.image).reshape(*frame.image.shape[:2], -1)
        hint: Shift | None = None
        whole = []
        for crop in self._crops:
            if rows < image.shape[0] and crop.lowest_row > rows:
                # The tray has no image of this frame; the next one carries the flag.
                crop.pending |= Quality.HALF_FRAME
                continue
            hint = crop.register(image, hint) or hint
            whole.append(crop)
        plate = shift_of_plate([crop.shift for crop in whole if crop.shift is not None])
        pictures: list[tuple[TrayCrop, NDArray[np.uint8], NDArray[np.uint8] | None]] = []
        onsets = []
        for crop in whole:
            crop.update_motion(frame.stamp_ns, plate)
            gray, color = crop.crop(image)
            onsets.append(crop.meter.push(frame.stamp_ns, gray))
            pictures.append((crop, gray, color))
        if pictures:
            plate_onsets = self._plate.push(frame.stamp_ns, *self._plate_speed())
            self._counter.push(onsets, plate_onsets)
        self._held.add(
            self._tray_image(frame.stamp_ns, crop, gray, color, quality)
            for crop, gray, color in pictures
        )
        return self._held.known()

    def _plate_speed(self) -> tuple[float, float]:
        """Speed of the plate and its error, [m/s]; NaN when no tray was registered.

        Also NaN where the picture jitters: that is the camera.
        """
        known = [
            crop for crop in self._crops if math.isfinite(crop.velocity_error) and not crop.jitters
        ]
        if not known:
            return math.nan, math.nan
        across, down = (median([crop.velocity[axis] for crop in known]) for axis in (0, 1))
        return math.hypot(across, down), median([crop.velocity_error for crop in known])

    def _tray_image(
        self,
        stamp_ns: int,
        crop: TrayCrop,
        gray: NDArray[np.uint8],
        color: NDArray[np.uint8] | None,
        quality: Quality,
    ) -> TrayImage:
        own, glare = picture_quality(gray)
        pending, crop.pending = crop.pending, Quality(0)
        if crop.tray in self._misplaced:
            pending |= Quality.WRONG_SCALE
        return TrayImage(
            stamp_ns=stamp_ns,
            tray=crop.tray,
            gray=gray,
            color=color,
            noise_power=crop.meter.noise_power,
            displacement=crop.displacement,
            displacement_error=crop.displacement_error,
            velocity=crop.velocity,
            velocity_error=crop.velocity_error,
            quality=quality | own | pending,
            glare=glare,
        )

    def _check_frame(self, frame: Frame) -> None:
        if frame.encoding not in CHANNELS:
            raise FrameError(
                self._camera,
                f'encoding {frame.encoding!r} is not supported',
                f'publish {", ".join(CHANNELS)}',
            )
        if self._shape is None:
            self._check_lens(frame.image.shape)
            self._regions = self._regions_in(frame)
            self._shape, self._encoding = frame.image.shape, frame.encoding
            self._start()
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
        if not regions and count != 1 and self._settings.layout == 'centred':
            raise ConfigurationError(
                'preprocess.regions_px',
                f'empty, with {count} trays',
                'give x, y, width, height for each tray, or layout: plate; only a single tray '
                'can be centred',
            )
        if len(self._settings.gray_mix) != 3 or sum(self._settings.gray_mix) > 1.0 + 1e-9:
            raise ConfigurationError(
                'preprocess.gray_mix',
                f'{self._settings.gray_mix}',
                'give three weights (blue, green, red) whose sum is at most 1',
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

    def _regions_in(self, frame: Frame) -> tuple[Region, ...]:
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
                misfit_remedy(_blue_first(frame), tray, self._pipeline)
                if straight
                else 'set preprocess.regions_px or preprocess.pixels_per_metre'
            )
        return self._remedy

    def _centred(self, width: int, height: int) -> tuple[int, ...]:
        sides = self._trays[0].dimensions
        w = round(sides[0] * self._settings.pixels_per_metre)
        h = round(sides[1] * self._settings.pixels_per_metre)
        return ((width - w) // 2, (height - h) // 2, w, h)


def _blue_first(frame: Frame) -> NDArray[np.uint8]:
    """The image of a frame with its channels in the order blue, green, red."""
    image = np.ascontiguousarray(frame.image).reshape(*frame.image.shape[:2], -1)
    if frame.encoding != 'rgb8':
        return image
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2BGR), dtype=np.uint8)
