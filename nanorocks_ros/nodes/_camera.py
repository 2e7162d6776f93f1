"""The camera topic, raw or compressed, as frames, and what is known of its lens."""

from __future__ import annotations

from dataclasses import replace

from rclpy.event_handler import SubscriptionEventCallbacks
from sensor_msgs.msg import CameraInfo

from nanorocks_ros.errors import FrameError
from nanorocks_ros.nodes._gaps import Gaps
from nanorocks_ros.nodes._shell import qos_of
from nanorocks_ros.recordings.messages.camera_info import info_from_message, view_from_message
from nanorocks_ros.recordings.messages.image_messages import (
    frame_from_compressed,
    frame_from_image,
    stamp_ns_of,
)
from nanorocks_ros.wire import topics

# Frames that are held back for a camera_info that somebody offers, but has not sent yet.
_PATIENCE_FRAMES = 30


class Camera:
    """Subscribes to the camera and hands on each frame.

    Parameters
    ----------
    node : NanorocksNode
    settings : CameraSettings
    take : callable
        Called with each Frame; `message` is what it came in.
    look : callable, optional
        Called when the lens becomes known or changes; `view` is the new View. Without it the
        lens is not asked for.

    Attributes
    ----------
    message, lens_message : sensor_msgs messages or None
        The last of each that was handed on.
    """

    def __init__(self, node, settings, take, look=None):
        compressed = settings.transport == 'compressed'
        topic = topics.RAW_COMPRESSED if compressed else topics.RAW
        self._read = frame_from_compressed if compressed else frame_from_image
        self._node, self._take, self._look = node, take, look
        self._info = None
        self._refusal = None
        self._held = []
        self._last = None
        self._started = False
        self._gaps = Gaps()
        self.view = None
        self.lens_message = None
        self.message = None
        self.topic = node.resolve_topic_name(topic.name)
        self._info_topic = node.resolve_topic_name(topics.CAMERA_INFO.name)
        if look is not None:
            # Ours is latched; drivers send one with each frame and keep none.
            for latched in (True, False):
                node.create_subscription(
                    CameraInfo,
                    topics.CAMERA_INFO.name,
                    self._lens,
                    qos_of(replace(topics.CAMERA_INFO, latched=latched)),
                    event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
                )
        node.watch.alone_on(topic.name)
        node.tell_what_is_taken([node.listen(topic, self._take_message)])

    def _lens(self, message):
        info = info_from_message(message)
        if info == self._info:
            return
        self._info, self._refusal = info, None
        try:
            self.view = view_from_message(message, self._info_topic)
            self.lens_message = message
        except FrameError as error:
            # Frames that are not straight would give wrong numbers, so they are refused too.
            self._refusal = error
            self._node.refuse(error)
            return
        if self._started:
            self._node.get_logger().info(f'{self._info_topic}: a new lens; starting afresh')
        self._look()
        self._release()

    def _take_message(self, message):
        try:
            self._message(message)
        finally:
            self._node.taken(stamp_ns_of(message))

    def _message(self, message):
        waiting = self._look is not None and self._info is None and not self._started
        offered = waiting and self._node.count_publishers(self._info_topic) > 0
        if offered and len(self._held) < _PATIENCE_FRAMES:
            self._held.append(message)
            return
        if waiting:
            self._node.get_logger().info(
                f'{self._info_topic}: nothing known of the lens; the picture is taken as straight'
            )
        self._started = True
        self._release()
        self._hand_on(message)

    def _release(self):
        held, self._held = self._held, []
        self._started = self._started or bool(held)
        for message in held:
            self._node.timed(self._hand_on, message)

    def _hand_on(self, message):
        if self._refusal is not None:
            raise self._refusal
        frame = self._read(message, self.topic)
        if self._gaps.push(frame.stamp_ns):
            self._node.tell_missing(self.topic, self._gaps.missing)
        # The last frame is let go only now that there is the next one: otherwise its 6 MB go back
        # to the system each time, and to get them again took as long as decoding.
        self._last, self.message = frame, message
        self._take(frame)
