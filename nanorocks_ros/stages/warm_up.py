"""Compiles what a first frame would have to wait for, while no frame is waiting."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.experiment.settings import PipelineSettings, with_values
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.view import Straight, View
from nanorocks_ros.records import Frame, TrayImage
from nanorocks_ros.stages.preprocess import Preprocessor
from nanorocks_ros.stages.shaking import CycleFollower

_SIDE = 160
_REGION = (40, 40, 80, 80)


def warm_up_counting() -> None:
    """Push two images through what counts shaking events in images that nobody has counted."""
    follower = CycleFollower(2.0, 1.0)
    for stamp_ns in (0, 1):
        gray = np.full((16, 16), 100, dtype=np.uint8)
        follower.push(TrayImage(stamp_ns=stamp_ns, tray=1, gray=gray))


def warm_up() -> None:
    """Push a few pictures of a square through a preprocessor.

    From the cache on the disk this takes a second, without it some tens of seconds.
    """
    values = {'preprocess.regions_px': _REGION}
    settings = with_values(PipelineSettings(), values, 'warm-up')
    view = View(camera=Straight(width=_SIDE, height=_SIDE))
    noise = np.random.default_rng(0).integers(90, 110, (3, _SIDE, _SIDE, 3), dtype=np.uint8)
    x, y, width, height = _REGION
    # The last is lost, and looked for.
    noise[:2, y : y + height, x : x + width] += 80
    for encoding in ('bgr8', 'mono8'):
        stage = Preprocessor(settings, {1: load_trays()[1]}, 'warm-up', view)
        # Enough frames for the look at the map of the trays.
        for number in range(10):
            image = noise[2 if number == 9 else number % 2]
            pixels = image if encoding == 'bgr8' else np.ascontiguousarray(image[:, :, 0])
            stage.push(Frame(stamp_ns=number, encoding=encoding, image=pixels))
