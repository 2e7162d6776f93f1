"""The tracks of all beads of a bag, as fast as the machine can."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.records import Notice, TrayImage
from nanorocks_ros.stages.pipeline import trays_of
from nanorocks_ros.stages.preprocess import Preprocessor
from nanorocks_ros.stages.tracking.tracker import Tracker
from nanorocks_ros.study.bag_frames import BagFrames

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from nanorocks_ros.experiment.plate import Region
    from nanorocks_ros.experiment.settings import PipelineSettings
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.experiment.view import View
    from nanorocks_ros.records import Frame, Tracks

NS = 1_000_000_000


@dataclass(slots=True, kw_only=True)
class TrackedBag:
    """The tracks of a bag.

    Parameters
    ----------
    epoch_ns : int
        What times count from.
    pixels_per_metre : float, [px/m]
        Of the rectified picture.
    trays : dict of int to Tray
    tracks : dict of int to list of Tracks
        By tray, in order of time.
    frames : int
        Frames in the bag.
    numbers : dict of int to list of int
        By tray, which frame of the bag, counted from 0, each of the tracks is of.
    pictures : dict of int to TrayImage
        The last image of each tray.
    notices : list of str
    view : View or None
        What is known of the lens.
    regions : dict of int to Region
        Where the trays are in the rectified frame.
    """

    epoch_ns: int
    pixels_per_metre: float
    trays: dict[int, Tray]
    tracks: dict[int, list[Tracks]]
    numbers: dict[int, list[int]]
    frames: int = 0
    pictures: dict[int, TrayImage] = field(default_factory=dict)
    notices: list[str] = field(default_factory=list)
    view: View | None = None
    regions: dict[int, Region] = field(default_factory=dict)


def track_bag(
    path: Path,
    settings: PipelineSettings,
    *,
    image_topic: str = '',
    progress: Callable[[int, int], None] | None = None,
) -> TrackedBag:
    """Follow the beads of a bag.

    Parameters
    ----------
    path : Path
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
        When no frame can be used, or the camera is gray.
    """
    bag = BagFrames(path, image_topic)
    epoch_ns = bag.epoch_ns()
    if epoch_ns is None:
        raise RecordingError(bag.where, 'holds no frame', 'pass another bag or --image-topic')
    settings = calibrated(settings)
    trays = trays_of(settings)
    stage = Preprocessor(settings, trays, bag.where, bag.view())
    trackers = {number: Tracker(settings, tray) for number, tray in trays.items()}
    found = TrackedBag(
        epoch_ns=epoch_ns,
        pixels_per_metre=settings.preprocess.pixels_per_metre,
        trays=trays,
        tracks={number: [] for number in trays},
        numbers={number: [] for number in trays},
        view=stage.view,
    )
    refused: FrameError | None = None
    for number, frame in enumerate(bag.frames()):
        found.frames = number + 1
        try:
            if isinstance(frame, FrameError):
                raise frame
            _push(found, stage, trackers, frame, number)
        except FrameError as error:
            refused = refused or error
        if progress is not None:
            progress(number + 1, bag.count)
    found.regions = stage.regions
    found.notices[:0] = bag.reader.notices
    if refused is not None:
        found.notices.append(str(refused))
    if not any(found.tracks.values()):
        raise refused or _without_colour(found, bag.where)
    return found


def _push(
    found: TrackedBag,
    stage: Preprocessor,
    trackers: dict[int, Tracker],
    frame: Frame,
    number: int,
) -> None:
    for record in stage.push(frame):
        if isinstance(record, Notice):
            found.notices.append(record.text)
            continue
        found.pictures[record.tray] = record
        for tracks in trackers[record.tray].push(record):
            found.tracks[record.tray].append(tracks)
            found.numbers[record.tray].append(number)


def _without_colour(found: TrackedBag, where: str) -> FrameError:
    if found.pictures:
        return FrameError(
            where,
            'the camera is gray; beads are told from the floor and each other by their colour',
            'record in colour, or use the structure function for speeds',
        )
    return FrameError(
        where, 'no frame can be used: all are black, white or broken', 'record it again'
    )
