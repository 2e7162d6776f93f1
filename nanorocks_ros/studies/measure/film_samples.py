"""Size of the pictures of a recording, and some of them.

Tested by ``test/studies/measure/test_film_samples.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.stages.preprocess.tray_regions import blue_first
from nanorocks_ros.studies.analysis.bag_frames import BagFrames

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

# Frames that are kept of a whole film.
_KEPT = 25


class FilmSamples(NamedTuple):
    """What a recording is like.

    Parameters
    ----------
    size : tuple of 2 ints, [px]
        Width and height.
    frames : tuple of ndarray of uint8, (rows, columns, 3), bgr
        The first one, or some spread over the film.
    """

    size: tuple[int, int]
    frames: tuple[NDArray[np.uint8], ...]


def film_samples(path: Path, image_topic: str = '', *, whole: bool = False) -> FilmSamples:
    """Read frames of a recording.

    Parameters
    ----------
    path : Path
        Of the bag.
    image_topic : str, optional
        The camera's topic if it has another name than the graph's.
    whole : bool
        Whether frames of the whole film are read; else the first one, which is faster.

    Raises
    ------
    RecordingError
        When it cannot be read, or holds no frame that can be used.
    """
    bag = BagFrames(path, image_topic)
    every = max(1, bag.count // _KEPT)
    frames: list[NDArray[np.uint8]] = []
    for number, frame in enumerate(bag.frames()):
        if isinstance(frame, FrameError) or (frames and number % every):
            continue
        frames.append(_in_colour(blue_first(frame)))
        if not whole:
            break
    if not frames:
        raise RecordingError(bag.where, 'holds no frame that can be used', 'record it again')
    height, width = frames[0].shape[:2]
    return FilmSamples((width, height), tuple(frames))


def _in_colour(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    if image.shape[2] == 3:
        return image
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
