"""Calibration of the camera from a recording of the trays, and images that show it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.experiment.view import IdentityLens, View
from nanorocks_ros.outputs.photographs import write_words
from nanorocks_ros.stages.preprocess.plate_search import guess_plate
from nanorocks_ros.stages.preprocess.rectify import nodes_of, resample_color
from nanorocks_ros.studies.calibration.plate_fit import PlateFit, fit_plate

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.calibration import Calibration
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Frame
    from nanorocks_ros.studies.analysis.bag_frames import BagFrames

# Largest number of images in the median that shows the trays without the beads.
_MAX_IMAGES = 31
# Least ratio of the mean gradient along the tray sides to that of the image; chance gives 2.
_MIN_CONTRAST = 2.5
_MIN_VISIBLE_SHARE = 0.6
MAX_RESIDUAL_PX = 0.5
_GREEN, _RED, _WHITE = (60, 220, 60), (60, 60, 240), (255, 255, 255)


def calibrate(
    frames: BagFrames, trays: Sequence[Tray], scale: tuple[float, float] | None = None
) -> tuple[PlateFit, NDArray[np.uint8]]:
    """Fit lens, pose of the plate and regions of the trays to a recording.

    Parameters
    ----------
    frames : BagFrames
    trays : sequence of Tray
        All trays on the plate.
    scale : tuple of 2 floats, [px/m], optional
        Range of the scale.

    Returns
    -------
    PlateFit
    ndarray of uint8, (height, width[, 3])
        The image that was fitted.

    Raises
    ------
    RecordingError
        When no trays are found, or their edges do not fit.
    """
    picture = median_image(frames)
    gray = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    gray = np.asarray(gray, dtype=np.uint8)
    guess = guess_plate(gray, trays, scale)
    remedy = 'see that the whole plate is in the picture, or give its scale and --trays'
    if guess is None or guess.contrast < _MIN_CONTRAST:
        raise RecordingError(frames.where, 'the trays are not found in the picture', remedy)
    fit = fit_plate(gray.astype(np.float32), trays, guess)
    if fit is None:
        raise RecordingError(
            frames.where, 'too few edges of the trays are seen to calibrate by', remedy
        )
    visible_share = len(fit.residuals) / fit.edges.expected
    residual = fit.calibration.residual_px
    if residual > MAX_RESIDUAL_PX or visible_share < _MIN_VISIBLE_SHARE:
        raise RecordingError(
            frames.where,
            f'the trays do not lie where they should: their edges are off by {residual:.2f} px '
            f'(at most {MAX_RESIDUAL_PX} px), {100 * visible_share:.0f} % of them are seen',
            remedy,
        )
    return fit, picture


def median_image(frames: BagFrames) -> NDArray[np.uint8]:
    """Median image of a recording: the scene without moving beads.

    Raises
    ------
    RecordingError
        When there is no usable frame.
    """
    images = [frame.image for frame in _evenly_spaced_frames(frames)]
    if not images:
        raise RecordingError(frames.where, 'holds no frame that can be used', 'pass another')
    size = images[0].shape
    stack = [image for image in images if image.shape == size]
    median = np.empty(size, dtype=np.uint8)
    # In blocks of rows: all rows at once would take gigabytes.
    for row in range(0, size[0], 64):
        rows = slice(row, row + 64)
        block = np.stack([image[rows] for image in stack])
        block.partition(len(stack) // 2, axis=0)
        median[rows] = block[len(stack) // 2]
    return median


def _evenly_spaced_frames(frames: BagFrames) -> Iterator[Frame]:
    """Yield frames, bgr or gray, that are evenly spaced over the recording."""
    count = max(1, frames.count)
    indices = {int(index) for index in np.linspace(0, count - 1, min(_MAX_IMAGES, count))}
    for number, frame in enumerate(frames.frames()):
        if number not in indices or isinstance(frame, FrameError):
            continue
        if frame.encoding == 'rgb8':
            raise RecordingError(frames.where, 'holds rgb8 pictures', 'record bgr8 or JPEGs')
        yield frame


def rectified_image(image: NDArray[np.uint8], view: View) -> NDArray[np.uint8]:
    """The whole image, rectified.

    Parameters
    ----------
    image : ndarray of uint8, (height, width, 3), bgr
    view : View
    """
    height, width = image.shape[:2]
    nodes = nodes_of(Region(0, 0, width, height), view)
    gray = np.empty((height, width), dtype=np.uint8)
    color = np.empty((height, width, 3), dtype=np.uint8)
    resample_color(
        np.ascontiguousarray(image), nodes, (0.0, 0.0), np.zeros(3, np.int64), color, gray
    )
    return color


def draw_calibration(picture: NDArray[np.uint8], calibration: Calibration) -> NDArray[np.uint8]:
    """Draw a calibration: the rectified image with the regions of the trays and a scale.

    Parameters
    ----------
    picture : ndarray of uint8, (height, width[, 3])
    calibration : Calibration

    Returns
    -------
    ndarray of uint8, (height, width, 3), bgr
    """
    color = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) if picture.ndim == 2 else picture
    canvas = rectified_image(np.asarray(color, dtype=np.uint8), calibration.view)
    for number, region in calibration.regions.items():
        corners = (region.x, region.y), (region.x + region.width, region.y + region.height)
        # Lines are drawn on pixels; a region ends between two pixels.
        cv2.rectangle(canvas, corners[0], (corners[1][0] - 1, corners[1][1] - 1), _GREEN, 1)
        at = (region.x + 4, region.y - 8)
        write_words(canvas, f'tray {number}', at, 0.6, _GREEN)
    _draw_scale(canvas, calibration.pixels_per_metre)
    return canvas


def _draw_scale(canvas: NDArray[np.uint8], scale: float) -> None:
    """Draw a bar of one centimetre in the lower left corner."""
    length = round(0.01 * scale)
    start = (30, canvas.shape[0] - 30)
    cv2.line(canvas, start, (start[0] + length, start[1]), _WHITE, 2)
    text = f'10 mm, {scale / 1e3:.2f} px/mm'
    cv2.putText(canvas, text, (start[0], start[1] - 10), 0, 0.6, _WHITE, 1, cv2.LINE_AA)


def max_distortion_px(calibration: Calibration) -> float:
    """Largest displacement of a tray corner by the lens distortion, [px]."""
    corners = [
        (region.x + a * region.width, region.y + b * region.height)
        for region in calibration.regions.values()
        for a in (0, 1)
        for b in (0, 1)
    ]
    straight = View(
        camera=IdentityLens(width=calibration.info.width, height=calibration.info.height),
        homography=calibration.view.homography,
    )
    points = np.array(corners, dtype=np.float64)
    moved = calibration.view.source(points) - straight.source(points)
    return float(np.hypot(moved[:, 0], moved[:, 1]).max())
