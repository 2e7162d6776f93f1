"""What a recording holds, and whether it is well."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.errors import ConfigurationError, FrameError, NanorocksError
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.messages.camera_info import info_from_message, view_from_message
from nanorocks_ros.recordings.messages.image_messages import picture_kind
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.calibration import CameraInfo
    from nanorocks_ros.recordings.bag.reader import BagMessage, BagReader
    from nanorocks_ros.recordings.storage import TopicInfo

NS = 1_000_000_000
# A gap of more than this many usual intervals means that messages are missing.
_GAP = 1.5
# Topics with fewer messages have no rate.
_FEWEST = 3


class Ailment(NamedTuple):
    """What is wrong with a recording, and what to do about it."""

    what: str
    remedy: str


@dataclass(slots=True, kw_only=True)
class TopicReport:
    """What was found on a topic.

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
        """Messages per second, by the usual interval."""
        usual = self._usual_ns()
        return NS / usual if usual else None

    @property
    def gaps(self) -> int:
        """How often messages are missing between two."""
        return self._gaps().size

    @property
    def longest_gap(self) -> float:
        """The longest of them, [s]; 0 without one."""
        gaps = self._gaps()
        return float(gaps.max()) / NS if gaps.size else 0.0

    def _steps(self) -> NDArray[np.int64]:
        stamps = np.array(self.stamps_ns, dtype=np.int64)
        return stamps[1:] - stamps[:-1]

    def _usual_ns(self) -> float:
        steps = self._steps()
        steps = steps[steps > 0]
        return float(np.median(steps)) if steps.size + 1 >= _FEWEST else 0.0

    def _gaps(self) -> NDArray[np.int64]:
        steps, usual = self._steps(), self._usual_ns()
        return steps[steps > _GAP * usual] if usual else steps[:0]


@dataclass(slots=True, kw_only=True)
class BagInfo:
    """What a recording holds.

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
        That it holds results or truth of.
    calibration : CameraInfo or None
    camera : str
        Its topic; empty without one.
    pictures : str
        How they are stored: ``jpeg``, ``png``, ``h264``, ``bgr8``.
    health : list of Ailment
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
    health: list[Ailment] = field(default_factory=list)

    @property
    def duration(self) -> float:
        """From the first message to the last, [s]."""
        return (self.end_ns - self.start_ns) / NS


def bag_info(path: Path, progress: Callable[[int, int], None]) -> BagInfo:
    """Go through a recording, once.

    Parameters
    ----------
    path : Path
    progress : callable
        Called with the messages read and those there may be.

    Raises
    ------
    RecordingError
        When it is no recording.
    """
    reader = open_bag(path)
    found = BagInfo(
        path=path,
        topics={name: TopicReport(info=info) for name, info in sorted(reader.topics.items())},
        start_ns=reader.start_ns,
        end_ns=reader.end_ns,
        size=sum(file.stat().st_size for file in reader.files),
        metadata=reader.metadata,
        trays=sorted({tray for name in reader.topics if (tray := topics.tray_of(name))}),
    )
    held = sum(info.count for info in reader.topics.values())
    found.camera = _camera(reader)
    for number, message in enumerate(reader.messages(), start=1):
        report = found.topics.get(message.topic)
        if report is not None:
            report.stamps_ns.append(message.log_time_ns)
            if len(report.stamps_ns) == 1:
                _look(found, reader, message)
        progress(min(number, held), held)
    found.complete = reader.complete
    read = sum(len(one.stamps_ns) for one in found.topics.values())
    found.messages_lost = max(reader.messages_lost, (reader.expected or 0) - read)
    found.health = _health(found, reader)
    return found


def _camera(reader: BagReader) -> str:
    """The camera of the graph, or any other."""
    ours = [topics.RAW_COMPRESSED.absolute(), topics.RAW.absolute()]
    kinds = (topics.COMPRESSED, topics.IMAGE)
    others = [name for name, info in sorted(reader.topics.items()) if info.type in kinds]
    return next((one for one in [*ours, *others] if one in reader.topics), '')


def _look(found: BagInfo, reader: BagReader, message: BagMessage) -> None:
    """Take a closer look at the first message of a topic."""
    try:
        if message.topic == found.camera:
            found.pictures = picture_kind(reader.deserialize(message))
        elif message.type == topics.INFO and found.calibration is None:
            content = reader.deserialize(message)
            where = f'{found.path}: {message.topic}'
            found.calibration = info_from_message(content)
            view_from_message(content, where)
    except (ConfigurationError, FrameError) as error:
        found.calibration = None
        found.health.append(Ailment(f'{error.where}: {error.what}', error.do))
    except NanorocksError as error:
        found.health.append(Ailment(f'{error.where}: {error.what}', error.do))


def _health(found: BagInfo, reader: BagReader) -> list[Ailment]:
    again = f'nanorocks salvage {shlex.quote(str(found.path))} -o NEW copies what can be read'
    ailments = [Ailment(notice, again) for notice in reader.damage]
    if found.messages_lost and not reader.damage:
        ailments.append(Ailment(f'{found.messages_lost} messages are missing', again))
    ailments += [Ailment(f'it {one.what}', one.remedy) for one in reader.unfinished]
    ailments += found.health
    return ailments + _camera_ailments(found)


def _camera_ailments(found: BagInfo) -> list[Ailment]:
    if not found.topics:
        return [Ailment('it holds no messages', 'record it again')]
    if not found.camera:
        if any(name.startswith(topics.NAMESPACE) for name in found.topics):
            return []
        return [Ailment('it holds no camera', 'record sensor_msgs Image or CompressedImage')]
    ailments = []
    ours = (topics.RAW_COMPRESSED.absolute(), topics.RAW.absolute())
    if found.camera not in ours:
        ailments.append(
            Ailment(
                f"the camera's topic is '{found.camera}'", f'pass --image-topic {found.camera}'
            )
        )
    if found.pictures and found.pictures not in _READ:
        ailments.append(
            Ailment(
                f"its pictures are '{found.pictures}', which is not supported",
                'record JPEG or PNG, or write a video of them and run nanorocks import',
            )
        )
    if found.calibration is None and not any(
        'camera_info' in ailment.what for ailment in found.health
    ):
        ailments.append(
            Ailment(
                'it has no camera_info: pictures are taken as straight',
                'nanorocks calibrate, then pass its file as preprocess.calibration',
            )
        )
    report = found.topics[found.camera]
    if report.gaps:
        ailments.append(
            Ailment(
                f'frames are missing at {report.gaps} places, {report.longest_gap:.2f} s at most',
                'nothing, if the camera was paused; speeds across the gaps are left out',
            )
        )
    return ailments


_READ = frozenset({'jpeg', 'png', 'bgr8', 'rgb8', 'mono8', 'bmp', 'webp', 'tiff'})
