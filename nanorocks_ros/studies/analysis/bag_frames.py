"""The camera in a bag: its frames in order, its epoch, and the truth where there is one.

Tested by ``test/studies/analysis/test_sample_bag.py``.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.recordings.bag.reader import BagMessage, BagReader, open_bag
from nanorocks_ros.recordings.messages.camera_info import view_from_message
from nanorocks_ros.recordings.messages.image_messages import (
    frame_from_compressed,
    frame_from_image,
    valid_stamp_ns,
)
from nanorocks_ros.recordings.stamp_check import StampCheck
from nanorocks_ros.records import NS, Frame, GroundTruth
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from nanorocks_ros.experiment.view import View


class BagFrames:
    """Reads the frames of one camera topic of a bag.

    Parameters
    ----------
    path : str or Path
    image_topic : str, optional
        Empty: the camera topic of the graph, compressed or not.

    Attributes
    ----------
    reader : BagReader
    topic : str
        The camera topic that was found.
    notices : list of str
        What was wrong with messages beside the frames.

    Raises
    ------
    RecordingError
        When the bag cannot be read or holds no such topic.
    """

    def __init__(self, path: str | Path, image_topic: str = '') -> None:
        self.reader: BagReader = open_bag(path)
        self.notices: list[str] = []
        wanted = (
            (image_topic,)
            if image_topic
            else (topics.RAW_COMPRESSED.absolute(), topics.RAW.absolute())
        )
        self.topic = self.reader.require_topic(wanted)
        self.count = self.reader.topics[self.topic].count
        kind = self.reader.topics[self.topic].type
        if kind not in (topics.RAW.type, topics.COMPRESSED):
            raise RecordingError(
                self.where, f'holds {kind}, not images', 'pass the topic of a camera'
            )
        self._compressed = self.reader.topics[self.topic].type == topics.COMPRESSED

    @property
    def where(self) -> str:
        """Name of the frames in an error message."""
        return f'{self.reader.path}: {self.topic}'

    def epoch_ns(self) -> int | None:
        """What `time` counts from: as recorded, else the first frame; None without frames.

        Raises
        ------
        RecordingError
            When there are frames, but none that can be used.
        """
        for message in self._first(topics.EPOCH.absolute()):
            with suppress(RecordingError):
                return _nanoseconds(self.reader.deserialize(message))
        refusal = None
        for message in self._first(self.topic):
            try:
                return valid_stamp_ns(self.reader.deserialize(message), self.where)
            except (FrameError, RecordingError) as error:
                refusal = refusal or error
        if refusal is not None:
            raise RecordingError(refusal.where, refusal.what, refusal.do)
        return None

    def _first(self, topic: str) -> Iterator[BagMessage]:
        if topic in self.reader.topics:
            yield from self.reader.messages([topic])

    def view(self) -> View | None:
        """What the bag says of the lens; None when it says nothing.

        Its camera_info is that of the graph, or the one beside the camera topic.

        Raises
        ------
        RecordingError
            When it cannot be used.
        """
        message = self.lens_message()
        if message is None:
            return None
        where = f'{self.reader.path}: {message.topic}'
        if message.type != topics.CAMERA_INFO.type:
            raise RecordingError(where, f'holds {message.type}', 'record a CameraInfo')
        try:
            return view_from_message(self.reader.deserialize(message), where)
        except FrameError as error:
            raise RecordingError(error.where, error.what, error.do) from error

    def lens_message(self) -> BagMessage | None:
        """The first camera_info: that beside the camera topic, or that of the graph."""
        base = self.topic.removesuffix('/compressed').rpartition('/')[0]
        for name in (f'{base}/camera_info', topics.CAMERA_INFO.absolute()):
            for message in self._first(name):
                return message
        return None

    def frames(self) -> Iterator[Frame | FrameError]:
        """The frames, decoded, in the order they were recorded.

        In the place of a frame that cannot be used stands the reason: an encoding that is
        not supported, a picture that cannot be decoded, a stamp that cannot be.
        """
        return (frame for _, frame in self.recorded_frames())

    def recorded_frames(
        self, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[BagMessage, Frame | FrameError]]:
        """Each frame, or the reason why it cannot be used, with its message as it was recorded.

        Parameters
        ----------
        start_ns, end_ns : int, optional, [ns]
            Log times of the first and last one.
        """
        check: StampCheck[tuple[BagMessage, Frame]] = StampCheck(self.where)
        for message, frame in self._decoded(start_ns, end_ns):
            if isinstance(frame, FrameError):
                yield message, frame
                continue
            for (of_frame, checked), refusal in check.push(frame.stamp_ns, (message, frame)):
                yield of_frame, refusal or checked
        for (of_frame, checked), refusal in check.end():
            yield of_frame, refusal or checked

    def _decoded(
        self, start_ns: int | None, end_ns: int | None
    ) -> Iterator[tuple[BagMessage, Frame | FrameError]]:
        read = frame_from_compressed if self._compressed else frame_from_image
        for message in self.reader.messages([self.topic], start_ns, end_ns):
            try:
                yield message, read(self.reader.deserialize(message), self.where)
            except FrameError as error:
                yield message, error
            except RecordingError as error:
                # The other frames may be intact.
                yield message, FrameError(error.where, error.what, error.do)

    def truth(self, epoch_ns: int) -> dict[int, list[GroundTruth]]:
        """The recorded truth of a simulation, by tray; empty for a real recording."""
        names = [
            name
            for name, info in self.reader.topics.items()
            if name.endswith('/truth') and info.type == topics.ARRAY and topics.tray_of(name)
        ]
        by_tray: dict[int, list[GroundTruth]] = {}
        refusals: list[RecordingError | FrameError] = []
        for message in self.reader.messages(names) if names else ():
            tray = topics.tray_of(message.topic) or 0
            try:
                values = self.reader.deserialize(message).data
                record = from_array(
                    GroundTruth, values, tray=tray, epoch_ns=epoch_ns, where=message.topic
                )
            except (FrameError, RecordingError) as error:
                refusals.append(error)
            else:
                by_tray.setdefault(tray, []).append(record)
        if refusals:
            self.notices.append(
                f'{len(refusals)} messages of the truth cannot be used, the first: {refusals[0]}'
            )
        return by_tray


def _nanoseconds(time: Any) -> int:
    return int(time.sec) * NS + int(time.nanosec)
