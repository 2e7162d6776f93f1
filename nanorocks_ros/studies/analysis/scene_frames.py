"""Frames spread over a bag, from which the look of its beads is learnt.

Tested by ``test/studies/analysis/test_learnt_scenes.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.stages.tracking.tracker import Tracker
from nanorocks_ros.studies.analysis.bag_images import BagImages

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import TrayImage
    from nanorocks_ros.settings import PipelineSettings

_FRAMES = 25


def scene_frames(
    path: Path,
    settings: PipelineSettings,
    *,
    image_topic: str = '',
    progress: Callable[[int, int], None] | None = None,
) -> dict[int, list[NDArray[np.uint8]]]:
    """Colour images of the trays whose beads are learnt, by tray; empty where there are none.

    Parameters
    ----------
    path : Path
        Of the bag.
    settings : PipelineSettings
    image_topic : str, optional
        The camera's topic if it has another name than the graph's.
    progress : callable, optional
        Called with the frames done and the frames there are.

    Raises
    ------
    RecordingError
        When the bag cannot be read or holds no camera.
    ConfigurationError
        When the settings cannot be used.
    FrameError
        When no frame can be used.
    """
    if not any(tray.is_learnt for tray in trays_of(settings).values()):
        return {}
    images = BagImages(path, settings, image_topic)
    every = max(1, images.bag.count // _FRAMES)
    shown = (image for shot in images.shots(progress, every=every) for image in shot.images)
    return learnt_colours(shown, images.settings, images.trays)


def learnt_colours(
    images: Iterable[TrayImage], settings: PipelineSettings, trays: Mapping[int, Tray]
) -> dict[int, list[NDArray[np.uint8]]]:
    """Colours of the images of trays whose beads are learnt, by tray.

    Parameters
    ----------
    images : iterable of TrayImage
    settings : PipelineSettings
    trays : mapping of int to Tray
    """
    learnt = {number: tray for number, tray in trays.items() if tray.is_learnt}
    trackers = {number: Tracker(settings, tray) for number, tray in learnt.items()}
    frames: dict[int, list[NDArray[np.uint8]]] = {}
    for image in images:
        color = trackers[image.tray].color_of(image) if image.tray in learnt else None
        if color is not None:
            frames.setdefault(image.tray, []).append(color)
    return frames
