"""The camera and everything the graph finds out, written into a bag while it works."""

from __future__ import annotations

from functools import partial

from rclpy.serialization import serialize_message
from sensor_msgs.msg import CompressedImage

from nanorocks_ros import __version__
from nanorocks_ros.errors import NanorocksError
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.reader import BagMessage
from nanorocks_ros.recordings.bag.recorder import Recorder
from nanorocks_ros.recordings.messages.image_messages import frame_to_jpeg
from nanorocks_ros.recordings.messages.message_builders import (
    compressed_image_message,
    time_message,
)
from nanorocks_ros.settings import rows
from nanorocks_ros.wire import topics

_LOOK_S = 1.0
_JPEG = 'bgr8; jpeg compressed bgr8'


class GraphRecorder:
    """Records what a node takes and says.

    Topics stand in the bag under the default namespace, wherever the graph lives. Pictures that
    come compressed are kept as they are; others become JPEGs, in the thread that writes.

    Parameters
    ----------
    node : NanorocksNode
    settings : RecordSettings
    provenance : mapping of str to str
        Kept with the bag.
    trays : sequence of int
    patient : bool
        Let the frames wait for the disk, rather than leave some out.
    """

    def __init__(self, node, settings, provenance, trays, patient=False):
        self._node = node
        self._quality = settings.record_quality
        self._patient = patient
        self._epoch_ns = None
        self._dropped = 0
        self._failed = False
        self._path = settings.record
        per_tray = {
            topic.absolute(k): offered_topic(topic) for topic in topics.TOPICS for k in trays
        }
        self._recorder = Recorder(self._path, per_tray, metadata=provenance)
        node.create_timer(_LOOK_S, self._look, clock=node.steady_clock)

    def lens(self, message):
        """Keep what is known of the lens."""
        self._put(topics.CAMERA_INFO, message)

    def epoch(self, stamp_ns):
        """Keep what `time` in the arrays counts from."""
        if stamp_ns != self._epoch_ns:
            self._epoch_ns = stamp_ns
            self._recorder.put(topics.EPOCH.absolute(), partial(time_message, stamp_ns))

    def frame(self, frame, message=None):
        """Keep a frame.

        Parameters
        ----------
        frame : Frame
        message : object, optional
            That it came in, live or from a bag.
        """
        self._recorder.advance(frame.stamp_ns)
        topic = topics.RAW_COMPRESSED
        if isinstance(message, CompressedImage):
            self._put(topic, message, size=len(message.data), wait=self._patient)
        elif isinstance(message, BagMessage) and message.type == topics.COMPRESSED:
            self._put(topic, message, size=len(message.cdr), wait=self._patient)
        else:
            make = partial(_as_jpeg, frame, self._quality)
            size = frame.image.nbytes
            self._recorder.put(topic.absolute(), make, size=size, wait=self._patient)

    def result(self, topic, message, tray):
        """Keep a result; pictures are not."""
        if topic.type == topics.ARRAY:
            self._put(topic, message, tray)

    def _put(self, topic, message, tray=0, **how):
        self._recorder.put(topic.absolute(tray), partial(_cdr, message), **how)

    def close(self):
        """Write what waits, and the index."""
        self._recorder.close()
        self._look()

    def _look(self):
        """Say what went wrong; the graph goes on."""
        recorder = self._recorder
        self._node.state['messages recorded'] = recorder.written
        self._node.state['frames not recorded'] = recorder.dropped
        if recorder.dropped > self._dropped:
            self._dropped = recorder.dropped
            self._node.trouble = (
                f'{self._path}: the disk does not keep up; {recorder.dropped} frames are not '
                'recorded so far, all results are'
            )
            self._node.get_logger().warning(self._node.trouble, throttle_duration_sec=_LOOK_S * 5)
        if recorder.problem is not None and not self._failed:
            self._failed = True
            self._node.exit_code = 1
            if not isinstance(recorder.problem, NanorocksError):
                raise recorder.problem
            self._node.trouble = (
                f'{recorder.problem}; recording has ended, what was written stays readable, and '
                'the graph goes on'
            )
            self._node.get_logger().error(self._node.trouble)


def provenance(source, *settings):
    """Where a recording comes from.

    Parameters
    ----------
    source : str
        Of the frames.
    settings : dataclasses of settings
    """
    values = {row.name: str(row.default) for one in settings for row in rows(one)}
    return {'nanorocks_ros': __version__, 'source': source, **values}


def _cdr(message):
    return message.cdr if isinstance(message, BagMessage) else serialize_message(message)


def _as_jpeg(frame, quality):
    return compressed_image_message(frame.stamp_ns, 'camera', _JPEG, frame_to_jpeg(frame, quality))
