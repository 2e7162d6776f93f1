"""The tracks of all beads of a bag, as fast as the machine can."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from nanorocks_ros.errors import FrameError
from nanorocks_ros.experiment.film_section import FilmSection, film_section
from nanorocks_ros.stages.tracking.recognition_counts import RecognitionCounter
from nanorocks_ros.stages.tracking.tracker import Tracker
from nanorocks_ros.studies.analysis.bag_images import BagImages
from nanorocks_ros.studies.analysis.recognition_verdicts import (
    recognition_verdicts,
    scenery_of,
)
from nanorocks_ros.studies.analysis.scene_frames import scene_frames

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from nanorocks_ros.experiment.plate import Region
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.experiment.view import View
    from nanorocks_ros.records import Tracks, TrayImage
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.analysis.recognition_verdicts import Verdict


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
    film : FilmSection or None
        What the trays file says of the film.
    verdicts : dict of int to tuple of Verdict
        How well the beads were recognised, by tray.
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
    film: FilmSection | None = None
    verdicts: dict[int, tuple[Verdict, ...]] = field(default_factory=dict)

    @property
    def usable(self) -> bool:
        """Whether the beads of all trays were recognised well enough to use the tracks."""
        return all(verdict.usable for rows in self.verdicts.values() for verdict in rows)


def track_bag(
    path: Path,
    settings: PipelineSettings,
    *,
    image_topic: str = '',
    progress: Callable[[int, int], None] | None = None,
) -> TrackedBag:
    """Track the beads of a bag.

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
    images = BagImages(path, settings, image_topic)
    settings = images.settings
    trackers = {number: Tracker(settings, tray) for number, tray in images.trays.items()}
    lessons = scene_frames(path, settings, image_topic=image_topic, progress=progress)
    for number, frames in lessons.items():
        trackers[number].learn(frames)
    counters = {
        number: RecognitionCounter(images.trays[number], crowded=tracker.crowded)
        for number, tracker in trackers.items()
    }
    bag = TrackedBag(
        epoch_ns=images.epoch_ns,
        pixels_per_metre=settings.preprocess.pixels_per_metre,
        trays=images.trays,
        tracks={number: [] for number in images.trays},
        numbers={number: [] for number in images.trays},
        view=images.view,
        film=film_section(settings.trays_file),
    )
    for shot in images.shots(progress):
        for image in shot.images:
            bag.pictures[image.tray] = image
            for tracks in trackers[image.tray].push(image):
                bag.tracks[image.tray].append(tracks)
                counters[image.tray].push(tracks, trackers[image.tray].max_speed)
                bag.numbers[image.tray].append(shot.number)
    bag.frames = images.frames
    bag.regions = images.stage.regions
    bag.notices = images.notices
    if not any(bag.tracks.values()):
        raise _without_colour(images.bag.where)
    bag.verdicts = {
        number: recognition_verdicts(counter.counts(), scenery_of(bag.pictures[number].gray))
        for number, counter in counters.items()
        if number in bag.pictures
    }
    return bag


def _without_colour(where: str) -> FrameError:
    return FrameError(
        where,
        'the camera is gray; beads are told from the floor and each other by their colour',
        'record in colour, or use the structure function for speeds',
    )
