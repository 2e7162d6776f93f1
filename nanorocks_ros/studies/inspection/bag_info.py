"""Contents of a recording and its problems: topics, gaps, camera, calibration, damage.

Tested by ``test/recordings/bag/test_salvage.py``.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.errors import ConfigurationError, FrameError, NanorocksError
from nanorocks_ros.experiment.recorded_experiment import recorded_settings
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.messages.camera_info import info_from_message, view_from_message
from nanorocks_ros.recordings.messages.image_messages import image_kind
from nanorocks_ros.records import NS
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.calibration import CameraInfo
    from nanorocks_ros.recordings.bag.reader import BagMessage, BagReader
    from nanorocks_ros.recordings.storage import TopicInfo

# A step between messages of more than this many median steps is a gap.
_MIN_GAP = 1.5
# Topics with fewer messages have no rate.
_MIN_MESSAGES = 3
_SUPPORTED_IMAGES = frozenset({'jpeg', 'png', 'bgr8', 'rgb8', 'mono8', 'bmp', 'webp', 'tiff'})


class Problem(NamedTuple):
    """A problem of a recording and its remedy."""

    what: str
    remedy: str


@dataclass(slots=True, kw_only=True)
class TopicReport:
    """Messages of a topic.

    Parameters
    ----------
    info : TopicInfo
    stamps_ns : list of int, [ns]
        Log times.
    """

    info: TopicInfo
    stamps_ns: list[int] = field(default_factory=list)

    @property
    def rate(self) -> float | None:
        """Messages per second, from the median step; None for fewer than three messages."""
        median_ns = self._median_step_ns()
        return NS / median_ns if median_ns else None

    @property
    def gaps(self) -> int:
        """Number of gaps, where messages are missing."""
        return self._gaps().size

    @property
    def longest_gap(self) -> float:
        """Longest gap, [s]; 0 if there is none."""
        gaps = self._gaps()
        return float(gaps.max()) / NS if gaps.size else 0.0

    def _steps(self) -> NDArray[np.int64]:
        stamps = np.array(self.stamps_ns, dtype=np.int64)
        return stamps[1:] - stamps[:-1]

    def _median_step_ns(self) -> float:
        steps = self._steps()
        steps = steps[steps > 0]
        return float(np.median(steps)) if steps.size + 1 >= _MIN_MESSAGES else 0.0

    def _gaps(self) -> NDArray[np.int64]:
        steps, median_ns = self._steps(), self._median_step_ns()
        return steps[steps > _MIN_GAP * median_ns] if median_ns else steps[:0]


@dataclass(slots=True, kw_only=True)
class BagInfo:
    """Contents of a recording and its problems.

    Parameters
    ----------
    path : Path
    topics : dict of str to TopicReport
    start_ns, end_ns : int, [ns]
    size : int, [bytes]
    metadata : dict of str to str
        Provenance.
    complete : bool
    messages_lost : int
    trays : list of int
        Trays with results or ground truth, and those that the metadata name.
    calibration : CameraInfo or None
    camera : str
        Topic of the camera; empty if there is none.
    pictures : str
        Format of the images: ``jpeg``, ``png``, ``h264``, ``bgr8``.
    health : list of Problem
    """

    path: Path
    topics: dict[str, TopicReport]
    start_ns: int
    end_ns: int
    size: int
    metadata: dict[str, str]
    complete: bool = True
    messages_lost: int = 0
    trays: list[int] = field(default_factory=list)
    calibration: CameraInfo | None = None
    camera: str = ''
    pictures: str = ''
    health: list[Problem] = field(default_factory=list)

    @property
    def duration(self) -> float:
        """Time between the first and the last message, [s]."""
        return (self.end_ns - self.start_ns) / NS


def bag_info(path: Path, progress: Callable[[int, int], None]) -> BagInfo:
    """Read a recording once and summarise it.

    Parameters
    ----------
    path : Path
    progress : callable
        Called with the number of messages read and the expected total.

    Raises
    ------
    RecordingError
        If it is not a recording.
    """
    reader = open_bag(path)
    info = BagInfo(
        path=path,
        topics={name: TopicReport(info=topic) for name, topic in sorted(reader.topics.items())},
        start_ns=reader.start_ns,
        end_ns=reader.end_ns,
        size=sum(file.stat().st_size for file in reader.files),
        metadata=reader.metadata,
        trays=sorted({tray for name in reader.topics if (tray := topics.tray_of(name))}),
    )
    total = sum(topic.count for topic in reader.topics.values())
    _add_recorded_trays(info)
    info.camera = _camera(reader)
    for number, message in enumerate(reader.messages(), start=1):
        report = info.topics.get(message.topic)
        if report is not None:
            report.stamps_ns.append(message.log_time_ns)
            if len(report.stamps_ns) == 1:
                _inspect_first_message(info, reader, message)
        progress(min(number, total), total)
    info.complete = reader.complete
    read = sum(len(report.stamps_ns) for report in info.topics.values())
    info.messages_lost = max(reader.messages_lost, (reader.expected or 0) - read)
    info.health = _health(info, reader)
    return info


def _add_recorded_trays(info: BagInfo) -> None:
    try:
        recorded = recorded_settings(PipelineSettings(), (), info.metadata, str(info.path))
    except NanorocksError as error:
        info.health.append(Problem(f'{error.where}: {error.what}', error.do))
        return
    if recorded.trays_known:
        info.trays = sorted({*info.trays, *recorded.settings.trays})


def _camera(reader: BagReader) -> str:
    """Topic of the camera: that of nanorocks if present, else the first image topic."""
    nanorocks_topics = [topics.RAW_COMPRESSED.absolute(), topics.RAW.absolute()]
    types = (topics.COMPRESSED, topics.IMAGE)
    others = [name for name, topic in sorted(reader.topics.items()) if topic.type in types]
    return next((name for name in [*nanorocks_topics, *others] if name in reader.topics), '')


def _inspect_first_message(info: BagInfo, reader: BagReader, message: BagMessage) -> None:
    """Read the image format or the calibration from the first message of a topic."""
    try:
        if message.topic == info.camera:
            info.pictures = image_kind(reader.deserialize(message))
        elif message.type == topics.INFO and info.calibration is None:
            content = reader.deserialize(message)
            where = f'{info.path}: {message.topic}'
            info.calibration = info_from_message(content)
            view_from_message(content, where)
    except (ConfigurationError, FrameError) as error:
        info.calibration = None
        info.health.append(Problem(f'{error.where}: {error.what}', error.do))
    except NanorocksError as error:
        info.health.append(Problem(f'{error.where}: {error.what}', error.do))


def _health(info: BagInfo, reader: BagReader) -> list[Problem]:
    """Problems with the files, the making of the recording, and its camera."""
    remedy = f'nanorocks salvage {shlex.quote(str(info.path))} -o NEW copies readable messages'
    problems = [Problem(notice, remedy) for notice in reader.damage]
    if info.messages_lost and not reader.damage:
        problems.append(Problem(f'{info.messages_lost} messages are missing', remedy))
    problems += [
        Problem(f'it {interruption.what}', interruption.remedy)
        for interruption in reader.interruptions
    ]
    problems += info.health
    return problems + _camera_problems(info)


def _camera_problems(info: BagInfo) -> list[Problem]:
    if not info.topics:
        return [Problem('it holds no messages', 'record it again')]
    if not info.camera:
        if any(name.startswith(topics.NAMESPACE) for name in info.topics):
            return []
        return [Problem('it holds no camera', 'record sensor_msgs Image or CompressedImage')]
    problems = []
    nanorocks_topics = (topics.RAW_COMPRESSED.absolute(), topics.RAW.absolute())
    if info.camera not in nanorocks_topics:
        problems.append(
            Problem(f"the camera's topic is '{info.camera}'", f'pass --image-topic {info.camera}')
        )
    if info.pictures and info.pictures not in _SUPPORTED_IMAGES:
        problems.append(
            Problem(
                f"its images are '{info.pictures}', which is not supported",
                'record JPEG or PNG, or write them to a video file and run nanorocks import',
            )
        )
    if info.calibration is None and not any(
        'camera_info' in problem.what for problem in info.health
    ):
        problems.append(
            Problem(
                'it has no camera_info: images are assumed to be free of distortion',
                'run nanorocks calibrate and pass its file as preprocess.calibration',
            )
        )
    report = info.topics[info.camera]
    if report.gaps:
        problems.append(
            Problem(
                f'frames are missing at {counted(report.gaps, "place")}, '
                f'{report.longest_gap:.2f} s at most',
                'none needed if the camera was paused; speeds across gaps are not computed',
            )
        )
    return problems
