"""Some frames of a recording, and its frame rate, for what has to be known before an analysis.

Tested by ``test/studies/measure/test_film_tray.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.records import NS
from nanorocks_ros.stages.preprocess.tray_regions import blue_first
from nanorocks_ros.studies.analysis.bag_frames import BagFrames

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

# Frames that are read, and by which factor a later one is farther: beads have moved by then.
_FRAMES, _STRIDE = 12, 5


class FilmSamples(NamedTuple):
    """Frames from the beginning of a recording.

    Parameters
    ----------
    frames : tuple of ndarray of uint8, (rows, columns, 3), bgr
    rate : float, [1/s]
        Frames per second: the inverse of the median interval.
    """

    frames: tuple[NDArray[np.uint8], ...]
    rate: float


def film_samples(path: Path, image_topic: str = '') -> FilmSamples:
    """Read some frames of a recording.

    Raises
    ------
    RecordingError
        When it cannot be read, or holds fewer than two frames that can be used.
    """
    bag = BagFrames(path, image_topic)
    frames, stamps = [], []
    for number, frame in enumerate(bag.frames()):
        if isinstance(frame, FrameError):
            continue
        stamps.append(frame.stamp_ns)
        if number % _STRIDE == 0:
            image = blue_first(frame)
            is_gray = image.shape[2] == 1
            frames.append(
                np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), np.uint8) if is_gray else image
            )
        if len(frames) == _FRAMES:
            break
    steps = np.diff(np.array(stamps))
    steps = steps[steps > 0]
    if not steps.size:
        raise RecordingError(bag.where, 'holds fewer than two frames', 'record a longer film')
    return FilmSamples(tuple(frames), NS / float(np.median(steps)))
