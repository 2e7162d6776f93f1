"""From a camera frame to the rectified, stabilised crop of each tray."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import FrameError
from nanorocks_ros.experiment.calibration_file import calibrated, load_calibration
from nanorocks_ros.experiment.view import IdentityLens, View
from nanorocks_ros.numerics.quantiles import median
from nanorocks_ros.records import NS, Frame, Notice, Quality, TrayImage
from nanorocks_ros.stages.preprocess.frame_checks import FrameChecks
from nanorocks_ros.stages.preprocess.gray_image_checks import picture_quality
from nanorocks_ros.stages.preprocess.shaking.shake_detection import PlateMeter
from nanorocks_ros.stages.preprocess.shaking.shaking_cycles import HeldImages, ShakeCounter
from nanorocks_ros.stages.preprocess.stabilise import shift_of_plate
from nanorocks_ros.stages.preprocess.tray_crop import TrayCrop
from nanorocks_ros.stages.preprocess.tray_position_check import position_problem
from nanorocks_ros.stages.preprocess.tray_regions import TrayRegions, blue_first

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.plate import Region
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
        self._regions: tuple[Region, ...] = ()
        self._last_stamp_ns: int | None = None
        self._tray_regions = TrayRegions(self._pipeline, self._trays, camera, view)

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
        :mod:`nanorocks_ros.stages.preprocess.shaking.shaking_cycles`.

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
        found = (*self._check_positions(frame), *self._check_sizes(frame.stamp_ns))
        return (*held, *notices, *images, *verdict.notices, *found)

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
        self._grown: set[int] = set()
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

    def _check_sizes(self, stamp_ns: int) -> tuple[Notice, ...]:
        """Say of which trays the size in the picture changes, once."""
        grown = [crop.tray for crop in self._crops if crop.grows and crop.tray not in self._grown]
        self._grown.update(grown)
        return tuple(
            Notice(
                stamp_ns=stamp_ns,
                text=f'tray {tray}: its size in the picture changes, so that no scale holds for '
                'all frames; results carry DOUBTFUL_SCALE; hold zoom and focus, and the camera',
            )
            for tray in grown
        )

    def _check_positions(self, frame: Frame) -> tuple[Notice, ...]:
        """Check the positions of the trays, early in the recording and once more."""
        self._frames += 1
        if self._frames not in _POSITION_CHECKS or not self._settings.check_tray_positions:
            return ()
        view = self._view or self._straight
        text, wrong = position_problem(
            blue_first(frame), view, self._regions, self._trays, self._pipeline
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
        if crop.grows:
            pending |= Quality.DOUBTFUL_SCALE
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
            self._regions = self._tray_regions.in_frame(frame)
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
