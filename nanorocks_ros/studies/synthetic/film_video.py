"""Close-up film of a simulated tray as a video."""

from __future__ import annotations

import math
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

import cv2
import numpy as np

from nanorocks_ros import __version__
from nanorocks_ros.outputs.atomic_files import atomic_file
from nanorocks_ros.recordings.film.pyav import pyav
from nanorocks_ros.simulation.tray_camera.tray_film import film
from nanorocks_ros.simulation.tray_camera.tray_renderer import RIM
from nanorocks_ros.studies.synthetic.simulated_plan import check_duration

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.jobs.progress import Progress
    from nanorocks_ros.settings import SimulationSettings

    Picture = NDArray[np.uint8]

# Moved in OpenCV 5.
_opencv_log: Any = getattr(cv2.utils, 'logging', cv2)
_SILENT = 0

VIDEOS = '.mp4', '.avi'
"""Suffixes of videos: H.264, which needs PyAV, and Motion JPEG."""

# Largest size of a close-up image.
_WIDTH_PX, _HEIGHT_PX = 1280, 720
# Margin around the floor of the tray, [m].
_MARGIN = 1.5 * RIM
_SCALES = 100.0, 1e6
_TICKS = 1000
# Alternative to a video that needs PyAV, for the message.
_ALTERNATIVE = 'name a .avi file'


class VideoQuality(NamedTuple):
    """How much a video loses.

    Parameters
    ----------
    crf : float
        Constant rate factor of x264, for ``.mp4``; the loss at 20 is hardly visible.
    jpeg : int or None, 1 to 100
        Quality of the frames of ``.avi``; None for what OpenCV takes by default.
    """

    crf: float = 20.0
    jpeg: int | None = None


def check_video(path: Path) -> None:
    """Raise for a video in a format that is not available.

    Raises
    ------
    ConfigurationError
        When PyAV, which writes H.264, is not installed.
    """
    if path.suffix == '.mp4':
        pyav(str(path), _ALTERNATIVE)


def close_up(settings: SimulationSettings, tray: Tray) -> SimulationSettings:
    """The settings with the camera so close that the tray fills the image."""
    length, width = (side + 2.0 * _MARGIN for side in tray.dimensions[:2])
    scale = min(max(min(_WIDTH_PX / length, _HEIGHT_PX / width), _SCALES[0]), _SCALES[1])
    return replace(
        settings,
        pixels_per_metre=scale,
        width_px=2 * math.ceil(0.5 * length * scale),
        height_px=2 * math.ceil(0.5 * width * scale),
    )


def film_into_video(
    path: Path,
    settings: SimulationSettings,
    tray: Tray,
    *,
    duration: float,
    progress: Progress,
) -> dict[str, Any]:
    """Film a simulated tray into a video that plays in real time.

    Parameters
    ----------
    path : Path
        ``.mp4`` or ``.avi``.
    settings : SimulationSettings
    tray : Tray
    duration : float, [s], > 0
    progress : callable
        Called with the number of written frames and the number of frames.

    Returns
    -------
    dict
        Number of frames, duration.

    Raises
    ------
    ConfigurationError
        For a duration out of range, or when PyAV is needed and not installed.
    SimulationError
        When the beads do not fit into the tray, or the tray into the image.
    RecordingError
        When the video cannot be written.
    """
    check_duration(duration)
    frames = max(1, round(duration * settings.frame_rate))
    images = (frame.image for frame, _ in film(settings, tray, frames))
    images_into_video(path, settings, images, frames=frames, progress=progress)
    return {'frames': frames, 'duration': duration}


def images_into_video(
    path: Path,
    settings: SimulationSettings,
    images: Iterable[Picture],
    *,
    frames: int,
    progress: Progress,
    quality: VideoQuality | None = None,
) -> None:
    """Write images of the size and at the rate of the settings into a video.

    Parameters
    ----------
    path : Path
        ``.mp4`` or ``.avi``.
    settings : SimulationSettings
    images : iterable of ndarray of uint8, (rows, columns, 3), bgr
    frames : int
    progress : callable
        Called with the number of written frames and the number of frames.
    quality : VideoQuality, optional

    Raises
    ------
    ConfigurationError
        Where PyAV is needed and not installed.
    RecordingError
        When the video cannot be written.
    """
    kind = _h264 if path.suffix == '.mp4' else _motion_jpeg
    with atomic_file(path) as part, kind(part, settings, quality or VideoQuality()) as write:
        for done, image in enumerate(images, start=1):
            write(image)
            progress(done, frames)


@contextmanager
def _motion_jpeg(
    path: Path, settings: SimulationSettings, quality: VideoQuality
) -> Iterator[Callable[[Picture], None]]:
    """Write Motion JPEG with OpenCV, whose wheels have no H.264 encoder."""
    code = cv2.VideoWriter.fourcc(*'MJPG')
    size = settings.width_px, settings.height_px
    count = 0

    def write(image: Picture) -> None:
        nonlocal count
        writer.write(image)
        count += 1

    with _no_warnings():
        if quality.jpeg is None:
            writer = cv2.VideoWriter(str(path), code, settings.frame_rate, size)
        else:
            # The encoder of OpenCV itself, whose quality can be set.
            own = cv2.CAP_OPENCV_MJPEG
            writer = cv2.VideoWriter(str(path), own, code, settings.frame_rate, size)
            writer.set(cv2.VIDEOWRITER_PROP_QUALITY, quality.jpeg)
        try:
            yield write
        finally:
            writer.release()
        # OpenCV does not report a full disk in another way.
        video = cv2.VideoCapture(str(path))
        written = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
        video.release()
    if written != count:
        raise OSError(f'{written} of {count} frames arrived')


@contextmanager
def _no_warnings() -> Iterator[None]:
    earlier = _opencv_log.getLogLevel()
    _opencv_log.setLogLevel(_SILENT)
    try:
        yield
    finally:
        _opencv_log.setLogLevel(earlier)


@contextmanager
def _h264(
    path: Path, settings: SimulationSettings, quality: VideoQuality
) -> Iterator[Callable[[Picture], None]]:
    av = pyav(str(path), _ALTERNATIVE)
    # The index comes first, so that players in web pages start at once.
    with av.open(str(path), 'w', options={'movflags': '+faststart'}) as container:
        container.metadata['comment'] = f'nanorocks_ros {__version__}, seed {settings.seed}'
        rate = Fraction(settings.frame_rate).limit_denominator(_TICKS)
        options = {'crf': f'{quality.crf:g}'}
        stream = container.add_stream('libx264', rate=rate, options=options)
        # The yuv420p format, which players need, has even sides.
        stream.width, stream.height = settings.width_px // 2 * 2, settings.height_px // 2 * 2
        stream.pix_fmt = 'yuv420p'

        def write(image: Picture) -> None:
            whole = np.ascontiguousarray(image[: stream.height, : stream.width])
            container.mux(stream.encode(av.VideoFrame.from_ndarray(whole, format='bgr24')))

        yield write
        container.mux(stream.encode())
