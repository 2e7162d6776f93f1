"""Intermediate images of the preprocessing of one frame, as in [B19] fig. 4."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.errors import ConfigurationError, FrameError
from nanorocks_ros.experiment.view import IdentityLens, View
from nanorocks_ros.records import NS
from nanorocks_ros.stages.preprocess.rectify import (
    mix_weights,
    nodes_of,
    resample_color,
    resample_gray,
)
from nanorocks_ros.stages.speed.motion_mask import MotionMasker
from nanorocks_ros.stages.tracking.tracker import Tracker
from nanorocks_ros.studies.analysis.bag_images import BagImages

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.plate import Region
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Frame, Tracks, TrayImage
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.analysis.bag_images import Shot

# Margin of the raw image around the floor of a tray.
_MARGIN_PX = 12
# Points along each side of a floor, so that lens distortion is visible.
_SIDE_POINTS = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class TraySteps:
    """One tray of one frame, step by step.

    Parameters
    ----------
    tray : Tray
    raw : ndarray of uint8, (h, w, 3), bgr, or (h, w)
        Part of the camera frame.
    outline : ndarray (n, 2), [px]
        Edge of the floor in `raw`, for the tray at rest.
    straight : ndarray of uint8, (rows, columns, 3), bgr, or (rows, columns)
        Rectified by the lens and the pose of the plate only.
    image : TrayImage
        The same with the motion of the tray removed.
    darkness : ndarray of uint8, (rows, columns), or None
        Input of the bead detection; None for a gray camera.
    difference : ndarray (rows, columns), or None, [gray levels]
        Difference of the averages that the binarised area compares; None while there are too
        few frames.
    mask : ndarray of uint8, (rows, columns), or None
        255 where the difference is motion.
    tracks : Tracks or None
    pixels_per_metre : float, [px/m]
    """

    tray: Tray
    raw: NDArray[np.uint8]
    outline: NDArray[np.float64]
    straight: NDArray[np.uint8]
    image: TrayImage
    darkness: NDArray[np.uint8] | None
    difference: NDArray[np.uint8] | NDArray[np.float32] | None
    mask: NDArray[np.uint8] | None
    tracks: Tracks | None
    pixels_per_metre: float

    @property
    def moving_area(self) -> float | None:
        """Area with motion, [m^2]; None while there are too few frames."""
        if self.mask is None:
            return None
        return float(np.count_nonzero(self.mask)) / self.pixels_per_metre**2


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameSteps:
    """One frame, step by step.

    Parameters
    ----------
    number : int
        Number of the frame in the bag, counted from 0.
    time : float, [s]
        Time since the first usable frame.
    trays : dict of int to TraySteps
    notices : list of str
    """

    number: int
    time: float
    trays: dict[int, TraySteps]
    notices: list[str]


def steps_of_bag(
    path: Path,
    settings: PipelineSettings,
    *,
    number: int | None = None,
    time: float | None = None,
    image_topic: str = '',
    progress: Callable[[int, int], None] | None = None,
) -> FrameSteps:
    """Process a bag up to one frame, and return every step of that frame.

    All earlier frames are processed as in an analysis, because the steps depend on them: on the
    first position of the tray, the background, and the noise.

    Parameters
    ----------
    path : Path
    settings : PipelineSettings
    number : int, optional
        Number of the frame, counted from 0; by default the one in the middle.
    time : float, optional, [s]
        Instead of the number: the first frame at least this long after the first one.
    image_topic : str, optional
    progress : callable, optional

    Raises
    ------
    RecordingError
        If the bag cannot be read.
    ConfigurationError
        If the settings are invalid, or the bag ends before that frame.
    FrameError
        If that frame cannot be used.
    """
    images = BagImages(path, settings, image_topic)
    target = images.bag.count // 2 if number is None else number
    stages = {key: _TrayStages(images.settings, tray) for key, tray in images.trays.items()}
    first_ns: int | None = None
    for shot in images.shots(progress):
        first_ns = shot.frame.stamp_ns if first_ns is None else first_ns
        elapsed = (shot.frame.stamp_ns - first_ns) / NS
        for image in shot.images:
            stages[image.tray].push(image)
        if (shot.number < target) if time is None else (elapsed < time):
            continue
        if not shot.images or (time is None and shot.number > target):
            break
        return FrameSteps(
            number=shot.number,
            time=elapsed,
            trays=_steps(shot, images, stages),
            notices=images.notices,
        )
    else:
        flag, value = ('--frame', str(target)) if time is None else ('--at', f'{time:g} s')
        raise ConfigurationError(
            flag,
            f'{value}, but the recording has {images.frames} frames',
            'choose an earlier frame',
        )
    reason = f' ({images.error.what})' if images.error else ''
    raise FrameError(
        f'{images.bag.where}: frame {target if time is None else shot.number}',
        f'cannot be used{reason}',
        'choose another frame',
    )


class _TrayStages:
    """The stages that process the images of one tray."""

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._cycle: int | None = None
        self._noise_power = 0.0
        self._masker = MotionMasker(settings.speed)
        self._tracker = Tracker(settings, tray)
        self.tracks: Tracks | None = None

    def push(self, image: TrayImage) -> None:
        if self._cycle not in (None, image.cycle):
            self._masker.clear()
        self._cycle, self._noise_power = image.cycle, image.noise_power
        self._masker.push(image.stamp_ns, image.gray)
        self.tracks = next(iter(self._tracker.push(image)), None)

    @property
    def darkness(self) -> NDArray[np.uint8] | None:
        return self._tracker.darkness

    @property
    def difference(self) -> NDArray[np.uint8] | NDArray[np.float32] | None:
        return self._masker.difference() if self._masker.full else None

    @property
    def mask(self) -> NDArray[np.uint8] | None:
        return self._masker.mask(self._noise_power) if self._masker.full else None


def _steps(shot: Shot, images: BagImages, stages: dict[int, _TrayStages]) -> dict[int, TraySteps]:
    height, width = shot.frame.image.shape[:2]
    view = images.view or View(camera=IdentityLens(width=width, height=height))
    steps = {}
    for image in shot.images:
        region = images.stage.regions[image.tray]
        raw, outline = _raw_view(shot.frame, region, view)
        stage = stages[image.tray]
        steps[image.tray] = TraySteps(
            tray=images.trays[image.tray],
            raw=raw,
            outline=outline,
            straight=_straight(shot.frame, region, view),
            image=image,
            darkness=stage.darkness,
            difference=stage.difference,
            mask=stage.mask,
            tracks=stage.tracks,
            pixels_per_metre=images.settings.preprocess.pixels_per_metre,
        )
    return steps


def _raw_view(
    frame: Frame, region: Region, view: View
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """The part of the frame that shows a tray, and the edge of its floor there."""
    along = np.linspace(0.0, 1.0, _SIDE_POINTS, endpoint=False)
    zeros, ones = np.zeros(_SIDE_POINTS), np.ones(_SIDE_POINTS)
    sides = [(along, zeros), (ones, along), (1.0 - along, ones), (zeros, 1.0 - along)]
    edge = np.concatenate([np.stack(side, axis=-1) for side in sides])
    outline = view.source((region.x, region.y) + edge * (region.width, region.height))
    size = frame.image.shape[1::-1]
    low = np.clip(np.floor(outline.min(axis=0)) - _MARGIN_PX, 0, size).astype(int)
    high = np.clip(np.ceil(outline.max(axis=0)) + _MARGIN_PX, 0, size).astype(int)
    part = _as_bgr(frame.image, frame.encoding)[low[1] : high[1], low[0] : high[0]]
    return part, outline - low


def _straight(frame: Frame, region: Region, view: View) -> NDArray[np.uint8]:
    """Rectified image of the rest position of a tray, without removal of its motion."""
    nodes = nodes_of(region, view)
    image = np.ascontiguousarray(frame.image).reshape(*frame.image.shape[:2], -1)
    gray = np.empty((region.height, region.width), dtype=np.uint8)
    if image.shape[2] == 1:
        resample_gray(image[:, :, 0], nodes, (0.0, 0.0), gray)
        return gray
    color = np.empty((*gray.shape, 3), dtype=np.uint8)
    resample_color(image, nodes, (0.0, 0.0), mix_weights((0.0, 0.0, 0.0)), color, gray)
    return _as_bgr(color, frame.encoding)


def _as_bgr(image: NDArray[np.uint8], encoding: str) -> NDArray[np.uint8]:
    if encoding != 'rgb8':
        return image
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2BGR), dtype=np.uint8)
