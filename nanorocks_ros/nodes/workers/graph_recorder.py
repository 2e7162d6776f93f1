"""Writes the camera and all results of the graph into a bag while it runs."""

from __future__ import annotations

import shutil
from functools import partial
from typing import TYPE_CHECKING, Any

from rclpy.serialization import serialize_message
from sensor_msgs.msg import CompressedImage

from nanorocks_ros import __version__
from nanorocks_ros.errors import NanorocksError
from nanorocks_ros.experiment.recorded_experiment import metadata_of_settings
from nanorocks_ros.nodes.base.problems import (
    FRAMES_LOST,
    RECORDING_STOPPED,
    DiskSpace,
    Level,
    Problem,
)
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.reader import BagMessage
from nanorocks_ros.recordings.bag.recorder import Recorder
from nanorocks_ros.recordings.messages.image_messages import frame_to_jpeg
from nanorocks_ros.recordings.messages.message_builders import (
    compressed_image_message,
    time_message,
)
from nanorocks_ros.settings import PipelineSettings, rows
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from nanorocks_ros.nodes.base.node import NanorocksNode
    from nanorocks_ros.records import Frame
    from nanorocks_ros.settings import RecordSettings
    from nanorocks_ros.wire.topics import Topic

_CHECK_S = 1.0
_REPEAT_WARNING_S = 5.0
_JPEG_FORMAT = 'bgr8; jpeg compressed bgr8'


class GraphRecorder:
    """Records the frames that a node receives and the results that it publishes.

    In the bag, topics are under the default namespace, whatever the namespace of the graph.
    Compressed images are kept as they are; others are encoded as JPEG, in the thread that writes.

    Parameters
    ----------
    node : NanorocksNode
    settings : RecordSettings
    provenance : mapping of str to str
        Kept in the metadata of the bag.
    trays : sequence of int
    wait_for_disk : bool
        Hold the frames up when the disk is too slow, rather than leave some out.
    """

    def __init__(
        self,
        node: NanorocksNode,
        settings: RecordSettings,
        provenance: Mapping[str, str],
        trays: Sequence[int],
        *,
        wait_for_disk: bool = False,
    ) -> None:
        self._node = node
        self._quality = settings.record_quality
        self._wait_for_disk = wait_for_disk
        self._epoch_ns: int | None = None
        self._reported_drops = 0
        # What ended the recording before its time.
        self._failed = ''
        self._ended = False
        self._path = settings.record
        self._disk = DiskSpace(self._path)
        node.diagnostics.watched += [self._disk_low, self._lost_frames, self._stopped]
        by_name = {
            topic.absolute(tray): offered_topic(topic) for topic in topics.TOPICS for tray in trays
        }
        self._recorder = Recorder(self._path, by_name, metadata=provenance)
        node.create_timer(_CHECK_S, self._report, clock=node.steady_clock)

    def record_camera_info(self, message: object) -> None:
        """Record a CameraInfo."""
        self._put(topics.CAMERA_INFO, message)

    def record_epoch(self, stamp_ns: int) -> None:
        """Record what `time` in the arrays counts from, when it is new."""
        if stamp_ns != self._epoch_ns:
            self._epoch_ns = stamp_ns
            self._recorder.put(topics.EPOCH.absolute(), partial(time_message, stamp_ns))

    def record_frame(self, frame: Frame, message: object = None) -> None:
        """Record a frame.

        Parameters
        ----------
        frame : Frame
        message : object, optional
            That the frame came in, live or from a bag.
        """
        self._recorder.advance(frame.stamp_ns)
        topic, wait = topics.RAW_COMPRESSED, self._wait_for_disk
        if isinstance(message, CompressedImage):
            self._put(topic, message, size=len(message.data), wait=wait)
        elif isinstance(message, BagMessage) and message.type == topics.COMPRESSED:
            self._put(topic, message, size=len(message.cdr), wait=wait)
        else:
            encode = partial(_as_jpeg, frame, self._quality)
            self._recorder.put(topic.absolute(), encode, size=frame.image.nbytes, wait=wait)

    def record_result(self, topic: Topic, message: object, tray: int) -> None:
        """Record a result that travels as an array; images are not recorded."""
        if topic.type == topics.ARRAY:
            self._put(topic, message, tray)

    def _put(
        self, topic: Topic, message: object, tray: int = 0, *, size: int = 0, wait: bool = False
    ) -> None:
        serialize = partial(_serialized, message)
        self._recorder.put(topic.absolute(tray), serialize, size=size, wait=wait)

    def close(self) -> None:
        """Write what waits, and the index of the bag."""
        self._ended = True
        self._recorder.close()
        self._report()

    def _report(self) -> None:
        """Log problems; the graph continues."""
        recorder, diagnostics = self._recorder, self._node.diagnostics
        diagnostics.values['messages recorded'] = recorder.written
        diagnostics.values['frames not recorded'] = recorder.dropped
        if recorder.dropped > self._reported_drops:
            self._reported_drops = recorder.dropped
            self._node.get_logger().warning(
                self._too_slow(), throttle_duration_sec=_REPEAT_WARNING_S
            )
        if recorder.problem is not None and not self._failed:
            self._node.exit_code = 1
            if not isinstance(recorder.problem, NanorocksError):
                raise recorder.problem
            self._failed = (
                f'{recorder.problem}; the recording ended, the bag stays readable up to here, '
                'the graph continues'
            )
            self._node.get_logger().error(self._failed)

    def _too_slow(self) -> str:
        return (
            f'{self._path}: the disk is too slow; {self._recorder.dropped} frames are not '
            'recorded so far, all results are'
        )

    def _lost_frames(self) -> Problem | None:
        if not self._recorder.dropped or self._failed:
            return None
        return Problem(Level.WARN, self._too_slow(), FRAMES_LOST)

    def _stopped(self) -> Problem | None:
        return Problem(Level.ERROR, self._failed, RECORDING_STOPPED) if self._failed else None

    def _disk_low(self) -> Problem | None:
        if self._failed or self._ended:
            return None
        try:
            free = shutil.disk_usage(self._path).free
        except OSError:
            # The recorder tells what is wrong with the folder.
            return None
        self._node.diagnostics.values['disk left [GB]'] = f'{free / 1e9:.1f}'
        return self._disk.problem(free)


def provenance(source: str, *settings: Any) -> dict[str, str]:
    """Metadata that tell where a recording comes from.

    Parameters
    ----------
    source : str
        Of the frames.
    settings : dataclasses of settings
    """
    values = {row.name: str(row.default) for group in settings for row in rows(group)}
    said = {k: v for group in settings for k, v in _experiment(group).items()}
    return {'nanorocks_ros': __version__, 'source': source, **values, **said}


def _experiment(settings: Any) -> dict[str, str]:
    """What the recording is to say of its trays."""
    return metadata_of_settings(settings) if isinstance(settings, PipelineSettings) else {}


def _serialized(message: Any) -> bytes:
    cdr: bytes = message.cdr if isinstance(message, BagMessage) else serialize_message(message)
    return cdr


def _as_jpeg(frame: Frame, quality: int) -> object:
    jpeg = frame_to_jpeg(frame, quality)
    return compressed_image_message(frame.stamp_ns, 'camera', _JPEG_FORMAT, jpeg)
